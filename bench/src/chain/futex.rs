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

/// Bytes before the payload: the futex and two times, on cache lines of their own.
const HEAD: usize = 128;

/// One block of `size` bytes that one process writes and another waits for.
#[derive(Debug)]
pub struct FutexBlock {
    base: *mut u8,
    size: usize,
}

/// The shared words at the start of the mapping. Block `n` has its times in slot `n` modulo 2: as
/// long as the count says `n`, nobody writes there.
#[repr(C)]
#[derive(Debug)]
struct Words {
    count: AtomicU32,
    padding: u32,
    times: [Times; 2],
}

#[repr(C)]
#[derive(Debug)]
struct Times {
    schedule_ns: AtomicU64,
    publish_ns: AtomicU64,
}

impl FutexBlock {
    /// Maps the block of `size` bytes behind `path`, which the first of its users makes.
    ///
    /// # Errors
    /// The system's; [`io::ErrorKind::InvalidData`] if the block there has another size.
    pub fn open(path: &Path, size: usize) -> io::Result<Self> {
        let file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .mode(0o600)
            .open(path)?;
        let (there, wanted) = (file.metadata()?.len(), (HEAD + size) as u64);
        if there == 0 {
            // Both sides may find it empty; both make it the same.
            file.set_len(wanted)?;
        } else if there != wanted {
            let what = format!("{} has {there} bytes, not {wanted}", path.display());
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
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

    /// Number of the newest block, its scheduled and its publication instant, ns.
    #[must_use]
    pub fn newest(&self) -> (u32, u64, u64) {
        loop {
            let count = self.count();
            let times = self.times(count);
            let schedule_ns = times.schedule_ns.load(Ordering::Acquire);
            let publish_ns = times.publish_ns.load(Ordering::Acquire);
            if self.count() == count {
                return (count, schedule_ns, publish_ns);
            }
        }
    }

    const fn times(&self, count: u32) -> &Times {
        &self.words().times[(count % 2) as usize]
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
        let times = self.times(words.count.load(Ordering::Relaxed).wrapping_add(1));
        times.schedule_ns.store(t_schedule_ns, Ordering::Release);
        times.publish_ns.store(t_publish_ns, Ordering::Release);
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

    /// Waits for a block other than the one numbered `last_read`, at most for `limit`.
    pub fn wait(&self, last_read: u32, limit: Duration) {
        let words = self.words();
        if self.count() != last_read {
            return;
        }
        let limit = libc::timespec {
            tv_sec: i64::try_from(limit.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: i64::from(limit.subsec_nanos()),
        };
        // SAFETY: the word is aligned and mapped, the limit outlives the call.
        #[allow(unsafe_code)]
        unsafe {
            libc::syscall(
                libc::SYS_futex,
                words.count.as_ptr(),
                libc::FUTEX_WAIT,
                last_read,
                &raw const limit,
            );
        }
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
mod tests {
    use super::*;

    #[test]
    fn a_block_reaches_the_other_side_and_silence_ends_the_wait() {
        let path = std::env::temp_dir().join(format!("futex-{}", std::process::id()));
        let mut writer = FutexBlock::open(&path, 1000).unwrap();
        let reader = FutexBlock::open(&path, 1000).unwrap();
        reader.wait(0, Duration::from_millis(1));
        assert_eq!(reader.newest(), (0, 0, 0));
        writer.fill(3);
        writer.publish(7, 9);
        reader.wait(0, Duration::from_secs(60));
        assert_eq!((reader.newest(), reader.checksum()), ((1, 7, 9), 3 * 16));
        writer.publish(17, 19);
        assert_eq!(reader.newest(), (2, 17, 19));
        let other = FutexBlock::open(&path, 999).unwrap_err();
        assert_eq!(other.kind(), io::ErrorKind::InvalidData);
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn times_belong_to_one_block_while_the_writer_goes_on() {
        const BLOCKS: u64 = 200_000;
        let path = std::env::temp_dir().join(format!("futex-race-{}", std::process::id()));
        let reader = FutexBlock::open(&path, 64).unwrap();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let writer = FutexBlock::open(&path, 64).unwrap();
                (1..=BLOCKS).for_each(|n| writer.publish(n, 3 * n));
            });
            let mut count = 0;
            while u64::from(count) < BLOCKS {
                let (newest, schedule_ns, publish_ns) = reader.newest();
                assert_eq!(schedule_ns, u64::from(newest));
                assert_eq!(publish_ns, 3 * schedule_ns);
                count = newest;
            }
        });
        std::fs::remove_file(&path).unwrap();
    }
}
