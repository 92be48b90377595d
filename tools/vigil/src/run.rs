//! `vigil run`: becomes the launcher, another program beside this one.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::process::Command;

use vigil_terminal::{CommandError, Outcome};

use crate::beside;

/// Becomes `vigil-launcher` with the words that this command was given after its name; they have
/// been understood already.
///
/// # Errors
/// A program that is not there.
pub fn run() -> Result<Outcome, CommandError> {
    let words = std::env::args_os().skip_while(|word| word != "run").skip(1);
    let words: Vec<OsString> = words.collect();
    let program = beside::program("vigil-launcher")?;
    let error = Command::new(&program).args(words).exec();
    Err(CommandError::failure(format!(
        "{}: {error}",
        program.display()
    )))
}
