//! Blocking until input or an absolute deadline, to the microsecond.
//!
//! iceoryx2's own deadlines have a granularity of 1 ms; `ppoll` over the listener's socket and a
//! `timerfd` has none of that and allocates nothing.

use std::io;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};

use crate::clock::timespec;

/// Why the wait ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wake {
    /// The input's descriptor is readable.
    Input,
    /// The instant has come.
    Deadline,
    /// A signal arrived.
    Signal,
}

/// A timer that expires at an absolute instant of `CLOCK_MONOTONIC`.
#[derive(Debug)]
pub struct Timer {
    fd: OwnedFd,
}

impl Timer {
    /// Creates a disarmed timer.
    ///
    /// # Errors
    /// The system's, when no descriptor is left.
    pub fn new() -> io::Result<Self> {
        // SAFETY: a new descriptor or -1; ownership of a valid one passes to `OwnedFd`.
        #[allow(unsafe_code)]
        unsafe {
            let flags = libc::TFD_NONBLOCK | libc::TFD_CLOEXEC;
            let fd = libc::timerfd_create(libc::CLOCK_MONOTONIC, flags);
            if fd < 0 {
                return Err(io::Error::last_os_error());
            }
            Ok(Self {
                fd: OwnedFd::from_raw_fd(fd),
            })
        }
    }

    /// Expires once at `at_ns`; clears an expiry that is pending.
    pub fn arm(&self, at_ns: u64) {
        let spec = libc::itimerspec {
            it_value: timespec(at_ns.max(1)),
            it_interval: timespec(0),
        };
        // SAFETY: the descriptor is a timerfd for as long as self lives; `spec` outlives the call.
        #[allow(unsafe_code)]
        unsafe {
            libc::timerfd_settime(
                self.fd.as_raw_fd(),
                libc::TFD_TIMER_ABSTIME,
                &raw const spec,
                std::ptr::null_mut(),
            );
        }
    }
}

/// In place of a descriptor: there is none.
pub const NOTHING: RawFd = -1;

/// Descriptors that a wait looks at.
pub const INPUTS: usize = 3;

/// What wakes a stage: descriptors that become readable when there is input.
pub trait Inputs {
    /// The descriptors; [`NOTHING`] in an unused place.
    fn descriptors(&self) -> [RawFd; INPUTS];

    /// Consumes pending wake-ups that are not input themselves; else the descriptors stay readable.
    fn drain(&self) {}
}

/// Blocks until one of `inputs` is readable or `deadline_ns` has come.
pub fn wait(timer: &Timer, inputs: [RawFd; INPUTS], deadline_ns: u64) -> Wake {
    timer.arm(deadline_ns);
    let poll = |fd| libc::pollfd {
        fd,
        events: libc::POLLIN,
        revents: 0,
    };
    let [first, second, third] = inputs.map(poll);
    let mut fds = [first, second, third, poll(timer.fd.as_raw_fd())];
    // SAFETY: `fds` holds valid entries, of which the kernel ignores negative ones; null
    // time-out and mask mean "no limit, no change".
    #[allow(unsafe_code)]
    let ready = unsafe {
        libc::ppoll(
            fds.as_mut_ptr(),
            fds.len() as u64,
            std::ptr::null(),
            std::ptr::null(),
        )
    };
    if ready < 0 {
        Wake::Signal
    } else if fds[..INPUTS].iter().any(|fd| fd.revents != 0) {
        Wake::Input
    } else {
        Wake::Deadline
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::{Clock, Monotonic};

    #[test]
    fn the_timer_never_wakes_early_and_input_wakes_at_once() {
        let (timer, idle) = (Timer::new().unwrap(), Timer::new().unwrap());
        let at_ns = Monotonic.now_ns() + 3_000_000;
        let idle_fd = [NOTHING, NOTHING, idle.fd.as_raw_fd()];
        assert_eq!(wait(&timer, idle_fd, at_ns), Wake::Deadline);
        assert!(Monotonic.now_ns() >= at_ns);
        idle.arm(1);
        let far_ns = Monotonic.now_ns() + 3_600_000_000_000;
        assert_eq!(wait(&timer, idle_fd, far_ns), Wake::Input);
        let near_ns = Monotonic.now_ns() + 1_000_000;
        assert_eq!(wait(&timer, [NOTHING; INPUTS], near_ns), Wake::Deadline);
    }
}
