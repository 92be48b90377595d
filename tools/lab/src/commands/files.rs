//! Files that commands write.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use vigil_terminal::CommandError;

/// Refuses a file that could not be written, before the work; `option` names it.
///
/// # Errors
/// A folder that is missing, or in the file's place.
pub fn check_place(option: &str, out: &Path) -> Result<(), CommandError> {
    let folder = out.parent().filter(|f| !f.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        let refused = format!("{option}: there is no folder {}", folder.display());
        return Err(CommandError::usage(refused));
    }
    if out.is_dir() {
        let refused = format!("{option}: {} is a folder, a file is wanted", out.display());
        return Err(CommandError::usage(refused));
    }
    Ok(())
}

/// Writes a file so that its place holds either the old one or the whole new one.
///
/// # Errors
/// The file's name and the system's.
pub fn write_whole(path: &Path, text: &str) -> Result<(), CommandError> {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    let part = PathBuf::from(name);
    let write = || {
        let mut file = File::create(&part)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        fs::rename(&part, path)
    };
    write().map_err(|error: std::io::Error| {
        // Nothing is left behind; that there may be nothing to remove is no error.
        let _ = fs::remove_file(&part);
        CommandError::failure(format!("{}: {error}", path.display()))
    })
}

/// The last part of a path: where a file lay is of no interest to others.
pub fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}
