//! `vigil pomdp generate`: a model from its parameters, of exceptions, of navigation or of faults.

use std::path::PathBuf;

use vigil_missions::{exceptions, navigation, recovery};

use super::parameters::{ModelKind, ParameterFile};
use super::save;
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Writes the model that follows from a file of parameters: of exceptions of navigation and
/// hardware (`model = "exceptions"`), of the paper's navigation, or of what to do about faults.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Parameters, such as config/corridor.recovery.toml or config/rover.recovery.toml.
    parameters: PathBuf,
    /// Where to write the model; standard output if it is not given.
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// A file that cannot be read or written, a parameter that means nothing.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let file = ParameterFile::read(&args.parameters)?;
    let model = match file.model {
        ModelKind::Exceptions => {
            exceptions::generate(&file.parsed()?).map_err(|error| file.refused(&error))?
        }
        ModelKind::Navigation => {
            navigation::generate(&file.parsed()?).map_err(|error| file.refused(&error))?
        }
        ModelKind::Recovery => {
            recovery::generate(&file.parsed()?).map_err(|error| file.refused(&error))?
        }
    };
    match &args.out {
        Some(out) => save(out, model)?,
        None => output::line(model.trim_end()).map_err(CommandError::failure)?,
    }
    Ok(Outcome::Done)
}
