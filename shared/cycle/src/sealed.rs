//! Text for child processes that nobody can change any more.

use std::fs::File;
use std::io::{self, Write};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::path::PathBuf;

/// A text in a sealed memory file, which child processes inherit. It leaves nothing behind.
#[derive(Debug)]
pub struct SealedText(File);

impl SealedText {
    /// Keeps `text`, and seals it: it can neither grow, shrink nor change.
    ///
    /// # Errors
    /// The system's.
    pub fn new(text: &str) -> io::Result<Self> {
        // SAFETY: the name is a constant C string; a result that is no error is a new descriptor,
        // which nobody else owns. Without MFD_CLOEXEC, so that child processes inherit it.
        #[allow(unsafe_code)]
        let mut file = unsafe {
            let fd = libc::memfd_create(c"vigil".as_ptr(), libc::MFD_ALLOW_SEALING);
            if fd < 0 {
                return Err(io::Error::last_os_error());
            }
            File::from(OwnedFd::from_raw_fd(fd))
        };
        file.write_all(text.as_bytes())?;
        let seals =
            libc::F_SEAL_SEAL | libc::F_SEAL_SHRINK | libc::F_SEAL_GROW | libc::F_SEAL_WRITE;
        // SAFETY: a plain system call on a descriptor that `file` owns.
        #[allow(unsafe_code)]
        let failed = unsafe { libc::fcntl(file.as_raw_fd(), libc::F_ADD_SEALS, seals) } < 0;
        if failed {
            return Err(io::Error::last_os_error());
        }
        Ok(Self(file))
    }

    /// The path at which this process and its children read it from the start.
    #[must_use]
    pub fn path(&self) -> PathBuf {
        format!("/proc/self/fd/{}", self.0.as_raw_fd()).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    #[test]
    fn children_read_it_as_often_as_they_like_and_nobody_changes_it() {
        let sealed = SealedText::new("as it was\n").unwrap();
        for _ in 0..2 {
            let read = Command::new("cat").arg(sealed.path()).output().unwrap();
            assert_eq!(read.stdout, b"as it was\n");
        }
        let changed = std::fs::write(sealed.path(), "other");
        assert_eq!(changed.unwrap_err().kind(), io::ErrorKind::PermissionDenied);
        assert_eq!(std::fs::read(sealed.path()).unwrap(), b"as it was\n");
    }
}
