//! Decision models: what they are worth, and the shipped one.

mod compare;
mod generate;

use std::fs;
use std::path::Path;

use clap::Subcommand;
use vigil_decision::Pomdp;

use super::{CommandError, Outcome};

/// Generate and compare decision models (POMDPs).
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Compare(Box<compare::Args>),
    Generate(generate::Args),
}

/// Runs the command.
///
/// # Errors
/// [`CommandError`].
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    match &args.command {
        Command::Compare(args) => compare::run(args),
        Command::Generate(args) => generate::run(args),
    }
}

/// Reads a decision model.
fn load(path: &Path) -> Result<Pomdp, CommandError> {
    let name = path.display();
    let text = fs::read_to_string(path)
        .map_err(|error| CommandError::usage(format!("{name}: cannot be read: {error}")))?;
    Pomdp::parse(&text).map_err(|error| CommandError::usage(format!("{name}: {error}")))
}
