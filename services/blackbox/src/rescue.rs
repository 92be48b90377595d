//! Writes what black boxes have kept that were killed. It stays in memory until it is written.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use vigil_cycle::{Clock, Domain, Monotonic};

use crate::folder::RecordingsFolder;
use crate::memory;
use crate::reason::Reason;
use crate::recorder::{Cause, Destination, Material, Order, Recording, RecordingError};
use crate::say::{say, tell};

/// Writes all of it, and waits for that.
pub fn run(domain: &Domain) {
    memory::set_aside(domain);
    let rescues = Rescue::start_all(domain);
    rescues.into_iter().for_each(Rescue::finish);
}

/// What an earlier process has kept, while it is being written.
pub struct Rescue {
    recording: Recording,
    folder: PathBuf,
}

impl Rescue {
    /// Begins to write all that was put aside; what cannot be read is removed.
    pub fn start_all(domain: &Domain) -> Vec<Self> {
        let mut rescues = Vec::new();
        for folder in memory::unwritten(domain) {
            match start(domain, &folder) {
                Ok(recording) => rescues.push(Self { recording, folder }),
                Err(error) => {
                    say(&format!("what a black box kept is lost: {error}"));
                    memory::remove(&folder);
                }
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
                let folder = self.folder.display();
                say(&format!(
                    "no recording: {error}; {folder} is kept until then"
                ));
            }
            ended => {
                tell(ended);
                memory::remove(&self.folder);
            }
        }
    }
}

fn start(domain: &Domain, folder: &Path) -> Result<Recording, Box<dyn Error>> {
    let ring = memory::ring(folder)?;
    let running = memory::graph(folder, domain.graph())?;
    let recordings = RecordingsFolder::find(&running)?;
    let material = Material::new(running, Destination::Folder(recordings))?;
    let now_ns = Monotonic.now_ns();
    let age = memory::kept_until(folder).and_then(|time| time.elapsed().ok());
    let order = Order {
        cause: Cause {
            reason: Reason::Crash,
            t_ns: now_ns.saturating_sub(age.as_ref().map_or(0, nanoseconds)),
            text: "the black box was killed".to_owned(),
        },
        from_ns: 0,
        until_ns: now_ns,
        until_ns_max: now_ns,
    };
    Ok(Recording::start(&Arc::new(material), ring, order))
}

fn nanoseconds(time: &Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
