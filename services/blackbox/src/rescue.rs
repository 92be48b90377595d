//! Writes what black boxes have kept that were killed. It stays in memory until it is written.

use std::error::Error;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use vigil_cycle::Domain;

use crate::folder::RecordingsFolder;
use crate::memory::{self, Memory};
use crate::reason::Reason;
use crate::recorder::{Cause, Destination, Material, Order, Recording, RecordingError};
use crate::say::{say, tell};

/// Time between the last block and the last event that belongs to it, ns.
const MARGIN_NS: u64 = 1_000_000_000;

/// Writes what every killed black box of a graph has kept, and waits for that.
///
/// # Errors
/// A black box that lives writes it itself; what the last one kept cannot be put aside.
pub fn run(domain: &Domain) -> Result<(), Box<dyn Error>> {
    let _lock = memory::lock(domain)?;
    memory::set_aside(domain)?;
    write(domain);
    Ok(())
}

/// Writes all that was put aside, and waits for that.
pub fn write(domain: &Domain) {
    let rescues = Rescue::start_all(domain);
    rescues.into_iter().for_each(Rescue::finish);
}

/// What an earlier process has kept, while it is being written.
pub struct Rescue {
    recording: Recording,
    folder: PathBuf,
}

impl Rescue {
    /// Begins to write all that was put aside. What cannot be read by this version is removed;
    /// what cannot be written now stays.
    pub fn start_all(domain: &Domain) -> Vec<Self> {
        let mut rescues = Vec::new();
        for folder in memory::unwritten(domain) {
            let kept = match Memory::read(&folder, domain.graph()) {
                Ok(kept) => kept,
                Err(error) => {
                    say(&format!("what a black box kept is lost: {error}"));
                    memory::remove(&folder);
                    continue;
                }
            };
            match start(kept) {
                Ok(recording) => rescues.push(Self { recording, folder }),
                Err(error) => put_off(&error, &folder),
            }
        }
        rescues
    }

    /// True once it is written, or has failed.
    pub fn is_over(&self) -> bool {
        self.recording.is_over()
    }

    /// Waits until it is written, and gives its memory back.
    pub fn finish(self) {
        match self.recording.finish() {
            Err(error @ (RecordingError::Flight(_) | RecordingError::Events(_))) => {
                put_off(&error, &self.folder);
            }
            ended => {
                tell(ended);
                memory::remove(&self.folder);
            }
        }
    }
}

fn put_off(error: &dyn Display, folder: &Path) {
    let folder = folder.display();
    say(&format!(
        "no recording: {error}; {folder} keeps it for the next start"
    ));
}

fn start(kept: Memory) -> Result<Recording, Box<dyn Error>> {
    let recordings = RecordingsFolder::find(&kept.graph)?;
    let mut material = Material::new(kept.graph, Destination::Rescue(recordings))?;
    material.events = kept.events;
    let [first_ns, last_ns] = kept.bounds_ns;
    let until_ns = last_ns.saturating_add(MARGIN_NS);
    let order = Order {
        cause: Cause {
            reason: Reason::Crash,
            t_ns: last_ns,
            text: "the black box was killed".to_owned(),
        },
        from_ns: first_ns,
        until_ns,
        until_ns_max: until_ns,
    };
    let recording = Recording::start(&Arc::new(material), kept.ring, order);
    // Nothing follows.
    recording.end();
    Ok(recording)
}
