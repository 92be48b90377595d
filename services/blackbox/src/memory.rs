//! What a black box keeps in the runtime folder: the last seconds, and what the graph runs on, so
//! that whoever finds it after a kill can write it.

use std::error::Error;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use vigil_cycle::Domain;
use vigil_setup::RunningGraph;
use vigil_timeline::{EventReader, EventWriter};

use crate::ring::{RingReader, RingWriter};
use crate::say::say;

const RING: &str = "ring";
const DOCUMENT: &str = "document";
const EVENTS: &str = "events";
const LOCK: &str = "memory-lock";

/// What a black box has kept that was killed.
pub struct Memory {
    /// The last seconds.
    pub ring: RingReader,
    /// When its first and its last block came, `CLOCK_MONOTONIC` ns.
    pub bounds_ns: [u64; 2],
    /// The graph that it is of.
    pub graph: RunningGraph,
    /// The events until then.
    pub events: PathBuf,
}

impl Memory {
    /// That in this folder.
    ///
    /// # Errors
    /// It is none, or of another version.
    pub fn read(folder: &Path, graph: &str) -> Result<Self, Box<dyn Error>> {
        let ring = folder.join(RING);
        let mut blocks = RingReader::open(&ring)?;
        // What is broken ends it.
        let mut times_ns = std::iter::from_fn(|| blocks.next_record().ok().flatten());
        let first_ns = times_ns.next().ok_or("it holds no block")?.t_ns;
        let last_ns = times_ns.last().map_or(first_ns, |block| block.t_ns);
        Ok(Self {
            bounds_ns: [first_ns, last_ns],
            ring: RingReader::open(&ring)?,
            graph: RunningGraph::read_document(graph, &folder.join(DOCUMENT))?,
            events: folder.join(EVENTS),
        })
    }
}

/// Begins to keep; what a process before this one has kept is gone.
///
/// # Errors
/// The system's: also that there is no room for all of it.
pub fn create(running: &RunningGraph) -> io::Result<RingWriter> {
    let (domain, bytes) = (&running.domain, running.setup.file.blackbox.memory_bytes());
    let folder = domain.memory_folder();
    remove(&folder);
    fs::create_dir(&folder)?;
    let document = running.document.to_text().map_err(io::Error::other)?;
    fs::write(folder.join(DOCUMENT), document)?;
    RingWriter::create(&folder.join(RING), bytes)
}

/// The right to what a graph's black boxes keep: one process has it, as long as it lives.
pub struct MemoryLock {
    _file: File,
}

/// Takes that right.
///
/// # Errors
/// Another process has it; the system's.
pub fn lock(domain: &Domain) -> io::Result<MemoryLock> {
    let mut options = OpenOptions::new();
    let options = options.create(true).truncate(false).write(true).mode(0o600);
    let file = options.open(domain.folder().join(LOCK))?;
    match file.try_lock() {
        Ok(()) => Ok(MemoryLock { _file: file }),
        Err(TryLockError::WouldBlock) => Err(io::Error::other("another of this graph lives")),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// Forgets it.
pub fn remove(folder: &Path) {
    let _ = fs::remove_dir_all(folder);
}

/// Puts aside what a process before this one has kept, with the events until then, until it is
/// written. If there is no place left, the oldest that is not yet written makes room for it.
///
/// # Errors
/// The system's.
pub fn set_aside(domain: &Domain) -> io::Result<()> {
    let folder = domain.memory_folder();
    let ring = RingReader::open(&folder.join(RING));
    if let Err(error) = &ring
        && error.kind() != io::ErrorKind::NotFound
    {
        say(&format!("what a black box kept is lost: {error}"));
    }
    if ring.is_ok_and(|ring| !ring.is_empty()) {
        // Blocks are worth more than words: without room for these it goes on.
        let _ = copy_events(&domain.events_file(), &folder.join(EVENTS));
        let mut free = domain.unwritten_folders().into_iter();
        let free = free.find(|place| !place.exists());
        if let Some(place) = free.or_else(|| unwritten(domain).into_iter().next()) {
            remove(&place);
            fs::rename(&folder, &place)?;
        }
    }
    remove(&folder);
    Ok(())
}

fn copy_events(from: &Path, to: &Path) -> io::Result<()> {
    EventWriter::remove(to);
    let (mut events, mut copy) = (EventReader::open(from), EventWriter::append(to)?);
    while let Some(entry) = events.next_entry()? {
        copy.write(&entry)?;
    }
    Ok(())
}

/// What was put aside and is not yet written, the oldest first.
pub fn unwritten(domain: &Domain) -> Vec<PathBuf> {
    let until = |folder: &Path| fs::metadata(folder.join(RING)).and_then(|ring| ring.modified());
    let folders = domain.unwritten_folders().into_iter();
    let mut folders: Vec<_> = folders.filter(|folder| folder.exists()).collect();
    folders.sort_by_key(|folder| until(folder).ok());
    folders
}

#[cfg(test)]
mod tests {
    use vigil_cycle::domain::Queues;

    use super::*;

    /// Keeps this number of records, as a black box does that is killed then.
    fn keep(domain: &Domain, records: u64) {
        let folder = domain.memory_folder();
        fs::create_dir(&folder).unwrap();
        let mut ring = RingWriter::create(&folder.join(RING), 16 << 10).unwrap();
        for number in 0..records {
            ring.push(1, number, &[7; 32]).unwrap();
        }
        ring.commit().unwrap();
    }

    fn records(folder: &Path) -> usize {
        let mut ring = RingReader::open(&folder.join(RING)).unwrap();
        std::iter::from_fn(|| ring.next_record().unwrap()).count()
    }

    #[test]
    fn one_process_has_the_right_to_a_memory() {
        let graph = format!("t{}-lock", std::process::id());
        let domain = Domain::new(&graph, Queues::default()).unwrap();
        let first = lock(&domain).unwrap();
        assert!(lock(&domain).is_err());
        drop(first);
        lock(&domain).unwrap();
        fs::remove_dir_all(domain.folder()).unwrap();
    }

    #[test]
    fn two_that_are_not_written_stay_and_the_oldest_makes_room() {
        let graph = format!("t{}-memory", std::process::id());
        let domain = Domain::new(&graph, Queues::default()).unwrap();
        for count in [1, 2, 3] {
            keep(&domain, count);
            set_aside(&domain).unwrap();
            assert!(!domain.memory_folder().exists());
            // Their age tells them apart.
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        let kept: Vec<usize> = unwritten(&domain).iter().map(|it| records(it)).collect();
        assert_eq!(kept, [2, 3]);
        // Neither an empty one nor what is none takes the place of another.
        keep(&domain, 0);
        set_aside(&domain).unwrap();
        fs::create_dir(domain.memory_folder()).unwrap();
        fs::write(domain.memory_folder().join(RING), "no ring").unwrap();
        set_aside(&domain).unwrap();
        let kept: Vec<usize> = unwritten(&domain).iter().map(|it| records(it)).collect();
        assert_eq!(kept, [2, 3]);
        assert!(!domain.memory_folder().exists());
        set_aside(&domain).unwrap();
        // Without what it ran on it cannot be written.
        assert!(Memory::read(&unwritten(&domain)[0], &graph).is_err());
        fs::remove_dir_all(domain.folder()).unwrap();
    }
}
