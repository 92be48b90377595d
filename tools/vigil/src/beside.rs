//! Programs beside this one.

use std::path::PathBuf;

use vigil_terminal::CommandError;

/// Path of a program in this one's folder.
///
/// # Errors
/// What to build, if it is not there.
pub fn program(name: &str) -> Result<PathBuf, CommandError> {
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
