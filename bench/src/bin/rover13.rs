//! How fast is a particle filter? A plain one and the lanes at each level, in turn, in one process.
//!
//! `--json` prints the document instead of archiving it. Per row: time per particle and step.

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

use serde_json::json;
use vigil_bench::archive::Archive;
use vigil_bench::{machine, speed};

fn main() -> ExitCode {
    vigil_bench::ended("rover13", run())
}

fn run() -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build measures nothing: use scripts/bench".into());
    }
    let options: Vec<String> = std::env::args().skip(1).collect();
    let is_json = options == ["--json"];
    if !is_json && !options.is_empty() {
        return Err(format!("{options:?}: the only option is --json").into());
    }
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/filters");
    let rows = speed::rows(&data)?;
    let document = json!({ "machine": machine::facts(), "rows": rows });
    if is_json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("rover13")?;
    archive.store("rover13.json", &document)?;
    speed::report(&mut archive, &rows);
    println!("archived in {}", archive.close()?.display());
    Ok(())
}
