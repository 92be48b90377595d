//! The folder of this machine's graphs, and the room that paths of sockets leave for their names.

use std::fs::{self, File};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

/// Longest path of a socket, bytes.
const SOCKET_PATH_MAX: usize = 107;
/// What the transport names a socket by, after the graph's prefix: a number of 128 bits, of which
/// the upper 32 count a process's ports, up to 12,000 of them; then `.event`.
const SOCKET_NAME_LENGTH: usize = 33 + 6;

/// `/run/vigil` where the user may write there, else the user's own runtime folder. Short, since
/// paths of sockets are.
pub(crate) fn runtime_folder() -> PathBuf {
    let system = PathBuf::from("/run/vigil");
    if fs::DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(&system)
        .is_ok()
        && tempfile_works(&system)
    {
        return system;
    }
    if let Some(user) = std::env::var_os("XDG_RUNTIME_DIR") {
        return PathBuf::from(user).join("vigil");
    }
    // SAFETY: no arguments, no effects, cannot fail.
    #[allow(unsafe_code)]
    let uid = unsafe { libc::getuid() };
    std::env::temp_dir().join(format!("vigil-{uid}"))
}

fn tempfile_works(folder: &Path) -> bool {
    let probe = folder.join(format!(".probe-{}", std::process::id()));
    let works = File::create(&probe).is_ok();
    let _ = fs::remove_file(probe);
    works
}

/// By how many bytes the path of a socket in this folder, with this prefix, is too long; 0 if it
/// fits.
pub(crate) fn excess_bytes(folder: &Path, prefix_length: usize) -> usize {
    let folder = folder.as_os_str().len() + 1;
    (folder + prefix_length + SOCKET_NAME_LENGTH).saturating_sub(SOCKET_PATH_MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_of_107_bytes_is_the_longest_that_fits() {
        let folder = |length| PathBuf::from("/".repeat(length));
        assert_eq!(excess_bytes(&folder(47), 20), 0);
        assert_eq!(excess_bytes(&folder(48), 20), 1);
        assert_eq!(excess_bytes(&folder(60), 30), 23);
    }
}
