//! A graph that has been started, and runs beside what is measured.

use std::error::Error;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use serde_json::Value;
use vigil_cycle::signal;

use crate::latency::graph::GraphFile;

/// Time for the graph to come up.
const START_LIMIT: Duration = Duration::from_secs(60);
/// Between two looks.
const POLL: Duration = Duration::from_millis(50);

/// A launched graph; stopped when dropped.
#[derive(Debug)]
pub struct Launched {
    launcher: Child,
    events: PathBuf,
    printed: PathBuf,
    errors: PathBuf,
}

impl Launched {
    /// Starts the launcher of `graph` by this command, and waits until every stage answers. What it
    /// prints goes to `folder`.
    ///
    /// # Errors
    /// If the graph does not come up.
    pub fn start(
        graph: &GraphFile,
        mut command: Command,
        folder: &Path,
    ) -> Result<Self, Box<dyn Error>> {
        let [printed, errors] = ["printed.json", "errors.txt"].map(|name| folder.join(name));
        let events = graph.setup().domain()?.events_file();
        command.stdout(File::create(&printed)?);
        command.stderr(File::create(&errors)?);
        let mut launched = Self {
            launcher: command.spawn()?,
            events,
            printed,
            errors,
        };
        launched.wait_until_ready()?;
        Ok(launched)
    }

    fn wait_until_ready(&mut self) -> Result<(), Box<dyn Error>> {
        let began = Instant::now();
        let is_ready =
            |events: &Path| fs::read_to_string(events).is_ok_and(|text| text.contains("\"ready\""));
        while !is_ready(&self.events) {
            if let Some(status) = self.launcher.try_wait()? {
                let said = fs::read_to_string(&self.errors).unwrap_or_default();
                return Err(format!("the graph ended with {status}\n{said}").into());
            }
            if began.elapsed() > START_LIMIT {
                return Err(format!("no graph after {START_LIMIT:?}").into());
            }
            std::thread::sleep(POLL);
        }
        Ok(())
    }

    /// Stops it; what it has printed.
    ///
    /// # Errors
    /// The file system's.
    pub fn stop(self) -> Result<Vec<u8>, Box<dyn Error>> {
        let printed = self.printed.clone();
        drop(self);
        Ok(fs::read(printed)?)
    }

    /// Stops it; its summary.
    ///
    /// # Errors
    /// The file system's; a summary that is none.
    pub fn summary(self) -> Result<Value, Box<dyn Error>> {
        Ok(serde_json::from_slice(&self.stop()?)?)
    }
}

impl Drop for Launched {
    fn drop(&mut self) {
        if matches!(self.launcher.try_wait(), Ok(None)) {
            signal::terminate(self.launcher.id());
            let _ = self.launcher.wait();
        }
    }
}
