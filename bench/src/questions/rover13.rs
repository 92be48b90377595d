//! How fast is a particle filter? A plain one and the lanes at each level, in turn, in one process.
//!
//! Per row: time per particle and step.

use std::error::Error;
use std::path::Path;

use serde_json::json;
use vigil_bench::archive::Archive;
use vigil_bench::{machine, speed};

use super::Json;

/// Answers the question.
pub fn run(args: &Json) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build measures nothing: use scripts/bench".into());
    }
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/filters");
    let rows = speed::rows(&data)?;
    let document = json!({ "machine": machine::facts(), "rows": rows });
    if args.json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("rover13")?;
    archive.store("rover13.json", &document)?;
    speed::report(&mut archive, &rows);
    archive.close()?;
    Ok(())
}
