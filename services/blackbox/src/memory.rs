//! What a black box keeps in the runtime folder: the last seconds, and what the graph runs on, so
//! that whoever finds it after a kill can write it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use vigil_cycle::Domain;
use vigil_setup::{NotRunning, RunningGraph};

use crate::ring::{RingReader, RingWriter};

const RING: &str = "ring";
const DOCUMENT: &str = "document";

/// Begins to keep; what a process before this one has kept is gone.
///
/// # Errors
/// The system's: also that there is no room for all of it.
pub fn create(running: &RunningGraph) -> io::Result<RingWriter> {
    let folder = running.domain.memory_folder();
    remove(&folder);
    fs::create_dir(&folder)?;
    fs::copy(running.domain.document_file(), folder.join(DOCUMENT))?;
    let bytes = running.setup.file.blackbox.memory_bytes();
    RingWriter::create(&folder.join(RING), bytes)
}

/// Forgets it.
pub fn remove(folder: &Path) {
    let _ = fs::remove_dir_all(folder);
}

/// Puts aside what a process before this one has kept, until it is written. If there is no place
/// left, the oldest that is not yet written makes room for it.
pub fn set_aside(domain: &Domain) {
    let folder = domain.memory_folder();
    if RingReader::open(&folder.join(RING)).is_err() {
        return;
    }
    // A free place is older than all.
    let mut places = domain.unwritten_folders();
    places.sort_by_key(|place| kept_until(place));
    remove(&places[0]);
    let _ = fs::rename(folder, &places[0]);
}

/// When it was last written to; `None` if there is none.
pub fn kept_until(folder: &Path) -> Option<SystemTime> {
    fs::metadata(folder.join(RING)).ok()?.modified().ok()
}

/// What was put aside and is not yet written.
pub fn unwritten(domain: &Domain) -> Vec<PathBuf> {
    let folders = domain.unwritten_folders().into_iter();
    folders.filter(|folder| folder.exists()).collect()
}

/// The last seconds that lie in a folder.
///
/// # Errors
/// The system's; it is no ring.
pub fn ring(folder: &Path) -> io::Result<RingReader> {
    RingReader::open(&folder.join(RING))
}

/// The graph that they are of.
///
/// # Errors
/// What it ran on cannot be read.
pub fn graph(folder: &Path, name: &str) -> Result<RunningGraph, NotRunning> {
    RunningGraph::read_document(name, &folder.join(DOCUMENT))
}
