//! `vigil-launcher`: starts the four services of a graph, watches them, restarts what dies within
//! a bound, stops them without residue, and says what happened.
//!
//! It is not in the data path: it only reads Health. Exit codes: 0 done, 1 the run had a failure,
//! 2 usage or configuration (nothing was started).

/// Writes a line to standard error; that nobody reads it is no reason to end a graph.
macro_rules! tell {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

mod children;
mod error;
mod observer;
mod plan;
mod restarts;
mod summary;
mod timeline;
mod watchdog;
mod weighing;
mod words;

use std::io::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use vigil_blocks::EventKind;
use vigil_cycle::port::Link;
use vigil_cycle::signal;

use crate::children::Children;
use crate::error::LauncherError;
use crate::observer::{HealthObserver, ServiceView};
use crate::plan::{LauncherArgs, Plan};
use crate::summary::{EndReason, RunEnd, ServiceRecord, Summary};
use crate::watchdog::WatchdogDriver;

/// Interval at which Health is read and children are looked after: a death is seen within a fifth
/// of the default delay before a restart. Shorter costs processor time, longer delays restarts.
const POLL: Duration = Duration::from_millis(4);
/// Time that the last answers may take after the end of a recording. Shorter than the time without
/// belief after which the supervisor stops the robot, which would be an event of no meaning.
const DRAIN: Duration = Duration::from_millis(80);

fn main() -> ExitCode {
    let args = LauncherArgs::parse();
    let plan = match Plan::new(&args) {
        Ok(plan) => plan,
        Err(error) => {
            tell!("{error}");
            return ExitCode::from(2);
        }
    };
    match run(&args, &plan) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Failed) => ExitCode::from(1),
        Ok(Outcome::Refused) => ExitCode::from(2),
        Err(error) => {
            tell!("vigil: {error}");
            ExitCode::from(1)
        }
    }
}

enum Outcome {
    Done,
    Failed,
    Refused,
}

fn run(args: &LauncherArgs, plan: &Plan) -> Result<Outcome, LauncherError> {
    let domain = plan.setup.domain()?;
    let lock = domain
        .lock()
        .map_err(|cause| LauncherError::file(domain.folder(), cause))?;
    let Some(lock) = lock else {
        let name = domain.graph();
        let processes = std::fs::read_to_string(domain.processes_file()).unwrap_or_default();
        tell!(
            "vigil: a graph named '{name}' is running on this machine ({}); stop it, or give this \
             one another name with --graph",
            processes.trim().replace('\n', ", ")
        );
        return Ok(Outcome::Refused);
    };
    if let Err(refusal) = plan.check_address() {
        tell!("vigil: {refusal}");
        return Ok(Outcome::Refused);
    }
    lock.share_with_children();
    domain.remove_residue();
    domain
        .begin()
        .map_err(|cause| LauncherError::file(domain.folder(), cause))?;
    signal::install();
    let link = Link::join(&domain, "launcher")?;
    let mut observer = HealthObserver::new(link, plan)?;
    let _awake = args.keep_awake.then(|| plan.keep_awake()).transpose()?;
    let mut children = Children::start(plan, &domain)?;
    for address in plan.setup.border().addresses(domain.folder()) {
        tell!(
            "vigil: graph '{}' takes datagrams at {address}",
            domain.graph()
        );
    }
    let ended = watch(args, plan, &mut observer, &mut children);
    observer.close(DRAIN);
    children.stop();
    observer.poll(!args.json);
    children.take_failures(&mut observer);
    let summary = summary(plan, &observer, &children, ended);
    drop(observer);
    domain.remove_residue();
    let mut out = std::io::stdout().lock();
    // A closed pipe is the reader's choice, not a failure.
    let _ = if args.json {
        writeln!(out, "{}", serde_json::to_string(&summary)?)
    } else {
        write!(out, "{summary}")
    };
    Ok(if summary.failed() {
        Outcome::Failed
    } else {
        Outcome::Done
    })
}

fn summary(
    plan: &Plan,
    observer: &HealthObserver,
    children: &Children,
    ended: EndReason,
) -> Summary {
    let record = |service: &ServiceView| ServiceRecord {
        name: service.name,
        health: service.latest.clone(),
        counters: observer.counters(service),
        restarts: children.restarts(service.name),
        report: children.report(service.name),
    };
    let records: Vec<ServiceRecord> = observer.watched().iter().map(record).collect();
    let run = RunEnd {
        ended,
        duration_s: observer.since_ready_s().unwrap_or(0.0),
        end_ns: observer.end_ns(),
        gave_up: children.gave_up().map(str::to_owned),
    };
    Summary::new(&plan.setup, &observer.timeline, &records, run)
}

/// Watches until the end; returns why it ended.
fn watch(
    args: &LauncherArgs,
    plan: &Plan,
    observer: &mut HealthObserver,
    children: &mut Children,
) -> EndReason {
    let started = Instant::now();
    let startup_limit = Duration::from_secs_f64(plan.setup.file.watchdog.startup_s);
    let services = plan.services().collect();
    let mut watchdog = WatchdogDriver::new(&plan.setup.file.watchdog, services);
    let mut recording_ended: Option<Instant> = None;
    loop {
        std::thread::sleep(POLL);
        observer.poll(!args.json);
        if signal::stop_requested() {
            return EndReason::Stopped;
        }
        if observer.timeline.has(EventKind::EndOfRecording) {
            // Input that is missing from now on is no failure.
            let since = *recording_ended.get_or_insert_with(Instant::now);
            if since.elapsed() > DRAIN {
                return EndReason::EndOfRecording;
            }
            continue;
        }
        if children.look_after(plan, observer) {
            return EndReason::GaveUp;
        }
        watchdog.look_after(observer, children);
        if observer.ready_ns().is_none() && plan.waits_for_ready() {
            if started.elapsed() > startup_limit {
                let limit_s = startup_limit.as_secs_f64();
                tell!("vigil: no action came back within {limit_s} s");
                return EndReason::NeverReady;
            }
            continue;
        }
        let lasted = observer.since_ready_s();
        if args
            .duration
            .is_some_and(|limit_s| lasted.is_some_and(|s| s >= limit_s))
        {
            return EndReason::Duration;
        }
    }
}
