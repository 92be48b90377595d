//! Children that are real processes: a shell script in place of the services.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::time::Instant;

use vigil_blocks::EventKind;
use vigil_cycle::port::Link;
use vigil_cycle::watchdog::Settings;

use super::*;
use crate::locks::Claim;
use crate::plan::tests::plan;
use crate::start_options::StartOptions;
use crate::watchdog::WatchdogDriver;

const SLEEPING_SERVICE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/sleeping-service");
/// What has not happened by then never will.
const NEVER: Duration = Duration::from_secs(120);

/// Repeats `look` until it is true.
fn until(mut look: impl FnMut() -> bool) {
    let began = Instant::now();
    while !look() {
        assert!(began.elapsed() < NEVER, "it never happened");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A graph whose services sleep, in folders of its own.
struct SleepingGraph {
    plan: Plan,
    domain: Domain,
    observer: HealthObserver,
}

impl SleepingGraph {
    fn new(name: &str) -> Self {
        let graph = format!("t{}-{name}", std::process::id());
        let mut plan = plan(&["--graph", &graph]).unwrap();
        plan.programs = std::env::temp_dir().join(graph);
        fs::create_dir_all(&plan.programs).unwrap();
        for service in plan.services() {
            let program = plan.programs.join(format!("vigil-{}", service.as_str()));
            // Linked, not written: what another test's fork holds open cannot be executed.
            symlink(Path::new(SLEEPING_SERVICE), program).unwrap();
        }
        let domain = plan.setup.domain().unwrap();
        let link = Link::join(&domain, "launcher").unwrap();
        let observer = HealthObserver::new(link, &plan).unwrap();
        Self {
            plan,
            domain,
            observer,
        }
    }

    fn locks(&self) -> Locks {
        match Claim::take(&self.domain).unwrap() {
            Claim::Free(locks) | Claim::Orphaned(locks) => locks,
            Claim::Held => panic!("the launcher lives"),
        }
    }

    fn start(&self) -> Children {
        Children::start(&self.plan, &self.domain, self.locks()).unwrap()
    }

    /// Looks after the children until the detector has been started again.
    fn await_restart(&mut self, children: &mut Children) {
        until(|| {
            assert!(!children.look_after(&self.plan, &mut self.observer));
            children.restarted.contains(&ServiceName::Detector)
        });
    }

    fn events(&self, kind: EventKind) -> Vec<String> {
        let entries = self.observer.timeline.entries().into_iter();
        let of_kind = entries.filter(|entry| entry.event == kind.name());
        of_kind.map(|entry| entry.what).collect()
    }
}

impl Drop for SleepingGraph {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.plan.programs);
        self.domain.remove_residue();
    }
}

#[test]
fn a_service_that_is_killed_is_started_again_and_all_are_stopped() {
    let mut graph = SleepingGraph::new("killed");
    let mut children = graph.start();
    let listed = fs::read_to_string(graph.domain.processes_file()).unwrap();
    let ids = children.services.iter().map(|s| s.process.id());
    let expected = ServiceName::ALL.iter().zip(ids);
    let expected = expected.map(|(name, id)| format!("{} {id}\n", name.as_str()));
    assert_eq!(listed, expected.collect::<String>());

    children.end(ServiceName::Detector, "is killed by a test");
    assert!(children.services[1].process.wait(NEVER));
    assert!(!children.look_after(&graph.plan, &mut graph.observer));
    assert!(children.dead().eq([ServiceName::Detector]));
    graph.await_restart(&mut children);
    assert_eq!(children.take_restarted(), [ServiceName::Detector]);
    assert_eq!(children.take_restarted(), []);
    assert_eq!(children.dead().count(), 0);
    let restarts = ServiceName::ALL.map(|name| children.restarts(name));
    assert_eq!(restarts, [0, 1, 0, 0]);
    assert_eq!(graph.events(EventKind::Restarted), [""]);

    children.stop();
    for service in &mut children.services {
        assert!(service.process.ended().is_some());
    }
    assert!(children.report(ServiceName::Detector).is_none());
    assert_eq!(children.gave_up(), None);
}

#[test]
fn a_service_whose_assertion_fails_again_is_given_up_and_the_timeline_says_why() {
    let mut graph = SleepingGraph::new("assertion");
    let mut children = graph.start();
    let fail = |children: &mut Children| {
        fs::write(
            &children.services[1].failure,
            "7\na.rs:1:2\nat work\nx is y\n",
        )
        .unwrap();
        children.services[1].process.kill();
        assert!(children.services[1].process.wait(NEVER));
    };
    fail(&mut children);
    graph.await_restart(&mut children);
    fail(&mut children);
    assert!(children.look_after(&graph.plan, &mut graph.observer));
    let reason = children.gave_up().unwrap();
    assert!(
        reason.ends_with("the same assertion failed again (a.rs:1:2)"),
        "{reason}"
    );
    // One that fails while the graph is being stopped is in the timeline, too.
    fs::write(&children.services[3].failure, "8\nb.rs:3:4\nat work\nz\n").unwrap();
    children.take_failures(&mut graph.observer);
    let detector = "x is y (a.rs:1:2), at work";
    let expected = [detector, detector, "z (b.rs:3:4), at work"];
    assert_eq!(graph.events(EventKind::Assertion), expected);
}

#[test]
fn a_program_that_is_not_there_is_named() {
    let graph = SleepingGraph::new("missing");
    let supervisor = graph.plan.programs.join("vigil-supervisor");
    fs::remove_file(&supervisor).unwrap();
    let error = Children::start(&graph.plan, &graph.domain, graph.locks());
    let error = error.err().unwrap();
    let name = supervisor.display().to_string();
    assert!(error.to_string().starts_with(&name), "{error}");
}

#[test]
fn a_service_that_never_reports_is_ended_by_the_watchdog_and_started_again() {
    let mut graph = SleepingGraph::new("silent");
    let mut children = graph.start();
    let settings = Settings {
        startup_s: 0.0,
        ..Settings::default()
    };
    let mut watchdog = WatchdogDriver::new(&settings, vec![ServiceName::Detector]);
    until(|| {
        watchdog.look_after(&mut graph.observer, &mut children);
        !graph.events(EventKind::Watchdog).is_empty()
    });
    let found = graph.events(EventKind::Watchdog);
    assert_eq!(found, ["did not start up in time"]);
    assert!(children.services[1].process.wait(NEVER));
    graph.await_restart(&mut children);
}

#[test]
fn services_of_a_launcher_that_is_gone_are_adopted_restarted_and_stopped() {
    let mut graph = SleepingGraph::new("adopted");
    graph.plan.options.inject = vec!["stuck:RM@500".to_owned()];
    let mut children = graph.start();
    let started: Vec<u32> = children.services.iter().map(|s| s.process.id()).collect();
    assert!(matches!(Claim::take(&graph.domain).unwrap(), Claim::Held));
    // As if the launcher had been killed: nobody stops its services, and its lock is free.
    let orphans = std::mem::take(&mut children.services);
    drop(children);
    let Claim::Orphaned(locks) = Claim::take(&graph.domain).unwrap() else {
        panic!("the services hold the graph's lock");
    };
    let left = StartOptions::read(&graph.domain.options_file()).unwrap();
    assert_eq!(left, graph.plan.options);
    let children = Children::adopt(&graph.plan, &graph.domain, &mut graph.observer, locks);
    let mut children = children.unwrap();
    let adopted: Vec<u32> = children.services.iter().map(|s| s.process.id()).collect();
    assert_eq!(adopted, started);

    children.end(ServiceName::Detector, "is killed by a test");
    graph.await_restart(&mut children);
    let listed = graph.domain.processes();
    assert_eq!(listed.launcher, Some(std::process::id()));
    assert_ne!(listed.services[1].1, started[1]);
    assert_eq!(listed.services[2].1, started[2]);
    children.stop();
    for service in children.services.iter_mut().chain(&mut { orphans }) {
        assert!(service.process.wait(NEVER));
    }
}
