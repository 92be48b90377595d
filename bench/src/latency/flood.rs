//! A flood of wake-ups: a process that wakes the readers of the sensor's topic as fast as it can,
//! and never has a frame for them.

use std::error::Error;
use std::path::Path;
use std::time::Duration;

use vigil_blocks::SensorFrame;
use vigil_cycle::port::Link;
use vigil_cycle::{Topic, signal};

/// The word with which the program is a flood.
pub const FLOOD_WORD: &str = "sensor-flood";

/// Wake-ups between two looks at whether the graph still runs.
const BATCH: usize = 1000;

/// Is a flood on the graph of this file, whenever it runs.
///
/// # Errors
/// Those of the file and the transport.
pub fn be_flood(config: &Path) -> Result<(), Box<dyn Error>> {
    let domain = crate::load(config)?.domain()?;
    signal::install();
    while !signal::stop_requested() {
        // Not before the launcher has cleaned up and started its services.
        if !domain.processes_file().exists() {
            std::thread::sleep(Duration::from_millis(5));
            continue;
        }
        let link = Link::join(&domain, "flood")?;
        let notifier = link.notifier::<SensorFrame>(Topic::Sensor)?;
        while domain.processes_file().exists() && !signal::stop_requested() {
            for _ in 0..BATCH {
                // A refusal is as good: the socket is full.
                let _ = notifier.notify();
            }
        }
    }
    // Unless the next graph runs already.
    if let Some(_lock) = domain.lock()? {
        domain.remove_residue();
    }
    Ok(())
}
