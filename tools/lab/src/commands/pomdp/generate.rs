//! `vigil pomdp generate`: a model from its parameters, of exceptions, of navigation or of faults.

use std::fmt::Display;
use std::fs;
use std::path::PathBuf;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use vigil_missions::{exceptions, navigation, recovery};

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
    #[arg(long)]
    out: Option<PathBuf>,
}

/// What a file of parameters is for.
#[derive(Deserialize)]
struct Purpose {
    model: Model,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Model {
    Exceptions,
    Navigation,
    Recovery,
}

/// Runs the command.
///
/// # Errors
/// A file that cannot be read or written, a parameter that means nothing.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let text = fs::read_to_string(&args.parameters)
        .map_err(|error| refused(args, &format!("cannot be read: {error}")))?;
    let model = match read::<Purpose>(args, &text)?.model {
        Model::Exceptions => {
            exceptions::generate(&read(args, &text)?).map_err(|error| refused(args, &error))?
        }
        Model::Navigation => {
            navigation::generate(&read(args, &text)?).map_err(|error| refused(args, &error))?
        }
        Model::Recovery => {
            recovery::generate(&read(args, &text)?).map_err(|error| refused(args, &error))?
        }
    };
    match &args.out {
        Some(out) => save(out, model)?,
        None => output::line(model.trim_end()).map_err(CommandError::failure)?,
    }
    Ok(Outcome::Done)
}

fn refused(args: &Args, error: &dyn Display) -> CommandError {
    CommandError::usage(format!("{}: {error}", args.parameters.display()))
}

fn read<T: DeserializeOwned>(args: &Args, text: &str) -> Result<T, CommandError> {
    toml::from_str(text).map_err(|error| refused(args, &error))
}
