//! `vigil types`: the wire blocks as types of another language.

use clap::ValueEnum;

use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

use crate::bindings;

/// Prints the wire blocks as a header for C and C++, or a module for Python.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Language to print the types in.
    language: Language,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Language {
    /// A header for C11 and C++17.
    C,
    /// A module for Python 3, with ctypes.
    Python,
}

/// Prints it.
///
/// # Errors
/// Standard output's.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let text = match args.language {
        Language::C => bindings::header(),
        Language::Python => bindings::module(),
    };
    output::line(text.trim_end()).map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}
