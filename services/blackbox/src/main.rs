//! `vigil-blackbox`: keeps the last seconds of a graph, and writes them at an alarm, a crash, or on
//! demand. It only observes. Exit codes: 0 stopped, 1 failed or nothing recorded, 2 no graph.

mod feeds;
mod folder;
mod reason;
mod record;
mod recorder;
mod ring;
mod watch;

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use vigil_setup::{RunningArgs, RunningGraph};

/// Keeps the last seconds of a running graph, and writes them at an alarm, a crash, or on demand.
///
/// The launcher starts it; it ends when it is asked to, or with the last service.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Args {
    #[command(flatten)]
    running: RunningArgs,
    /// Only write what a black box has kept that was killed.
    #[arg(long)]
    rescue: bool,
    /// Record into this file from now on, beside the graph's own black box; what lies there is
    /// replaced.
    #[arg(long, value_name = "FILE", conflicts_with = "rescue")]
    record: Option<PathBuf>,
    /// Time to record, s; until it is asked to stop if it is not given.
    #[arg(long, value_name = "S", requires = "record")]
    duration: Option<f64>,
}

impl Args {
    /// Does it; true if that was of any use.
    fn run(&self, running: RunningGraph) -> Result<bool, Box<dyn Error>> {
        match &self.record {
            Some(path) => {
                let duration = self.duration.map(Duration::try_from_secs_f64);
                record::run(running, path, duration.transpose()?)
            }
            None if self.rescue => watch::rescue_only(running).map(|()| true),
            None => watch::run(running).map(|()| true),
        }
    }
}

fn main() -> ExitCode {
    let args = Args::parse();
    let running = match args.running.find() {
        Ok(running) => running,
        Err(error) => {
            watch::say(&format!("the black box: {error}"));
            return ExitCode::from(2);
        }
    };
    match args.run(running) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            watch::say(&format!("the black box: {error}"));
            ExitCode::from(1)
        }
    }
}
