//! The last seconds as a file of fixed size: written by one thread, read by another meanwhile, and
//! by whoever comes after the process was killed.
//!
//! A record is a head of 16 bytes and its content, filled up to eight. Records lie one behind
//! the other; none goes over the end of the file, where a filler stands instead. The file begins
//! with a page that holds two offsets, counted without end: of the oldest record, and behind the
//! newest. The first moves before what it passes is overwritten, the second after what it passes is
//! written. Writes go through the page cache, which outlives the process.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes before the records.
const PAGE: u64 = 4096;
/// Says what the file is, and which form it has.
const MAGIC: u64 = u64::from_le_bytes(*b"vigilbb2");
/// Bytes of a record's head: its length, its code, nothing, and when it came.
const HEAD: usize = 16;
/// Code of a filler.
const FILLER: u16 = u16::MAX;
/// Room that is made at once, so that the first offset need not be written for each record.
const STEP: u64 = 256 << 10;
/// Largest content of a record, bytes; a file whose heads say more is broken.
const CONTENT_MAX: u32 = 1 << 20;

/// Offsets of a ring that its reader shares with its writer.
#[derive(Debug, Default)]
struct Offsets {
    oldest: AtomicU64,
    newest: AtomicU64,
}

/// Writes the ring.
#[derive(Debug)]
pub struct RingWriter {
    file: Arc<File>,
    capacity: u64,
    offsets: Arc<Offsets>,
    /// Behind the last record, which may not be committed yet.
    end: u64,
    buffer: Vec<u8>,
    /// Where the buffer belongs.
    begin: u64,
}

/// Reads a ring from its oldest record on.
#[derive(Debug)]
pub struct RingReader {
    file: Arc<File>,
    capacity: u64,
    offsets: Arc<Offsets>,
    next: u64,
    /// Times at which the writer was faster.
    overtaken: u64,
}

/// What a record holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Record {
    /// What its content is.
    pub code: u16,
    /// When it came, `CLOCK_MONOTONIC` ns.
    pub t_ns: u64,
    /// The content.
    pub bytes: Vec<u8>,
}

const fn padded(length: usize) -> u64 {
    (HEAD + length).next_multiple_of(8) as u64
}

fn word(file: &File, at: u64) -> io::Result<u64> {
    let mut bytes = [0; 8];
    file.read_exact_at(&mut bytes, at)?;
    Ok(u64::from_le_bytes(bytes))
}

impl RingWriter {
    /// Begins a ring of `bytes` at `path`; what lies there is gone.
    ///
    /// # Errors
    /// The system's: also that there is no room for all of it.
    pub fn create(path: &Path, bytes: u64) -> io::Result<Self> {
        let _ = std::fs::remove_file(path);
        let mut options = OpenOptions::new();
        let options = options.read(true).write(true).create_new(true).mode(0o600);
        let file = options.open(path)?;
        let capacity = (bytes / PAGE).max(2) * PAGE;
        vigil_cycle::reserve(&file, PAGE + capacity)?;
        for (place, value) in [MAGIC, capacity, 0, 0].into_iter().enumerate() {
            file.write_all_at(&value.to_le_bytes(), 8 * place as u64)?;
        }
        Ok(Self {
            file: Arc::new(file),
            capacity,
            offsets: Arc::default(),
            end: 0,
            buffer: Vec::new(),
            begin: 0,
        })
    }

    /// Adds a record, to be read after [`Self::commit`].
    ///
    /// # Errors
    /// The system's. A record that does not fit is refused.
    pub fn push(&mut self, code: u16, t_ns: u64, content: &[u8]) -> io::Result<()> {
        let length = u32::try_from(content.len()).unwrap_or(u32::MAX);
        let size = padded(content.len());
        if length > CONTENT_MAX || 4 * size > self.capacity || code == FILLER {
            return Err(io::Error::other(format!("a record of {length} bytes")));
        }
        let rest = self.capacity - self.end % self.capacity;
        if rest < size {
            self.room(rest)?;
            // What is too short for a head is passed over without one.
            if rest >= HEAD as u64 {
                let content = u32::try_from(rest as usize - HEAD).unwrap_or(0);
                self.head(content, FILLER, 0);
            }
            self.flush(rest)?;
        }
        self.room(size)?;
        self.head(length, code, t_ns);
        self.buffer.extend_from_slice(content);
        self.buffer.resize(self.buffer.len().next_multiple_of(8), 0);
        self.end += size;
        // What is written at once never goes over the file's end.
        if self.buffer.len() as u64 > STEP || self.end.is_multiple_of(self.capacity) {
            self.flush(0)?;
        }
        Ok(())
    }

    fn head(&mut self, length: u32, code: u16, t_ns: u64) {
        self.buffer.extend_from_slice(&length.to_le_bytes());
        self.buffer.extend_from_slice(&code.to_le_bytes());
        self.buffer.extend_from_slice(&[0; 2]);
        self.buffer.extend_from_slice(&t_ns.to_le_bytes());
    }

    /// Writes what is buffered, and passes over `rest` bytes behind it up to the file's end.
    fn flush(&mut self, rest: u64) -> io::Result<()> {
        let at = PAGE + self.begin % self.capacity;
        self.file.write_all_at(&self.buffer, at)?;
        self.buffer.clear();
        self.end += rest;
        self.begin = self.end;
        Ok(())
    }

    /// Gives up the oldest records until `size` bytes are free behind the end.
    fn room(&mut self, size: u64) -> io::Result<()> {
        let mut oldest = self.offsets.oldest.load(Ordering::Relaxed);
        if self.end + size - oldest <= self.capacity {
            return Ok(());
        }
        // No record is larger than a quarter of the ring.
        let wanted = (self.end + size + STEP.min(self.capacity / 4)).saturating_sub(self.capacity);
        if wanted > self.offsets.newest.load(Ordering::Relaxed) {
            self.commit()?;
        }
        while oldest < wanted {
            let rest = self.capacity - oldest % self.capacity;
            if rest < HEAD as u64 {
                oldest += rest;
                continue;
            }
            let mut length = [0; 4];
            let at = PAGE + oldest % self.capacity;
            self.file.read_exact_at(&mut length, at)?;
            oldest += padded(u32::from_le_bytes(length) as usize);
        }
        let oldest = oldest.min(self.end);
        self.offsets.oldest.store(oldest, Ordering::Release);
        self.file.write_all_at(&oldest.to_le_bytes(), 16)
    }

    /// Makes what was added readable, whatever ends this process from now on.
    ///
    /// # Errors
    /// The system's.
    pub fn commit(&mut self) -> io::Result<()> {
        self.flush(0)?;
        self.file.write_all_at(&self.end.to_le_bytes(), 24)?;
        self.offsets.newest.store(self.end, Ordering::Release);
        Ok(())
    }

    /// A reader that begins with the oldest record.
    pub fn reader(&self) -> RingReader {
        RingReader {
            file: Arc::clone(&self.file),
            capacity: self.capacity,
            offsets: Arc::clone(&self.offsets),
            next: self.offsets.oldest.load(Ordering::Acquire),
            overtaken: 0,
        }
    }
}

impl RingReader {
    /// The ring that a process has left at `path`.
    ///
    /// # Errors
    /// The system's; a file that is no ring.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        let words = [0, 8, 16, 24].map(|at| word(&file, at));
        let [magic, capacity, oldest, newest] = words;
        let (magic, capacity, oldest, newest) = (magic?, capacity?, oldest?, newest?);
        let length = file.metadata()?.len();
        let is_sound = magic == MAGIC
            && capacity > 0
            && PAGE.checked_add(capacity) == Some(length)
            && newest
                .checked_sub(oldest)
                .is_some_and(|held| held <= capacity);
        if !is_sound {
            return Err(io::Error::other(format!("{} is no ring", path.display())));
        }
        Ok(Self {
            file: Arc::new(file),
            capacity,
            offsets: Arc::new(Offsets {
                oldest: AtomicU64::new(oldest),
                newest: AtomicU64::new(newest),
            }),
            next: oldest,
            overtaken: 0,
        })
    }

    /// The next record; `None` while there is none.
    ///
    /// # Errors
    /// The system's; a broken file.
    pub fn next_record(&mut self) -> io::Result<Option<Record>> {
        loop {
            let oldest = self.offsets.oldest.load(Ordering::Acquire);
            if self.next < oldest {
                self.next = oldest;
                self.overtaken += 1;
            }
            if self.next >= self.offsets.newest.load(Ordering::Acquire) {
                return Ok(None);
            }
            let place = self.next % self.capacity;
            let rest = self.capacity - place;
            if rest < HEAD as u64 {
                self.next += rest;
                continue;
            }
            let at = PAGE + place;
            let mut head = [0; HEAD];
            self.file.read_exact_at(&mut head, at)?;
            let [a, b, c, d, e, f, _, _, t @ ..] = head;
            let (length, code) = (u32::from_le_bytes([a, b, c, d]), u16::from_le_bytes([e, f]));
            let size = padded(length as usize);
            let is_sound = size <= rest && (code == FILLER || length <= CONTENT_MAX);
            let mut bytes = Vec::new();
            if is_sound && code != FILLER {
                bytes.resize(length as usize, 0);
                self.file.read_exact_at(&mut bytes, at + HEAD as u64)?;
            }
            if self.next < self.offsets.oldest.load(Ordering::Acquire) {
                // It was overwritten while it was read.
                continue;
            }
            if !is_sound {
                return Err(io::Error::other("a broken record"));
            }
            self.next += size;
            if code != FILLER {
                let t_ns = u64::from_le_bytes(t);
                return Ok(Some(Record { code, t_ns, bytes }));
            }
        }
    }

    /// True if nothing was committed so far.
    pub fn is_empty(&self) -> bool {
        self.offsets.newest.load(Ordering::Acquire) == 0
    }

    /// Times at which the writer was faster, and records were lost.
    pub const fn overtaken(&self) -> u64 {
        self.overtaken
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(reader: &mut RingReader) -> Vec<Record> {
        std::iter::from_fn(|| reader.next_record().unwrap()).collect()
    }

    /// A record of this number: its length follows from it.
    fn record(number: u64, length: usize) -> Record {
        let mut bytes = number.to_le_bytes().to_vec();
        bytes.resize(8 + length, number as u8);
        Record {
            code: number as u16 % 7,
            t_ns: 1000 + number,
            bytes,
        }
    }

    proptest! {
        #[test]
        fn what_is_kept_are_the_newest_records_whole_and_in_order(
            lengths in prop::collection::vec(0_usize..3000, 1..400),
            commits in prop::collection::vec(any::<bool>(), 400),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("ring");
            let mut ring = RingWriter::create(&path, 16 << 10).unwrap();
            let (mut follower, mut followed) = (ring.reader(), Vec::new());
            let mut committed = 0;
            let number_in = |r: &Record| u64::from_le_bytes(r.bytes[..8].try_into().unwrap());
            for (number, length) in lengths.iter().enumerate() {
                let added = record(number as u64, *length);
                ring.push(added.code, added.t_ns, &added.bytes).unwrap();
                if commits[number] {
                    ring.commit().unwrap();
                    committed = number + 1;
                    followed.extend(read(&mut follower));
                }
            }
            followed.extend(read(&mut follower));
            // Whoever comes after finds the newest, to the last that was committed.
            let left = read(&mut RingReader::open(&path).unwrap());
            let from = left.first().map_or(committed as u64, number_in);
            for (number, kept) in (from..).zip(&left) {
                prop_assert_eq!(kept, &record(number, lengths[number as usize]));
            }
            prop_assert!(from + left.len() as u64 >= committed as u64);
            // All of it, unless the ring was too small.
            let bytes: usize = lengths.iter().map(|length| length + 32).sum();
            prop_assert!(from == 0 || bytes > 8 << 10);
            // Who follows misses nothing but what was overwritten.
            let numbers: Vec<u64> = followed.iter().map(number_in).collect();
            prop_assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]));
            let missed = from + left.len() as u64 - followed.len() as u64;
            prop_assert!(missed == 0 || follower.overtaken() > 0);
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_and_what_is_no_ring_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ring");
        let mut ring = RingWriter::create(&path, 8 << 10).unwrap();
        assert!(ring.push(1, 0, &[0; 2048]).is_err());
        assert!(ring.push(FILLER, 0, &[]).is_err());
        ring.push(1, 0, &[5; 100]).unwrap();
        ring.commit().unwrap();
        assert_eq!(read(&mut ring.reader()).len(), 1);
        for text in [&b""[..], b"vigil", &[7; 9000]] {
            std::fs::write(&path, text).unwrap();
            assert!(RingReader::open(&path).is_err());
        }
        assert!(RingWriter::create(Path::new("/nonexistent/ring"), 1).is_err());
    }
}
