//! `vigil pomdp`: what can be done with a decision model, one command a module.

pub mod compare;
pub mod convert;
mod escalation;
pub mod fit;
mod generate;
pub mod info;
pub mod learn;
pub mod missions;
mod parameters;
mod picture;
mod planner;
mod seed;
mod simulate;
pub mod solve;
mod solved;
pub mod track;
pub mod value;

use std::path::Path;

use serde::Serialize;
use vigil_pomdp::Pomdp;

use vigil_terminal::{CommandError, Outcome, output};

/// Checks, solves, compares, learns, draws and converts decision models (`.pomdp`, `.pomdpx`).
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Compare(Box<compare::Args>),
    Fit(fit::Args),
    Generate(generate::Args),
    Info(info::Args),
    Learn(learn::Args),
    Missions(missions::Args),
    Picture(picture::Args),
    Simulate(simulate::Args),
    Track(track::Args),
    Convert(convert::Args),
    Solve(solve::Args),
    Value(value::Args),
}

/// Does what the subcommand says.
///
/// # Errors
/// An input that is refused; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    match &args.command {
        Command::Compare(args) => compare::run(args),
        Command::Fit(args) => fit::run(args),
        Command::Generate(args) => generate::run(args),
        Command::Info(args) => info::run(args),
        Command::Learn(args) => learn::run(args),
        Command::Missions(args) => missions::run(args),
        Command::Picture(args) => picture::run(args),
        Command::Simulate(args) => simulate::run(args),
        Command::Track(args) => track::run(args),
        Command::Convert(args) => convert::run(args),
        Command::Solve(args) => solve::run(args),
        Command::Value(args) => value::run(args),
    }
}

/// Prints a command's document as JSON, or as text to read.
///
/// # Errors
/// The system's.
fn print(
    as_json: bool,
    document: &impl Serialize,
    text: impl FnOnce() -> String,
) -> Result<(), CommandError> {
    let printed = if as_json {
        output::json(document)
    } else {
        output::line(&text())
    };
    printed.map_err(CommandError::failure)
}

/// Writes a file.
///
/// # Errors
/// The file's name and the system's.
fn save(path: &Path, content: impl AsRef<[u8]>) -> Result<(), CommandError> {
    let written = std::fs::write(path, content);
    written.map_err(|error| CommandError::failure(format!("{}: {error}", path.display())))
}

/// Largest file, bytes: the model readers' own limit.
const FILE_BYTES_MAX: u64 = 256 << 20;

/// Reads a file that is not too large.
///
/// # Errors
/// The file's name, and the system's or what is allowed.
fn bytes_of(path: &Path) -> Result<Vec<u8>, CommandError> {
    let wrong = |problem: &dyn std::fmt::Display| {
        CommandError::usage(format!("{}: {problem}", path.display()))
    };
    let size = std::fs::metadata(path).map_err(|e| wrong(&e))?.len();
    if size > FILE_BYTES_MAX {
        let problem = format!("{size} bytes, allowed are {FILE_BYTES_MAX}");
        return Err(wrong(&problem));
    }
    std::fs::read(path).map_err(|e| wrong(&e))
}

/// Reads a model: APPL's format if the name ends in `.pomdpx`, otherwise Cassandra's.
///
/// # Errors
/// The file's name, line and column, what was found and what is allowed.
fn load(path: &Path) -> Result<Pomdp, CommandError> {
    let wrong = |problem: &dyn std::fmt::Display| {
        CommandError::usage(format!("{}: {problem}", path.display()))
    };
    let bytes = bytes_of(path)?;
    // Old files hold comments in other encodings; names are plain.
    let text = String::from_utf8_lossy(&bytes);
    let is_xml = path
        .extension()
        .is_some_and(|extension| extension == "pomdpx");
    let model = if is_xml {
        Pomdp::parse_pomdpx(&text)
    } else {
        Pomdp::parse(&text)
    };
    model.map_err(|e| wrong(&e))
}
