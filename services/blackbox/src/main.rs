//! `vigil-blackbox`: keeps the last seconds of a graph, and writes them at an alarm, a crash, or on
//! demand. It only observes. Exit codes: 0 stopped, 1 failed or nothing recorded, 2 no graph.

mod feeds;
mod folder;
mod memory;
mod reason;
mod record;
mod recorder;
mod rescue;
mod ring;
mod say;
mod watch;

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use vigil_cycle::domain::Queues;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Domain, placement};
use vigil_setup::RunningArgs;

use crate::say::say;

/// Keeps the last seconds of a running graph, and writes them at an alarm, a crash, or on demand.
///
/// The launcher starts it; it ends when it is asked to, or with the last service.
#[derive(Debug, Parser)]
#[command(version)]
struct Args {
    #[command(flatten)]
    running: RunningArgs,
    /// Only write what black boxes have kept that were killed.
    #[arg(long, requires = "graph")]
    rescue: bool,
    /// Record into this file from now on, beside the graph's own black box; what lies there is
    /// replaced.
    #[arg(long, value_name = "FILE", conflicts_with = "rescue")]
    record: Option<PathBuf>,
    /// Time to record, s; until it is asked to stop if it is not given.
    #[arg(long, value_name = "S", requires = "record")]
    duration: Option<f64>,
    /// Print one JSON document about what was recorded.
    #[arg(long, requires = "record")]
    json: bool,
}

impl Args {
    /// Does it; the code to exit with.
    fn run(&self) -> Result<u8, Box<dyn Error>> {
        // The graph need not run any more.
        if let (true, Some(graph)) = (self.rescue, &self.running.graph) {
            rescue::run(&Domain::new(graph, Queues::default())?)?;
            return Ok(0);
        }
        let running = match self.running.find() {
            Ok(running) => running,
            Err(error) => {
                say(&format!("the black box: {error}"));
                return Ok(2);
            }
        };
        let services = ServiceName::ALL.map(|name| running.setup.service(name).core);
        placement::keep_off(&services);
        match &self.record {
            Some(path) => {
                let duration = self.duration.map(Duration::try_from_secs_f64);
                let is_something = record::run(running, path, duration.transpose()?, self.json)?;
                Ok(u8::from(!is_something))
            }
            None => watch::run(running).map(|()| 0),
        }
    }
}

fn main() -> ExitCode {
    match Args::parse().run() {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            say(&format!("the black box: {error}"));
            ExitCode::from(1)
        }
    }
}
