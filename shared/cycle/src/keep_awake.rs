//! Cores that never halt.
//!
//! Waking a core that has gone to sleep takes long, on a virtual machine some 250 us. A thread of
//! the lowest class that spins on it keeps it awake and gives way to everything else at once; it
//! costs the power that a busy core takes.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use crate::placement;

/// Keeps cores awake until dropped.
#[derive(Debug)]
pub struct KeepAwake {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<io::Result<()>>>,
}

impl KeepAwake {
    /// Starts one spinning thread on each of `cores`; each counts once.
    ///
    /// # Errors
    /// The system's, when a thread cannot be made. One that cannot be placed does not spin:
    /// anything but the lowest class would do harm.
    pub fn start(cores: impl IntoIterator<Item = usize>) -> io::Result<Self> {
        let mut cores: Vec<usize> = cores.into_iter().collect();
        cores.sort_unstable();
        cores.dedup();
        let mut awake = Self {
            stop: Arc::default(),
            threads: Vec::new(),
        };
        for core in cores {
            let stop = Arc::clone(&awake.stop);
            let builder = std::thread::Builder::new().name(format!("awake-{core}"));
            let thread = builder.spawn(move || {
                enter_lowest_class(core)?;
                while !stop.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
                Ok(())
            })?;
            awake.threads.push(thread);
        }
        Ok(awake)
    }

    /// Threads that spin.
    #[must_use]
    pub fn spinning(&self) -> usize {
        let spins = |thread: &&JoinHandle<io::Result<()>>| !thread.is_finished();
        self.threads.iter().filter(spins).count()
    }
}

impl Drop for KeepAwake {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// Pins the calling thread and gives it the class that runs only when nothing else does.
fn enter_lowest_class(core: usize) -> io::Result<()> {
    if !placement::pin(core) {
        return Err(io::Error::other(format!("core {core} is not permitted")));
    }
    let param = libc::sched_param { sched_priority: 0 };
    // SAFETY: a plain system call on the calling thread; `param` outlives it.
    #[allow(unsafe_code)]
    let result = unsafe { libc::sched_setscheduler(0, libc::SCHED_IDLE, &raw const param) };
    if result == 0 {
        Ok(())
    } else {
        Err(io::Error::last_os_error())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn every_core_is_kept_awake_once_and_released() {
        let awake = KeepAwake::start([0, 0]).unwrap();
        assert_eq!(awake.threads.len(), 1);
        assert_eq!(awake.spinning(), 1);
        drop(awake);
        let nowhere = KeepAwake::start([100_000]).unwrap();
        while nowhere.spinning() > 0 {
            std::thread::yield_now();
        }
    }
}
