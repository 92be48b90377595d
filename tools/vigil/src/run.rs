//! `vigil run`: becomes the launcher, another program beside this one.

use vigil_terminal::{CommandError, Outcome};

use crate::beside;

/// Becomes `vigil-launcher` with the words that this command was given after its name; they have
/// been understood already.
///
/// # Errors
/// A program that is not there.
pub fn run() -> Result<Outcome, CommandError> {
    let words = std::env::args_os().skip_while(|word| word != "run").skip(1);
    let program = beside::Program {
        name: "vigil-launcher",
        build: "-p vigil-launcher",
    };
    match beside::become_program(program, words)? {}
}
