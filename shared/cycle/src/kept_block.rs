//! A block in a file mapping: what a process wrote last, whatever ended it.

use std::fs::{File, OpenOptions};
use std::io;
use std::marker::PhantomData;
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr::NonNull;

use vigil_blocks::{Block, fnv1a};

/// Words before each copy: its number and the hash of its bytes.
const WORDS: usize = 2;

/// Two copies of a block in a file, of which one is always whole. Writing makes no system call and
/// allocates nothing; what was written outlives a process that is killed.
pub struct KeptBlock<T: Block> {
    copies: NonNull<u64>,
    number: u64,
    kind: PhantomData<T>,
}

impl<T: Block> KeptBlock<T> {
    /// 64-bit words of one copy.
    const COPY: usize = WORDS + size_of::<T>() / 8;
    const BYTES: usize = 2 * 8 * Self::COPY;

    /// Opens the file, or makes it; a file of another size is made anew.
    ///
    /// # Errors
    /// The file system's.
    pub fn open(path: &Path) -> io::Result<Self> {
        const { assert!(size_of::<T>().is_multiple_of(8) && align_of::<T>() <= 8) };
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(path)?;
        if file.metadata()?.len() != Self::BYTES as u64 {
            file.set_len(0)?;
        }
        reserve(&file, Self::BYTES as u64)?;
        // SAFETY: a new shared mapping of a file that is as long as the mapping; the kernel chooses
        // its place, and the result is checked.
        #[allow(unsafe_code)]
        let mapped = unsafe {
            libc::mmap(
                std::ptr::null_mut(),
                Self::BYTES,
                libc::PROT_READ | libc::PROT_WRITE,
                libc::MAP_SHARED | libc::MAP_POPULATE,
                file.as_raw_fd(),
                0,
            )
        };
        if mapped == libc::MAP_FAILED {
            return Err(io::Error::last_os_error());
        }
        let copies = NonNull::new(mapped.cast::<u64>()).ok_or_else(io::Error::last_os_error)?;
        let mut kept = Self {
            copies,
            number: 0,
            kind: PhantomData,
        };
        kept.number = kept.newest().map_or(0, |(number, _)| number);
        Ok(kept)
    }

    /// The block that was written last; `None` if none was, or nothing whole is left.
    #[must_use]
    pub fn read(&self) -> Option<Box<T>> {
        self.newest().map(|(_, block)| block)
    }

    /// The same of a file that another process keeps, perhaps just now; nothing is made or changed.
    #[must_use]
    pub fn read_file(path: &Path) -> Option<Box<T>> {
        let bytes = std::fs::read(path).ok()?;
        let words: Vec<u64> = bytes
            .chunks_exact(8)
            .map(|word| u64::from_ne_bytes(word.try_into().unwrap_or_default()))
            .collect();
        let copies = words.chunks_exact(Self::COPY).take(2);
        let newest = copies.filter_map(whole).max_by_key(|(number, _)| *number);
        newest.map(|(_, block)| block)
    }

    /// Writes a block over the older copy.
    pub fn write(&mut self, block: &T) {
        self.number += 1;
        let (number, bytes) = (self.number, bytemuck::bytes_of(block));
        let words = self.copy_mut((number % 2) as usize);
        words[0] = number;
        bytemuck::cast_slice_mut::<u64, u8>(&mut words[WORDS..]).copy_from_slice(bytes);
        words[1] = hash(number, bytes);
    }

    fn newest(&self) -> Option<(u64, Box<T>)> {
        let whole = (0..2).filter_map(|at| whole(self.copy(at)));
        whole.max_by_key(|(number, _)| *number)
    }

    fn copy(&self, at: usize) -> &[u64] {
        // SAFETY: the mapping holds two copies of COPY words and lives as long as self. Nobody else
        // writes it: a service keeps a block only once it holds its topics, of which each has one
        // writer.
        #[allow(unsafe_code)]
        unsafe {
            std::slice::from_raw_parts(self.copies.as_ptr().add(at % 2 * Self::COPY), Self::COPY)
        }
    }

    fn copy_mut(&mut self, at: usize) -> &mut [u64] {
        // SAFETY: as in `copy`; self is borrowed for writing.
        #[allow(unsafe_code)]
        unsafe {
            let first = self.copies.as_ptr().add(at % 2 * Self::COPY);
            std::slice::from_raw_parts_mut(first, Self::COPY)
        }
    }
}

impl<T: Block> Drop for KeptBlock<T> {
    fn drop(&mut self) {
        // SAFETY: the mapping is this one's own, and nothing borrows from it any more.
        #[allow(unsafe_code)]
        unsafe {
            libc::munmap(self.copies.as_ptr().cast(), Self::BYTES);
        }
    }
}

/// The block of a copy with its number, if it is whole.
fn whole<T: Block>(words: &[u64]) -> Option<(u64, Box<T>)> {
    let bytes = bytemuck::cast_slice::<u64, u8>(&words[WORDS..]);
    let number = words[0];
    let is_whole = number != 0 && words[1] == hash(number, bytes);
    is_whole.then(|| (number, Box::new(bytemuck::pod_read_unaligned(bytes))))
}

/// Gives a file so many bytes that are there: a store to a mapping of bytes that a full disk has no
/// room for would end the process.
pub fn reserve(file: &File, bytes: u64) -> io::Result<()> {
    // SAFETY: a plain system call on a descriptor that is open.
    #[allow(unsafe_code)]
    let error = unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, bytes.cast_signed()) };
    match error {
        0 => Ok(()),
        error => Err(io::Error::from_raw_os_error(error)),
    }
}

/// Of a copy's number and bytes: one that is half written has another.
fn hash(number: u64, bytes: &[u8]) -> u64 {
    fnv1a::hash(fnv1a::hash_u64(fnv1a::BASIS, number), bytes)
}

#[cfg(test)]
mod tests {
    use vigil_blocks::Control;

    use super::*;

    fn block(fault: u32) -> Control {
        Control {
            fault,
            ..Control::default()
        }
    }

    fn read(path: &Path) -> Option<u32> {
        let beside = KeptBlock::<Control>::read_file(path).map(|block| block.fault);
        let kept = KeptBlock::<Control>::open(path).unwrap();
        let read = kept.read().map(|block| block.fault);
        assert_eq!(read, beside);
        read
    }

    #[test]
    fn what_was_written_last_is_read_by_the_next() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept");
        assert_eq!(read(&path), None);
        for fault in 1..=5 {
            // Each writer is another process's, as it were.
            let mut kept = KeptBlock::<Control>::open(&path).unwrap();
            kept.write(&block(fault));
            assert_eq!(read(&path), Some(fault));
        }
    }

    #[test]
    fn a_copy_that_was_not_finished_gives_way_to_the_one_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept");
        let mut kept = KeptBlock::<Control>::open(&path).unwrap();
        (1..=2).for_each(|fault| kept.write(&block(fault)));
        drop(kept);
        let whole = std::fs::read(&path).unwrap();
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x10;
            std::fs::write(&path, &bytes).unwrap();
            let found = read(&path);
            // The second block lies in the first copy.
            let expected = if at < whole.len() / 2 { 1 } else { 2 };
            assert_eq!(found, Some(expected), "byte {at}");
        }
    }

    #[test]
    fn a_file_of_another_size_is_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept");
        std::fs::write(&path, [7; 1000]).unwrap();
        assert_eq!(read(&path), None);
    }
}
