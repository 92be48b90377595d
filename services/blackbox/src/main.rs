//! `vigil-blackbox`: keeps the last seconds of a graph, and writes them at an alarm, a crash, or on
//! demand. It only observes. Exit codes: 0 stopped, 1 failed, 2 no graph.

mod feeds;
mod folder;
mod reason;
mod recorder;
mod ring;
mod watch;

use std::process::ExitCode;

use clap::Parser;
use vigil_setup::RunningArgs;

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
    let ended = match args.rescue {
        true => watch::rescue_only(running),
        false => watch::run(running),
    };
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            watch::say(&format!("the black box: {error}"));
            ExitCode::from(1)
        }
    }
}
