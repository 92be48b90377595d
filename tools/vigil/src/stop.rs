//! `vigil stop`: ends a running graph, with its launcher or without.

use std::io::{self, IsTerminal};
use std::path::Path;
use std::time::{Duration, Instant};

use vigil_cycle::{Domain, signal};
use vigil_setup::{NotRunning, RunningArgs};
use vigil_terminal::{CommandError, Outcome};
use vigil_timeline::EventWriter;

/// Time that a graph may take to stop: its launcher waits three seconds for each service, twenty
/// for the black box to finish a recording, and twenty for what a killed one kept.
const LIMIT: Duration = Duration::from_secs(60);
/// Time that a process may take without a launcher.
const PROCESS_LIMIT: Duration = Duration::from_secs(20);
/// Between two looks.
const POLL: Duration = Duration::from_millis(10);

/// Stops a running graph; the robot's adapter then holds no valid action, and stops the robot.
///
/// Its launcher stops the services and prints its summary. Without a launcher this command ends the
/// services itself. No process and no shared memory is left behind. Without --graph it asks first,
/// at a terminal; elsewhere --graph is needed, so that no script stops a robot by mistake.
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
    if let (None, Ok(running)) = (&args.running.graph, &running) {
        demand_consent(running.domain.graph())?;
    }
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
        None if domain.members().is_empty() => {
            return Err(CommandError::failure(format!(
                "`vigil check-publisher` or `vigil record` listens in the place of graph '{}': \
                 end it by Ctrl-C",
                domain.graph()
            )));
        }
        None => stop_services(&domain)?,
    }
    let name = domain.graph();
    match until(LIMIT, || Domain::running(name).is_none()) {
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

/// Asks whether the only graph that runs is meant.
fn demand_consent(name: &str) -> Result<(), CommandError> {
    if !io::stdin().is_terminal() {
        let message = format!("say which graph: `vigil stop --graph {name}`");
        return Err(CommandError::usage(message));
    }
    eprint!("stop graph '{name}'? [y/N] ");
    let mut answer = String::new();
    let read = io::stdin().read_line(&mut answer);
    read.map_err(CommandError::failure)?;
    match answer.trim() {
        "y" | "Y" | "yes" => Ok(()),
        _ => Err(CommandError::failure("nothing was stopped")),
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
    // The last of the chain first, so that none waits for input in vain; the black box last, for
    // it records how they ended; and what nobody has listed.
    let services = listed.services.into_iter().rev().map(|(_, pid)| pid);
    let pids = services.chain(listed.blackbox);
    let listed = pids.filter_map(|pid| domain.find_process(pid));
    for process in listed.chain(domain.members()) {
        process.terminate();
        if !until(PROCESS_LIMIT, || !process.lives()) {
            eprintln!("process {} did not stop: killed", process.id());
            process.kill();
            until(PROCESS_LIMIT, || !process.lives());
        }
    }
    // Who holds the lock now has no service alive.
    let mut lock = Ok(None);
    until(PROCESS_LIMIT, || {
        lock = domain.lock();
        !matches!(lock, Ok(None))
    });
    let Some(lock) = lock.map_err(CommandError::failure)? else {
        let message = "a process of it is left that could not be ended: nothing was removed";
        return Err(CommandError::failure(message));
    };
    // Whoever ends this command: nobody starts the graph while its last seconds are written.
    lock.share_with_children();
    let program = std::env::current_exe().ok();
    if let Some(programs) = program.as_deref().and_then(Path::parent) {
        vigil_launcher::rescue(programs, domain);
    }
    domain.remove_residue();
    EventWriter::remove(&domain.events_file());
    Ok(())
}

/// Waits until `look` is true, for `limit` at most; false if it never was.
fn until(limit: Duration, mut look: impl FnMut() -> bool) -> bool {
    let began = Instant::now();
    loop {
        if look() {
            return true;
        }
        if began.elapsed() > limit {
            return false;
        }
        std::thread::sleep(POLL);
    }
}
