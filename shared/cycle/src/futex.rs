//! The least that handing a block to another process costs: bytes in shared memory and a futex.
//!
//! For measuring only: no discovery, no queue, no second reader, no protection. What the transport
//! needs beyond this is what it gives for it.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

use crate::clock::timespec;

/// Bytes before the payload: the futex and two times, on cache lines of their own.
const HEAD: usize = 128;

/// One block of `size` bytes that one process writes and another waits for.
#[derive(Debug)]
pub struct FutexBlock {
    base: *mut u8,
    size: usize,
}

/// The shared words at the start of the mapping.
#[repr(C)]
#[derive(Debug)]
struct Words {
    count: AtomicU32,
    padding: u32,
    t_schedule_ns: AtomicU64,
    t_publish_ns: AtomicU64,
}

impl FutexBlock {
    /// Maps the block of `size` bytes behind `path`, which the first of its users makes.
    ///
    /// # Errors
    /// The system's.
    pub fn open(path: &Path, size: usize) -> io::Result<Self> {
        let file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .mode(0o600)
            .open(path)?;
        file.set_len((HEAD + size) as u64)?;
        Self::map(&file, size)
    }

    fn map(file: &File, size: usize) -> io::Result<Self> {
        // SAFETY: a new shared mapping of HEAD + size bytes of an open file of that length, every
        // page made present; MAP_FAILED is checked. Nobody shortens the file while it is mapped.
        #[allow(unsafe_code)]
        unsafe {
            let base = libc::mmap(
                std::ptr::null_mut(),
                HEAD + size,
                libc::PROT_READ | libc::PROT_WRITE,
                libc::MAP_SHARED | libc::MAP_POPULATE,
                file.as_raw_fd(),
                0,
            );
            if base == libc::MAP_FAILED {
                return Err(io::Error::last_os_error());
            }
            Ok(Self {
                base: base.cast(),
                size,
            })
        }
    }

    const fn words(&self) -> &Words {
        // SAFETY: the mapping is page-aligned, larger than `Words`, lives as long as self, and is
        // only accessed through these atomics.
        #[allow(unsafe_code)]
        unsafe {
            &*self.base.cast::<Words>()
        }
    }

    /// Blocks published so far.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.words().count.load(Ordering::Acquire)
    }

    /// Scheduled and publication instant of the newest block, ns.
    #[must_use]
    pub fn times_ns(&self) -> (u64, u64) {
        let words = self.words();
        let schedule_ns = words.t_schedule_ns.load(Ordering::Relaxed);
        (schedule_ns, words.t_publish_ns.load(Ordering::Relaxed))
    }

    /// Fills the payload with one byte, in place.
    pub fn fill(&mut self, byte: u8) {
        // SAFETY: the payload's bytes are mapped and writable for as long as self lives; they are
        // plain bytes that the reader only looks at between two publications.
        #[allow(unsafe_code)]
        unsafe {
            self.base.add(HEAD).write_bytes(byte, self.size);
        }
    }

    /// Sum over one byte of each cache line of the payload: what reading it in place costs.
    #[must_use]
    pub fn checksum(&self) -> u64 {
        let mut sum = 0;
        for at in (0..self.size).step_by(64) {
            // SAFETY: as in `fill`; volatile, as another process writes there.
            #[allow(unsafe_code)]
            let byte = unsafe { self.base.add(HEAD + at).read_volatile() };
            sum += u64::from(byte);
        }
        sum
    }

    /// Publishes the payload as it is, due at `t_schedule_ns`, stamped `t_publish_ns`; wakes the
    /// reader.
    pub fn publish(&self, t_schedule_ns: u64, t_publish_ns: u64) {
        let words = self.words();
        words.t_schedule_ns.store(t_schedule_ns, Ordering::Relaxed);
        words.t_publish_ns.store(t_publish_ns, Ordering::Relaxed);
        words.count.fetch_add(1, Ordering::Release);
        // SAFETY: the word is aligned and mapped; waking touches no memory.
        #[allow(unsafe_code)]
        unsafe {
            libc::syscall(
                libc::SYS_futex,
                words.count.as_ptr(),
                libc::FUTEX_WAKE,
                i32::MAX,
            );
        }
    }

    /// Waits until more than `seen` blocks are published, at most for `limit`; the count then.
    #[must_use]
    pub fn wait(&self, seen: u32, limit: Duration) -> u32 {
        let words = self.words();
        let count = self.count();
        if count != seen {
            return count;
        }
        let limit = timespec(u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX));
        // SAFETY: the word is aligned and mapped, the limit outlives the call.
        #[allow(unsafe_code)]
        unsafe {
            libc::syscall(
                libc::SYS_futex,
                words.count.as_ptr(),
                libc::FUTEX_WAIT,
                seen,
                &raw const limit,
            );
        }
        self.count()
    }
}

impl Drop for FutexBlock {
    fn drop(&mut self) {
        // SAFETY: the very mapping that `map` made; nothing borrows from it any more.
        #[allow(unsafe_code)]
        unsafe {
            libc::munmap(self.base.cast(), HEAD + self.size);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_block_reaches_the_other_side_and_silence_ends_the_wait() {
        let path = std::env::temp_dir().join(format!("futex-{}", std::process::id()));
        let mut writer = FutexBlock::open(&path, 1000).unwrap();
        let reader = FutexBlock::open(&path, 1000).unwrap();
        assert_eq!(reader.wait(0, Duration::from_millis(1)), 0);
        writer.fill(3);
        writer.publish(7, 9);
        assert_eq!(reader.wait(0, Duration::from_secs(60)), 1);
        assert_eq!((reader.times_ns(), reader.checksum()), ((7, 9), 3 * 16));
        std::fs::remove_file(&path).unwrap();
    }
}
