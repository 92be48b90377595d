//! A run from its start to its summary.

use std::io::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use vigil_cycle::port::Link;
use vigil_cycle::{Clock, Domain, Monotonic, signal};
use vigil_setup::{RunningArgs, RunningGraph};
use vigil_timeline::{EventWriter, TimelineEntry, WallClock};

use crate::args::LauncherArgs;
use crate::children::Children;
use crate::companion::{self, CompanionNews};
use crate::error::LauncherError;
use crate::locks::{Claim, Locks};
use crate::observer::{HealthObserver, ServiceView};
use crate::plan::Plan;
use crate::summary::{EndReason, RunEnd, ServiceRecord, Summary};
use crate::teller::Teller;
use crate::waiting::Waiting;
use crate::watchdog::WatchdogDriver;

/// Interval at which Health is read and children are looked after: a death is seen within a fifth
/// of the default delay before a restart. Shorter costs processor time, longer delays restarts.
const POLL: Duration = Duration::from_millis(4);
/// Time that the last answers may take after the end of a recording. Shorter than the time without
/// belief after which the supervisor stops the robot, which would be an event of no meaning.
const DRAIN: Duration = Duration::from_millis(80);

/// Why nothing was started: what to say. Exit code 2.
struct Refusal(String);

impl<E: std::fmt::Display> From<E> for Refusal {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

/// Runs a graph; returns the exit code: 0 done, 1 the run had a failure, 2 nothing was started.
#[must_use]
pub fn launch(args: &LauncherArgs) -> ExitCode {
    let graph = match args.adopt {
        true => OwnGraph::of_running(args),
        false => OwnGraph::new(args),
    };
    match graph.map(|graph| graph.run(args)) {
        Ok(Ok(false)) => ExitCode::SUCCESS,
        Ok(Ok(true)) => ExitCode::from(1),
        Ok(Err(error)) => {
            tell!("vigil: {error}");
            ExitCode::from(1)
        }
        Err(Refusal(message)) => {
            tell!("{message}");
            ExitCode::from(2)
        }
    }
}

/// A graph that is this launcher's, and is not looked after yet.
struct OwnGraph {
    plan: Plan,
    domain: Domain,
    locks: Locks,
}

impl OwnGraph {
    /// Checks everything that the services will read, and makes the graph this launcher's.
    fn new(args: &LauncherArgs) -> Result<Self, Refusal> {
        let plan = Plan::new(args)?;
        let domain = plan.setup.domain()?;
        let name = domain.graph();
        let locks = match claim(&domain)? {
            Claim::Free(locks) => locks,
            Claim::Orphaned(_) if domain.members().is_empty() => {
                return Err(Refusal(format!(
                    "vigil: `vigil check-publisher` or `vigil record` listens in the place of \
                     graph '{name}': end it first, or give this graph another name with --graph"
                )));
            }
            Claim::Orphaned(_) => {
                return Err(Refusal(format!(
                    "vigil: the services of a graph named '{name}' are running ({}), and their \
                     launcher is gone: `vigil run --adopt --graph {name}` looks after them, \
                     `vigil stop --graph {name}` ends them",
                    services(&domain)
                )));
            }
            Claim::Held => {
                return Err(Refusal(format!(
                    "vigil: a graph named '{name}' is running on this machine ({}); stop it by \
                     `vigil stop --graph {name}`, or give this one another name with --graph",
                    processes(&domain)
                )));
            }
        };
        plan.check_address()
            .map_err(|refusal| Refusal(format!("vigil: {refusal}")))?;
        Ok(Self {
            plan,
            domain,
            locks,
        })
    }

    /// Makes a running graph this launcher's, of which the own one is gone.
    fn of_running(args: &LauncherArgs) -> Result<Self, Refusal> {
        let running = RunningArgs {
            graph: args.graph.graph.clone(),
        };
        let running: RunningGraph = running.find()?;
        let name = running.domain.graph();
        let locks = match claim(&running.domain)? {
            Claim::Orphaned(locks) => locks,
            Claim::Free(_) => return Err(Refusal(format!("graph '{name}' has just ended"))),
            Claim::Held => {
                return Err(Refusal(format!(
                    "graph '{name}' has a launcher ({}); `vigil stop --graph {name}` ends it",
                    processes(&running.domain)
                )));
            }
        };
        Ok(Self {
            plan: Plan::of_running(&running)?,
            domain: running.domain,
            locks,
        })
    }

    /// Runs to the end, and prints the summary; true if the run had a failure.
    fn run(self, args: &LauncherArgs) -> Result<bool, LauncherError> {
        let Self {
            plan,
            domain,
            locks,
        } = self;
        signal::install();
        if !args.adopt {
            companion::rescue(&plan.programs, &domain);
            domain.remove_residue();
            EventWriter::remove(&domain.events_file());
            domain
                .begin()
                .map_err(|cause| LauncherError::file(domain.folder(), cause))?;
        }
        let link = Link::join(&domain, "launcher")?;
        let mut observer = HealthObserver::new(link, &plan)?;
        let _awake = args.keep_awake.then(|| plan.keep_awake()).transpose()?;
        let mut children = match args.adopt {
            true => {
                observer.read_told(&domain.events_file());
                // What a simulator that is started anew has to know.
                observer.poll();
                Children::adopt(&plan, &domain, &mut observer, locks)?
            }
            false => Children::start(&plan, &domain, locks)?,
        };
        for address in plan.setup.border().addresses(domain.folder()) {
            tell!(
                "vigil: graph '{}' takes datagrams at {address}",
                domain.graph()
            );
        }
        let mut teller = Teller::new(&domain.events_file(), !args.json);
        if args.adopt {
            tell_own(&mut teller, &mut observer, OwnNews::ADOPTED);
        }
        let mut watch = Watch {
            args,
            plan: &plan,
            teller: &mut teller,
        };
        let ended = watch.until_end(&mut observer, &mut children);
        observer.close(DRAIN);
        if let Some(gave_up) = children.gave_up() {
            companion::record_crash(&domain, gave_up);
        }
        children.stop();
        observer.poll();
        children.take_failures(&mut observer);
        let last = observer.timeline.take_new(true);
        last.iter().for_each(|entry| teller.tell(entry));
        teller.tell_misses(u64::MAX);
        children.stop_blackbox();
        companion::rescue(&plan.programs, &domain);
        let summary = summary(&plan, &observer, &children, ended);
        drop(observer);
        domain.remove_residue();
        EventWriter::remove(&domain.events_file());
        let mut out = std::io::stdout().lock();
        // A closed pipe is the reader's choice, not a failure.
        let _ = if args.json {
            writeln!(out, "{}", serde_json::to_string(&summary)?)
        } else {
            write!(out, "{summary}")
        };
        Ok(summary.failed())
    }
}

/// Tells what no service says of itself, now.
fn tell_own(teller: &mut Teller, observer: &mut HealthObserver, news: OwnNews<'_>) {
    let t_ns = Monotonic.now_ns();
    let entry = TimelineEntry {
        t_s: observer.since_ready_s(),
        t_ns,
        wall: WallClock::now().rfc3339(t_ns),
        service: news.who.to_owned(),
        event: news.event.to_owned(),
        what: news.what.to_owned(),
        ..TimelineEntry::default()
    };
    teller.tell(&entry);
    observer.timeline.add_own(entry);
}

/// What no service says of itself.
struct OwnNews<'a> {
    who: &'static str,
    event: &'static str,
    what: &'a str,
}

impl OwnNews<'_> {
    const ADOPTED: Self = Self {
        who: "launcher",
        event: "adopted",
        what: "the launcher before was gone",
    };
}

fn claim(domain: &Domain) -> Result<Claim, LauncherError> {
    Claim::take(domain).map_err(|cause| LauncherError::file(domain.folder(), cause))
}

/// The processes of a graph, for people.
fn processes(domain: &Domain) -> String {
    let launcher = domain.processes().launcher;
    let launcher = launcher.map_or_else(String::new, |pid| format!("launcher {pid}, "));
    launcher + &services(domain)
}

fn services(domain: &Domain) -> String {
    let found = domain.processes();
    let services = found.services.iter();
    let services = services.map(|(name, pid)| format!("{} {pid}", name.as_str()));
    services.collect::<Vec<_>>().join(", ")
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

/// Looks after a running graph.
struct Watch<'a> {
    args: &'a LauncherArgs,
    plan: &'a Plan,
    teller: &'a mut Teller,
}

impl Watch<'_> {
    /// Watches until the end; returns why it ended.
    fn until_end(&mut self, observer: &mut HealthObserver, children: &mut Children) -> EndReason {
        let plan = self.plan;
        let mut waiting = Waiting::new(&plan.setup);
        let services = plan.services().collect();
        let mut watchdog = WatchdogDriver::new(&plan.setup.file.watchdog, services);
        let mut recording_ended: Option<Instant> = None;
        loop {
            std::thread::sleep(POLL);
            observer.poll();
            self.tell_new(observer, &waiting);
            if signal::stop_requested() {
                return EndReason::Stopped;
            }
            if observer.timeline.recording_end_ns().is_some() {
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
            self.tell_of_blackbox(observer, children);
            watchdog.look_after(observer, children);
            let Some(lasted_s) = observer.since_ready_s() else {
                if self.has_waited_enough(&waiting) {
                    return EndReason::NeverReady;
                }
                if let Some(text) = waiting.say(observer) {
                    tell!("vigil: {text}");
                }
                continue;
            };
            let limit = self.args.duration.map(|limit| limit.as_secs_f64());
            if limit.is_some_and(|limit_s| lasted_s >= limit_s) {
                return EndReason::Duration;
            }
        }
    }

    fn tell_new(&mut self, observer: &mut HealthObserver, waiting: &Waiting) {
        let new = observer.timeline.take_new(waiting.is_long());
        new.iter().for_each(|entry| self.teller.tell(entry));
        self.teller.tell_misses(Monotonic.now_ns());
    }

    fn tell_of_blackbox(&mut self, observer: &mut HealthObserver, children: &mut Children) {
        let (event, what) = match children.take_blackbox_news() {
            Some(CompanionNews::Restarted) => ("restarted", String::new()),
            Some(CompanionNews::GaveUp(what)) => ("gave-up", what),
            None => return,
        };
        let (who, what) = ("blackbox", what.as_str());
        tell_own(self.teller, observer, OwnNews { who, event, what });
    }

    /// True, and said, if no action has come in time.
    fn has_waited_enough(&self, waiting: &Waiting) -> bool {
        let startup_s = self.plan.setup.file.watchdog.startup_s;
        let own = self.plan.waits_for_ready();
        let own = own.then(|| Duration::from_secs_f64(startup_s));
        let limit = self.args.start_timeout.or(own);
        let is_over = limit.is_some_and(|limit| waiting.elapsed() > limit);
        if is_over {
            let limit_s = limit.unwrap_or_default().as_secs_f64();
            tell!("vigil: no action came back within {limit_s} s");
        }
        is_over
    }
}
