//! A flood of wake-ups: a process that wakes the readers of the sensor's topic as fast as it can,
//! and never has a frame for them.

use std::error::Error;
use std::path::PathBuf;
use std::time::Duration;

use vigil_blocks::SensorFrame;
use vigil_cycle::port::Link;
use vigil_cycle::{Topic, signal};
use vigil_setup::GraphArgs;

/// First argument of a process that is a flood.
pub const FLOOD_WORD: &str = "flood";

/// Wake-ups between two looks at whether the graph still runs.
const BATCH: usize = 1000;

/// Is a flood on the graph whose file is the argument after [`FLOOD_WORD`], whenever it runs.
///
/// # Errors
/// A wrong argument, or the transport's.
pub fn be_flood(config: Option<&String>) -> Result<(), Box<dyn Error>> {
    let config = PathBuf::from(config.ok_or("no graph file is given")?);
    let domain = GraphArgs {
        config,
        ..GraphArgs::default()
    }
    .load()?
    .domain()?;
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
