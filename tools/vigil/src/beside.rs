//! Programs beside this one.

use std::convert::Infallible;
use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::Command;

use vigil_terminal::CommandError;

/// Becomes a program in this one's folder, with these words.
///
/// # Errors
/// What to build, if it is not there; why it cannot be executed.
pub fn become_program(
    name: &str,
    words: impl IntoIterator<Item = OsString>,
) -> Result<Infallible, CommandError> {
    let program = program(name)?;
    let error = Command::new(&program).args(words).exec();
    Err(CommandError::failure(format!(
        "{}: {error}",
        program.display()
    )))
}

/// Path of a program in this one's folder.
///
/// # Errors
/// What to build, if it is not there.
fn program(name: &str) -> Result<PathBuf, CommandError> {
    let here = std::env::current_exe().map_err(CommandError::failure)?;
    let program = here.with_file_name(name);
    if program.is_file() {
        return Ok(program);
    }
    let release = match cfg!(debug_assertions) {
        true => "",
        false => " --release",
    };
    Err(CommandError::usage(format!(
        "{} is not built: run `cargo build{release} -p {name}`",
        program.display()
    )))
}
