//! Programs beside this one.

use std::convert::Infallible;
use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::Command;

use vigil_terminal::{CommandError, CommandTree};

/// A program in this one's folder.
#[derive(Debug, Clone, Copy)]
pub struct Program {
    /// Its name.
    pub name: &'static str,
    /// What `cargo build` is to be told for it.
    pub build: &'static str,
}

/// Becomes a program in this one's folder, with these words.
///
/// # Errors
/// What to build, if it is not there; why it cannot be executed.
pub fn become_program(
    program: Program,
    words: impl IntoIterator<Item = OsString>,
) -> Result<Infallible, CommandError> {
    let program = path(program)?;
    let error = Command::new(&program).args(words).exec();
    Err(CommandError::failure(format!(
        "{}: {error}",
        program.display()
    )))
}

/// What a program in this one's folder declares.
///
/// # Errors
/// What to build, if it is not there; one that does not answer.
pub fn commands(program: Program) -> Result<CommandTree, CommandError> {
    let path = path(program)?;
    let failed = |error| CommandError::failure(format!("{}: {error}", path.display()));
    CommandTree::ask(&path).map_err(failed)
}

/// Path of a program in this one's folder.
///
/// # Errors
/// What to build, if it is not there.
fn path(of: Program) -> Result<PathBuf, CommandError> {
    let here = std::env::current_exe().map_err(CommandError::failure)?;
    let program = here.with_file_name(of.name);
    if program.is_file() {
        return Ok(program);
    }
    let release = match cfg!(debug_assertions) {
        true => "",
        false => " --release",
    };
    Err(CommandError::usage(format!(
        "{} is not built: run `cargo build{release} {}`",
        program.display(),
        of.build
    )))
}
