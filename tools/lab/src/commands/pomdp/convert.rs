//! `vigil pomdp convert`: a model as a `.pomdp` file.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;

use super::{load, save};
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Writes a model (.pomdp or .pomdpx) as a .pomdp file.
///
/// The file reads back to the same model, bit by bit.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Where to write it; standard output if not given.
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON document about what was written; needs --out.
    #[arg(long, requires = "out")]
    json: bool,
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Path of the model read.
    file: String,
    /// Path of the model written.
    out: String,
    /// Hash of the model, which both files have.
    hash: String,
    /// Size of what was written, bytes.
    bytes: usize,
    /// What is doubtful in the model, each with its place.
    warnings: Vec<String>,
}

/// Writes it.
///
/// # Errors
/// A model that is refused; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let model = load(&args.file)?;
    let text = model.to_cassandra();
    let warnings = model.warnings().iter();
    let warnings: Vec<String> = warnings
        .map(|w| format!("{}: {}", w.at, w.message))
        .collect();
    for warning in &warnings {
        eprintln!("{}: warning: {warning}", args.file.display());
    }
    let Some(out) = &args.out else {
        output::line(text.trim_end()).map_err(CommandError::failure)?;
        return Ok(Outcome::Done);
    };
    if out
        .extension()
        .is_some_and(|extension| extension == "pomdpx")
    {
        let message = "--out: .pomdpx is read, not written; allowed is .pomdp";
        return Err(CommandError::usage(message));
    }
    save(out, &text)?;
    if args.json {
        let document = Document {
            schema_version: 1,
            file: args.file.display().to_string(),
            out: out.display().to_string(),
            hash: format!("{:016x}", model.hash()),
            bytes: text.len(),
            warnings,
        };
        output::json(&document).map_err(CommandError::failure)?;
    }
    Ok(Outcome::Done)
}
