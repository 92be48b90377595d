//! Reads the Health of every service.

use std::path::Path;
use std::time::Duration;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::{Block, Health, REJECTIONS};
use vigil_cycle::port::Link;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Clock, Graph, Monotonic, PortError, Receiver, Topic, health};

use vigil_timeline::{EventReader, Timeline};

use crate::plan::{DriveProgress, Plan};

/// What the launcher knows of one service.
pub struct ServiceView {
    /// Which service.
    pub name: ServiceName,
    receiver: Box<dyn Receiver<Health>>,
    /// Number of the first event that has not been read.
    next_event: u64,
    /// The newest Health of the present process.
    pub latest: Option<Box<Health>>,
    /// Counters of processes that have died.
    before: Counters,
}

/// Counters that add up over restarts.
#[derive(Debug, Clone, Copy, Default, Serialize, JsonSchema)]
pub struct Counters {
    /// Cycles that were computed.
    pub cycles: u64,
    /// Scheduled instants whose deadline passed without output.
    pub missed: u64,
    /// Cycles that took longer than their budget.
    pub over_budget: u64,
    /// Scheduled instants that the source slept through.
    pub slips: u64,
    /// Input blocks that never came.
    pub lost: u64,
    /// Cycles whose input came after the deadline.
    pub late: u64,
    /// Input blocks that came twice.
    pub duplicate: u64,
    /// Input blocks that were refused.
    pub invalid: u64,
    /// Refused input by cause, see [`vigil_blocks::Rejection`]. The summary names the causes.
    #[serde(skip)]
    pub rejected: [u64; REJECTIONS],
}

impl Counters {
    fn add(&mut self, health: &Health) {
        self.cycles += health.cycles;
        self.missed += health.missed;
        self.over_budget += health.over_budget;
        self.slips += health.slips;
        self.lost += health.lost;
        self.late += health.late;
        self.duplicate += health.duplicate;
        self.invalid += health.invalid;
        for (sum, count) in self.rejected.iter_mut().zip(health.rejected) {
            *sum += count;
        }
    }
}

/// Instants that `health` accounts after the last frame's, `end_ns`: nothing was published for
/// them, so all of them are among its misses.
fn accounted_after(health: &Health, end_ns: u64) -> u64 {
    let period_ns = health.period_ns.max(1);
    (health.accounted_ns[1] + period_ns / 2).saturating_sub(end_ns) / period_ns
}

/// Reads Health and keeps the timeline.
pub struct HealthObserver {
    graph: Graph,
    watched: Vec<ServiceView>,
    /// What has happened.
    pub timeline: Timeline,
    is_external: bool,
}

impl HealthObserver {
    /// Opens the Health topics, before any service has written there.
    pub fn new(link: Link, plan: &Plan) -> Result<Self, PortError> {
        let graph = Graph::SharedMemory(link);
        let watch = |name| {
            let receiver = graph.receiver(Topic::Health(name))?;
            let before = Counters::default();
            Ok(ServiceView {
                name,
                receiver,
                next_event: 0,
                latest: None,
                before,
            })
        };
        let watched = plan
            .services()
            .map(watch)
            .collect::<Result<_, PortError>>()?;
        Ok(Self {
            watched,
            graph,
            timeline: Timeline::new(&plan.setup),
            is_external: !plan.waits_for_ready(),
        })
    }

    /// Takes what is new.
    pub fn poll(&mut self) {
        for service in &mut self.watched {
            for _ in 0..service.receiver.buffer() {
                let Some(block) = service.receiver.take_next() else {
                    break;
                };
                if block.header.schema != Health::SCHEMA {
                    continue;
                }
                if let Some(old) = &service.latest
                    && old.header.epoch != block.header.epoch
                {
                    service.before.add(old);
                    service.next_event = 0;
                }
                let timeline = &mut self.timeline;
                let overwritten = health::new_events(block, &mut service.next_event, |event| {
                    timeline.add(service.name, event);
                });
                timeline.add_overwritten(service.name, overwritten);
                // An external sensor does not say when the drive begins: the first action does.
                if self.is_external && service.name == ServiceName::Supervisor && block.cycles > 0 {
                    self.timeline.begin(block.accounted_ns[0]);
                }
                service.latest = Some(Box::new(*block));
            }
        }
    }

    /// What an earlier launcher has told, in the file at `path`, is not told again.
    pub fn read_told(&mut self, path: &Path) {
        let mut told = EventReader::open(path);
        while let Ok(Some(entry)) = told.next_entry() {
            self.timeline.add_told(entry);
        }
    }

    /// What a simulator that replaces another has to know; `None` before the drive has begun.
    pub fn drive(&self) -> Option<DriveProgress> {
        Some(DriveProgress {
            began_ns: self.ready_ns()?,
            t_s: self.since_ready_s()?,
            changes: self.timeline.changes(),
        })
    }

    /// Instant of the first cycle in which every service answered, ns.
    pub fn ready_ns(&self) -> Option<u64> {
        self.timeline.origin_ns()
    }

    /// Seconds since then.
    pub fn since_ready_s(&self) -> Option<f64> {
        self.ready_ns()
            .map(|ready_ns| Monotonic.now_ns().saturating_sub(ready_ns) as f64 * 1e-9)
    }

    /// Counters of a service over all its processes. What it missed because a recording was at its
    /// end is no miss.
    pub fn counters(&self, service: &ServiceView) -> Counters {
        let mut counters = service.before;
        if let Some(health) = &service.latest {
            counters.add(health);
            if let Some(end_ns) = self.timeline.recording_end_ns() {
                let unowed = accounted_after(health, end_ns);
                counters.missed = counters.missed.saturating_sub(unowed);
            }
        }
        counters
    }

    /// Every service watched.
    pub fn watched(&self) -> &[ServiceView] {
        &self.watched
    }

    /// Instant at which the run ended, ns: now, unless it was closed before.
    pub fn end_ns(&self) -> u64 {
        self.timeline
            .closed_ns()
            .unwrap_or_else(|| Monotonic.now_ns())
    }

    /// The services are about to be stopped: what they report from now on is no event of the run.
    /// After the end of a recording they may answer for as long as `drain`.
    pub fn close(&mut self, drain: Duration) {
        let drained_ns = |end_ns: u64| end_ns.saturating_add(drain.as_nanos() as u64);
        let limit_ns = self
            .timeline
            .recording_end_ns()
            .map_or(u64::MAX, drained_ns);
        self.timeline.close(Monotonic.now_ns().min(limit_ns));
    }

    /// Removes what dead processes left behind.
    pub fn remove_dead_peers(&self) {
        if let Graph::SharedMemory(link) = &self.graph {
            link.remove_dead_peers();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::tests::plan;
    use vigil_blocks::{Event, EventKind};
    use vigil_cycle::Stamp;

    #[test]
    fn what_a_service_reports_over_a_restart_adds_up_from_the_first_cycle_on() {
        let graph = format!("t{}-observer", std::process::id());
        let plan = plan(&["--graph", &graph]).unwrap();
        let domain = plan.setup.domain().unwrap();
        let link = || Link::join(&domain, "test").unwrap();
        let mut observer = HealthObserver::new(link(), &plan).unwrap();
        assert_eq!(observer.since_ready_s(), None);
        let service = Graph::SharedMemory(link());
        let mut report = |cycles, began_ns| {
            let topic = Topic::Health(ServiceName::SensorSim);
            let mut sender = service.sender::<Health>(topic).unwrap();
            let health = sender.block();
            (health.cycles, health.event_count) = (cycles, 1);
            health.events[0] = Event {
                t_ns: began_ns,
                kind: EventKind::Ready as u32,
                ..Event::default()
            };
            sender.send(Stamp::default(), &Monotonic).unwrap();
            // What a writer that is gone has sent cannot be read any more.
            observer.poll();
        };
        report(5, 7);
        report(3, 9);
        // The drive began with the first process.
        assert_eq!(observer.ready_ns(), Some(7));
        assert_eq!(observer.drive().unwrap().began_ns, 7);
        assert!(observer.since_ready_s().is_some());
        let watched = &observer.watched()[0];
        assert_eq!(watched.name, ServiceName::SensorSim);
        assert_eq!(observer.counters(watched).cycles, 8);
        observer.remove_dead_peers();
        observer.close(Duration::ZERO);
        assert_eq!(observer.timeline.closed_ns(), Some(observer.end_ns()));
        drop((observer, service));
        domain.remove_residue();
    }

    #[test]
    fn counters_of_processes_that_followed_each_other_add_up() {
        let mut health = Health {
            cycles: 5,
            missed: 2,
            lost: 1,
            ..Health::default()
        };
        health.rejected[3] = 7;
        let mut counters = Counters::default();
        (0..2).for_each(|_| counters.add(&health));
        assert_eq!(
            (counters.cycles, counters.missed, counters.lost),
            (10, 4, 2)
        );
        assert_eq!(counters.rejected[3], 14);
    }

    #[test]
    fn instants_after_the_last_frame_are_counted_exactly() {
        let health = |last_ns| Health {
            period_ns: 1000,
            accounted_ns: [1000, last_ns],
            ..Health::default()
        };
        for (last_ns, expected) in [(4000, 0), (5000, 0), (6000, 1), (9000, 4), (8990, 4)] {
            assert_eq!(
                accounted_after(&health(last_ns), 5000),
                expected,
                "{last_ns}"
            );
        }
    }
}
