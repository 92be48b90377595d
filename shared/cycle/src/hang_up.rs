//! Whether anybody still reads what this process writes.

use std::os::fd::AsRawFd;

/// True once the reader of a pipe, or the terminal, is gone. It neither reads nor writes.
#[must_use]
pub fn has_hung_up(file: &impl AsRawFd) -> bool {
    let mut poll = libc::pollfd {
        fd: file.as_raw_fd(),
        events: 0,
        revents: 0,
    };
    // SAFETY: one structure, which lives on this stack; no time is waited.
    #[allow(unsafe_code)]
    let count = unsafe { libc::poll(&raw mut poll, 1, 0) };
    count == 1 && poll.revents & (libc::POLLERR | libc::POLLHUP) != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pipe_has_hung_up_once_its_reader_is_gone() {
        let (reader, writer) = std::io::pipe().unwrap();
        assert!(!has_hung_up(&writer));
        drop(reader);
        assert!(has_hung_up(&writer));
    }
}
