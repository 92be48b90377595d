//! A recording that is not finished: its name, and the lock of its writer.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

/// Where a recording stands until it is whole.
#[must_use]
pub fn part_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    name.into()
}

/// Says that the file is being written, until it is closed.
pub(crate) fn lock(file: &File) {
    // A file system without locks has none.
    let _ = file.try_lock();
}

/// True while somebody writes the file.
#[must_use]
pub fn is_being_written(path: &Path) -> bool {
    let file = File::open(path);
    file.is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
}
