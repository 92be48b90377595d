//! Cores that never halt.
//!
//! Waking a core that has gone to sleep takes long, on a virtual machine some 250 us. A thread of
//! the lowest class that spins on it keeps it awake and gives way to everything else at once; it
//! costs the power that a busy core takes.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread::JoinHandle;

use crate::placement;

/// Keeps cores awake until dropped.
#[derive(Debug)]
pub struct KeepAwake {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl KeepAwake {
    /// Starts one spinning thread on each of `cores`; each counts once.
    ///
    /// # Errors
    /// The system's, when a thread cannot be made or placed; none spins then, as anything but the
    /// lowest class would do harm.
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
            let (placed, told) = channel();
            let thread = builder.spawn(move || {
                let result = enter_lowest_class(core);
                let is_placed = result.is_ok();
                let _ = placed.send(result);
                while is_placed && !stop.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            })?;
            awake.threads.push(thread);
            told.recv().map_err(io::Error::other)??;
        }
        Ok(awake)
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
mod tests {
    use super::*;

    #[test]
    fn every_core_is_kept_awake_once_and_released() {
        let awake = KeepAwake::start([0, 0]).unwrap();
        assert_eq!(awake.threads.len(), 1);
        assert!(!awake.threads[0].is_finished());
        drop(awake);
        // A core that is not there is an error, and the thread on the other one ends.
        assert!(KeepAwake::start([0, 100_000]).is_err());
    }
}
