//! Absolute time, real or virtual.

use std::cell::Cell;
use std::rc::Rc;

/// A clock that never goes back; ns since an arbitrary origin.
pub trait Clock {
    /// Now, ns.
    fn now_ns(&self) -> u64;
}

/// The kernel's `CLOCK_MONOTONIC`, the same for every process of the machine.
#[derive(Debug, Clone, Copy, Default)]
pub struct Monotonic;

impl Clock for Monotonic {
    fn now_ns(&self) -> u64 {
        let mut time = libc::timespec {
            tv_sec: 0,
            tv_nsec: 0,
        };
        // SAFETY: `time` is a valid, writable timespec; CLOCK_MONOTONIC always exists on Linux.
        #[allow(unsafe_code)]
        unsafe {
            libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut time);
        }
        time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
    }
}

/// Processor time that this process has taken, all its threads together, s.
#[must_use]
pub fn process_cpu_s() -> f64 {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: `time` is a valid, writable timespec; CLOCK_PROCESS_CPUTIME_ID always exists on
    // Linux.
    #[allow(unsafe_code)]
    unsafe {
        libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &raw mut time);
    }
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// A clock that moves only when told to: the present of the process that is being simulated.
/// Clones share the time.
#[derive(Debug, Clone, Default)]
pub struct VirtualClock {
    now_ns: Rc<Cell<u64>>,
}

impl VirtualClock {
    /// Moves on by `ns`.
    pub fn advance(&self, ns: u64) {
        self.now_ns.set(self.now_ns.get() + ns);
    }

    /// Moves to `ns`. Back is allowed: processes that are simulated one after the other run at
    /// the same time.
    pub fn set(&self, ns: u64) {
        self.now_ns.set(ns);
    }
}

impl Clock for VirtualClock {
    fn now_ns(&self) -> u64 {
        self.now_ns.get()
    }
}

/// Converts ns to the kernel's form.
pub(crate) const fn timespec(ns: u64) -> libc::timespec {
    libc::timespec {
        tv_sec: (ns / 1_000_000_000) as i64,
        tv_nsec: (ns % 1_000_000_000) as i64,
    }
}

/// Sleeps until the absolute instant `at_ns` of `CLOCK_MONOTONIC`; returns early on a signal.
pub fn sleep_until(at_ns: u64) {
    let at = timespec(at_ns);
    // SAFETY: `at` is a valid timespec; a null remainder is allowed for absolute sleeps.
    #[allow(unsafe_code)]
    unsafe {
        libc::clock_nanosleep(
            libc::CLOCK_MONOTONIC,
            libc::TIMER_ABSTIME,
            &raw const at,
            std::ptr::null_mut(),
        );
    }
}
