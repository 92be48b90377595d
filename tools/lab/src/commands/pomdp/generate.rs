//! `vigil pomdp generate`: the navigation model from its parameters.

use std::fs;
use std::path::PathBuf;

use vigil_missions::navigation::{self, Parameters};

use super::save;
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Writes the navigation model that follows from a file of parameters.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Parameters, such as config/navigation.toml.
    parameters: PathBuf,
    /// Where to write the model; standard output if it is not given.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// A file that cannot be read or written, a parameter that means nothing.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let name = args.parameters.display();
    let text = fs::read_to_string(&args.parameters)
        .map_err(|error| CommandError::usage(format!("{name}: cannot be read: {error}")))?;
    let parameters: Parameters =
        toml::from_str(&text).map_err(|error| CommandError::usage(format!("{name}: {error}")))?;
    let model = navigation::generate(&parameters)
        .map_err(|error| CommandError::usage(format!("{name}: {error}")))?;
    match &args.out {
        Some(out) => save(out, model)?,
        None => output::line(model.trim_end()).map_err(CommandError::failure)?,
    }
    Ok(Outcome::Done)
}
