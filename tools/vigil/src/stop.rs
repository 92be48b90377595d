//! `vigil stop`: ends a running graph, with its launcher or without.

use std::time::{Duration, Instant};

use vigil_cycle::{Domain, FoundProcess, signal};
use vigil_setup::{NotRunning, RunningArgs};
use vigil_terminal::{CommandError, Outcome};
use vigil_timeline::EventWriter;

/// Time that a launcher may take to stop its services, and they to stop without it: the launcher
/// waits three seconds for each.
const LIMIT: Duration = Duration::from_secs(15);
/// Between two looks.
const POLL: Duration = Duration::from_millis(10);

/// Stops a running graph; the robot's adapter then holds no valid action, and stops the robot.
///
/// Its launcher stops the services and prints its summary. Without a launcher this command ends the
/// services itself. Nothing is left behind.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    running: RunningArgs,
}

/// Stops the graph, and waits for its end.
///
/// # Errors
/// A graph that does not run; one that does not end.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let running = args.running.find();
    let domain = match running {
        Ok(running) => running.domain,
        // Whatever it runs on, it can be stopped.
        Err(NotRunning::Document { name, .. }) => {
            Domain::running(&name).ok_or_else(|| CommandError::failure("it has just ended"))?
        }
        Err(error) => return Err(CommandError::failure(error)),
    };
    match domain.processes().launcher {
        Some(launcher) => signal::terminate(launcher),
        None => stop_services(&domain)?,
    }
    let name = domain.graph();
    match until(|| Domain::running(name).is_none()) {
        true => {
            eprintln!("graph '{name}' has stopped");
            Ok(Outcome::Done)
        }
        false => Err(CommandError::failure(format!(
            "graph '{name}' did not stop within {} s",
            LIMIT.as_secs()
        ))),
    }
}

/// Ends services that nobody looks after, the last of the chain first.
fn stop_services(domain: &Domain) -> Result<(), CommandError> {
    // No other launcher adopts them meanwhile.
    let launcher = domain.lock_launcher().map_err(CommandError::failure)?;
    let Some(_launcher) = launcher else {
        let message = "somebody has just taken it over: try again";
        return Err(CommandError::failure(message));
    };
    let listed = domain.processes();
    let services = listed.services.into_iter().rev().map(|(_, pid)| pid);
    // Last: it records how they ended.
    let pids = services.chain(listed.blackbox);
    let services = pids.filter_map(|pid| domain.find_process(pid));
    let services: Vec<FoundProcess> = services.collect();
    for service in &services {
        service.terminate();
        if !until(|| !service.lives()) {
            eprintln!("process {} did not stop: killed", service.id());
            service.kill();
        }
    }
    // Who holds the lock now has no service alive.
    if let Some(_lock) = domain.lock().map_err(CommandError::failure)? {
        domain.remove_residue();
        EventWriter::remove(&domain.events_file());
    }
    Ok(())
}

/// Waits until `look` is true, for [`LIMIT`] at most; false if it never was.
fn until(mut look: impl FnMut() -> bool) -> bool {
    let began = Instant::now();
    loop {
        if look() {
            return true;
        }
        if began.elapsed() > LIMIT {
            return false;
        }
        std::thread::sleep(POLL);
    }
}
