//! Orderly stop on SIGINT, SIGTERM, SIGHUP and SIGQUIT, and a request to others.

use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

extern "C" fn on_signal(_: libc::c_int) {
    STOP.store(true, Ordering::Relaxed);
}

/// From now on these signals only set the flag that [`stop_requested`] reads. Blocking calls
/// return early (no `SA_RESTART`).
pub fn install() {
    for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP, libc::SIGQUIT] {
        // SAFETY: the handler is async-signal-safe (one atomic store); the zeroed sigaction has an
        // empty mask and no flags.
        #[allow(unsafe_code)]
        unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = on_signal as *const () as libc::sighandler_t;
            libc::sigaction(signal, &raw const action, std::ptr::null_mut());
        }
    }
}

/// True once a stop was asked for.
#[must_use]
pub fn stop_requested() -> bool {
    STOP.load(Ordering::Relaxed)
}

/// Asks a process to stop (SIGTERM).
pub fn terminate(pid: u32) {
    send(pid, libc::SIGTERM);
}

/// Ends a process (SIGKILL).
pub fn kill(pid: u32) {
    send(pid, libc::SIGKILL);
}

fn send(pid: u32, signal: libc::c_int) {
    // SAFETY: a plain system call; the caller names a process that it has not reaped yet, or has
    // just seen alive under its own name.
    #[allow(unsafe_code)]
    unsafe {
        libc::kill(pid.cast_signed(), signal);
    }
}
