//! The lock of a graph: it says that the graph runs.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::Duration;

use crate::domain::Domain;

/// A publisher that asks whether a graph runs holds its lock for some microseconds.
const LOCK_ATTEMPTS: usize = 3;
/// Time between two attempts.
const LOCK_PAUSE: Duration = Duration::from_millis(5);

/// Holds the right to run a graph; released when dropped or when the process dies, and the
/// processes that inherited it as well.
#[derive(Debug)]
pub struct GraphLock {
    file: File,
    is_held: bool,
}

impl GraphLock {
    /// Lets the children that are started from now on hold the lock too: should the launcher die,
    /// its services drive on, and nobody can start a second graph over them.
    pub fn share_with_children(&self) {
        // SAFETY: the descriptor is open as long as self lives; only its close-on-exec flag
        // changes.
        #[allow(unsafe_code)]
        unsafe {
            libc::fcntl(self.file.as_raw_fd(), libc::F_SETFD, 0);
        }
    }

    /// Holds the lock from now on, if no process holds it that was started by another launcher.
    /// Children that share this lock then hold it as well.
    pub fn take_over(&mut self) {
        self.is_held = self.is_held || self.file.try_lock().is_ok();
    }
}

impl Domain {
    /// Takes the right to run this graph; `None` if another launcher holds it.
    ///
    /// # Errors
    /// The file system's.
    pub fn lock(&self) -> io::Result<Option<GraphLock>> {
        let file = open_to_lock(&self.lock_file())?;
        let is_held = lock_soon(&file)?;
        Ok(is_held.then_some(GraphLock { file, is_held }))
    }

    /// The lock of a graph whose services hold it, for a launcher that adopts them: see
    /// [`GraphLock::take_over`].
    ///
    /// # Errors
    /// The file system's.
    pub fn adopt_lock(&self) -> io::Result<GraphLock> {
        let file = open_to_lock(&self.lock_file())?;
        let is_held = false;
        Ok(GraphLock { file, is_held })
    }
}

/// Opens a file that is only there to be locked.
pub(crate) fn open_to_lock(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.create(true).truncate(false).write(true).mode(0o600);
    options.open(path)
}

/// Locks a file; false if it is held for longer than a look at it takes.
pub(crate) fn lock_soon(file: &File) -> io::Result<bool> {
    for _ in 0..LOCK_ATTEMPTS {
        match file.try_lock() {
            Ok(()) => return Ok(true),
            Err(fs::TryLockError::WouldBlock) => std::thread::sleep(LOCK_PAUSE),
            Err(fs::TryLockError::Error(error)) => return Err(error),
        }
    }
    Ok(false)
}
