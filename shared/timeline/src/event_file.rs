//! The events of a running graph as a file of JSON lines, bounded: what is full becomes the part
//! before, and the part before that is dropped.

use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::entry::TimelineEntry;

/// Size at which a part is full, bytes: some four hours of a robot that decides each second. The
/// file lies in memory (a runtime folder), and there are two parts.
const PART_BYTES: u64 = 4 << 20;

/// Where the part before lies.
fn before(path: &Path) -> PathBuf {
    path.with_extension("before")
}

/// Writes events.
#[derive(Debug)]
pub struct EventWriter {
    path: PathBuf,
    file: File,
    bytes: u64,
    part_bytes: u64,
}

impl EventWriter {
    /// Goes on with the file at `path`, or begins it.
    ///
    /// # Errors
    /// The system's.
    pub fn append(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().create(true).append(true).open(path)?;
        Ok(Self {
            bytes: file.metadata()?.len(),
            path: path.to_owned(),
            file,
            part_bytes: PART_BYTES,
        })
    }

    /// Writes an event.
    ///
    /// # Errors
    /// The system's.
    pub fn write(&mut self, entry: &TimelineEntry) -> io::Result<()> {
        let line = serde_json::to_string(entry)? + "\n";
        if self.bytes > 0 && self.bytes + line.len() as u64 > self.part_bytes {
            std::fs::rename(&self.path, before(&self.path))?;
            *self = Self {
                part_bytes: self.part_bytes,
                ..Self::append(&self.path)?
            };
        }
        self.file.write_all(line.as_bytes())?;
        self.bytes += line.len() as u64;
        Ok(())
    }

    /// Removes the file at `path`.
    pub fn remove(path: &Path) {
        for part in [path.to_owned(), before(path)] {
            let _ = std::fs::remove_file(part);
        }
    }
}

/// Reads events while they are written.
#[derive(Debug)]
pub struct EventReader {
    path: PathBuf,
    part: Option<BufReader<File>>,
    /// A line of which the end is not written yet.
    begun: String,
    /// True if this part is finished, and the end is met again.
    turns_over: bool,
}

impl EventReader {
    /// Begins with the oldest event that is kept.
    #[must_use]
    pub fn open(path: &Path) -> Self {
        let open = |path: &Path| File::open(path).ok().map(BufReader::new);
        Self {
            part: open(&before(path)).or_else(|| open(path)),
            path: path.to_owned(),
            begun: String::new(),
            turns_over: false,
        }
    }

    /// The next event; `None` while there is none. What is no event is passed over.
    ///
    /// # Errors
    /// The system's.
    pub fn next_entry(&mut self) -> io::Result<Option<TimelineEntry>> {
        loop {
            if self.part.is_none() {
                // The launcher begins it with the graph.
                self.part = File::open(&self.path).ok().map(BufReader::new);
            }
            let Some(part) = &mut self.part else {
                return Ok(None);
            };
            part.read_line(&mut self.begun)?;
            if self.begun.ends_with('\n') {
                let entry = serde_json::from_str(&self.begun);
                self.begun.clear();
                match entry {
                    Ok(entry) => return Ok(Some(entry)),
                    Err(_) => continue,
                }
            }
            if !self.turn_over()? {
                return Ok(None);
            }
        }
    }

    /// Goes on with the part that follows; false while this is the newest.
    fn turn_over(&mut self) -> io::Result<bool> {
        let (Some(part), Ok(newest)) = (&self.part, File::open(&self.path)) else {
            return Ok(false);
        };
        if part.get_ref().metadata()?.ino() == newest.metadata()?.ino() {
            return Ok(false);
        }
        if self.turns_over {
            self.begun.clear();
            self.part = Some(BufReader::new(newest));
        }
        // Once more before that: the last line may have come since the end was met.
        self.turns_over = !self.turns_over;
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(t_ns: u64) -> TimelineEntry {
        TimelineEntry {
            t_ns,
            event: "alarm".to_owned(),
            what: "x".repeat(100),
            ..TimelineEntry::default()
        }
    }

    /// The instants of the events that can be read now.
    fn read(reader: &mut EventReader) -> Vec<u64> {
        let next = || reader.next_entry().unwrap();
        std::iter::from_fn(next).map(|entry| entry.t_ns).collect()
    }

    #[test]
    fn a_reader_follows_over_the_parts_and_a_late_one_begins_with_the_part_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events");
        let mut writer = EventWriter::append(&path).unwrap();
        // Each part holds two.
        writer.part_bytes = 2 * serde_json::to_string(&entry(1)).unwrap().len() as u64 + 5;
        let mut reader = EventReader::open(&path);
        for t_ns in 1..=7 {
            writer.write(&entry(t_ns)).unwrap();
            assert_eq!(read(&mut reader), [t_ns]);
        }
        assert_eq!(read(&mut EventReader::open(&path)), [5, 6, 7]);
        let mut again = EventWriter::append(&path).unwrap();
        again.write(&entry(8)).unwrap();
        assert_eq!(read(&mut reader), [8]);
        EventWriter::remove(&path);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let mut early = EventReader::open(&path);
        assert_eq!(read(&mut early), [0; 0]);
        let mut writer = EventWriter::append(&path).unwrap();
        writer.write(&entry(9)).unwrap();
        assert_eq!(read(&mut early), [9]);
    }

    #[test]
    fn a_line_that_is_begun_waits_for_its_end_and_what_is_no_event_is_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events");
        let line = serde_json::to_string(&entry(3)).unwrap() + "\n";
        let (head, tail) = line.split_at(20);
        let mut file = File::create(&path).unwrap();
        let mut reader = EventReader::open(&path);
        file.write_all(format!("nonsense\n{head}").as_bytes())
            .unwrap();
        assert_eq!(read(&mut reader), [0; 0]);
        file.write_all(tail.as_bytes()).unwrap();
        assert_eq!(read(&mut reader), [3]);
    }
}
