//! `vigil pomdp generate`: a model from its parameters, of navigation or of what to do about
//! faults.

use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use vigil_missions::recovery::Leaf;
use vigil_missions::{navigation, recovery};
use vigil_setup::load_tree;

use super::save;
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Writes the model that follows from a file of parameters: of navigation or, with a fault tree, of
/// what to do about its faults.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Parameters, such as config/navigation.toml or, with --tree, config/recovery.toml.
    parameters: PathBuf,
    /// Fault tree whose faults something is to be done about, such as config/trees/rover.toml.
    #[arg(long, value_name = "TREE")]
    tree: Option<PathBuf>,
    /// Where to write the model; standard output if it is not given.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// A file that cannot be read or written, a parameter that means nothing.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let model = match &args.tree {
        None => navigation::generate(&parameters(args)?).map_err(|error| refused(args, &error))?,
        Some(tree) => {
            let leaves = leaves(tree)?;
            let parameters = parameters(args)?;
            recovery::generate(&parameters, &leaves).map_err(|error| refused(args, &error))?
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

fn parameters<T: DeserializeOwned>(args: &Args) -> Result<T, CommandError> {
    let text = fs::read_to_string(&args.parameters)
        .map_err(|error| refused(args, &format!("cannot be read: {error}")))?;
    toml::from_str(&text).map_err(|error| refused(args, &error))
}

fn leaves(tree: &Path) -> Result<Vec<Leaf>, CommandError> {
    let tree = load_tree(tree).map_err(CommandError::usage)?;
    let leaf = |at: usize| {
        let node = tree.nodes().get(at)?;
        Some(Leaf {
            name: node.name.clone(),
            fault: node.fault.clone()?,
        })
    };
    Ok(tree.leaves().filter_map(leaf).collect())
}
