//! `vigil-ros2`: what a running graph says, as topics of ROS 2. It only observes.
//! Exit codes: 0 stopped, 1 failed, 2 no graph.

mod feeds;
mod network;
mod node_info;
mod observer;
mod topic_writer;

use std::process::ExitCode;
use std::time::Duration;

use clap::{CommandFactory, Parser};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Clock, Monotonic, placement, signal};
use vigil_flight::{LiveMessages, RosTopic, Subject};
use vigil_setup::{NotRunning, RunningArgs, RunningGraph};
use vigil_terminal::{CommandError, CommandTree, Outcome, exit_code};

use crate::network::{Network, NetworkArgs};
use crate::observer::{Observer, Reason};

/// Between two looks for a graph that does not run.
const WAIT: Duration = Duration::from_millis(500);

/// Publishes what a running graph says as topics of ROS 2: faults, beliefs, decisions, services.
///
/// It only observes the graph. After the graph's end it says so once, and waits for its next start.
#[derive(Debug, Parser)]
#[command(version)]
struct Args {
    #[command(flatten)]
    running: RunningArgs,
    #[command(flatten)]
    network: NetworkArgs,
    /// Publish also what the robot measures and is told: `/joint_states`, `/odom`, `/tf` and more.
    #[arg(long)]
    all: bool,
    /// Messages a second at most, of each topic that has one for each cycle.
    #[arg(long, value_name = "HZ", default_value = "10",
          value_parser = clap::value_parser!(u32).range(1..=1000))]
    rate: u32,
    /// End with the graph.
    #[arg(long)]
    once: bool,
}

fn main() -> ExitCode {
    if let Some(printed) = CommandTree::answer(Args::command()) {
        return exit_code(
            printed
                .map(|()| Outcome::Done)
                .map_err(CommandError::failure),
        );
    }
    exit_code(run(&Args::parse()))
}

fn run(args: &Args) -> Result<Outcome, CommandError> {
    signal::install();
    let Some(mut running) = find(args)? else {
        return Ok(Outcome::Done);
    };
    let setup = &running.setup;
    // Before the network: its threads stay where this one is.
    placement::keep_off(&ServiceName::ALL.map(|name| setup.service(name).core));
    let wanted = |topic: &&RosTopic| args.all || topic.subject == Subject::Verdict;
    let topics: Vec<_> = RosTopic::ALL.into_iter().filter(wanted).collect();
    let graph = running.domain.graph().to_owned();
    let network = Network::open(&args.network, &graph, &topics).map_err(CommandError::failure)?;
    eprintln!("graph '{graph}' is published: {network}");
    let period_ns = 1_000_000_000 / u64::from(args.rate);
    let mut messages = LiveMessages::new(&running.setup, period_ns, Monotonic.now_ns());
    let mut is_first = true;
    loop {
        let observer = Observer::join(&running, args.all, is_first);
        let mut observer = observer.map_err(CommandError::failure)?;
        let followed = observer.follow(&mut messages, &network);
        let reason = followed.map_err(CommandError::failure)?;
        drop(observer);
        let now_ns = Monotonic.now_ns();
        let told = messages.end(reason.text(), now_ns, &mut |message| network.send(message));
        told.map_err(CommandError::failure)?;
        if reason == Reason::Stopped || args.once {
            break;
        }
        eprintln!("graph '{graph}': {}", reason.text());
        let Some(next) = wait(&graph) else {
            break;
        };
        running = next;
        messages = messages.restarted(&running.setup, Monotonic.now_ns());
        is_first = false;
    }
    network.finish();
    Ok(Outcome::Done)
}

/// The graph; one that is named and does not run is waited for. `None`: this is to stop.
fn find(args: &Args) -> Result<Option<RunningGraph>, CommandError> {
    match args.running.find() {
        Ok(running) => Ok(Some(running)),
        Err(NotRunning::Unknown { name, .. }) if !args.once => {
            eprintln!("graph '{name}' does not run yet: waiting");
            Ok(wait(&name))
        }
        Err(error) => Err(CommandError::usage(error)),
    }
}

/// Waits until a graph runs and can be read; `None`: this is to stop.
fn wait(graph: &str) -> Option<RunningGraph> {
    while !signal::stop_requested() {
        if let Ok(running) = RunningGraph::read(graph) {
            return Some(running);
        }
        std::thread::sleep(WAIT);
    }
    None
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use clap::CommandFactory;

    use super::Args;

    #[test]
    fn vigil_names_every_option() {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vigil/src/ros2.rs");
        let source = std::fs::read_to_string(source).unwrap();
        for option in Args::command().get_opts().filter_map(|it| it.get_long()) {
            assert!(source.contains(&format!("`--{option}")), "--{option}");
        }
    }
}
