//! Reads the Health of every service.

use vigil_blocks::{Block, EventKind, Health};
use vigil_cycle::port::Link;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Clock, Graph, Monotonic, PortError, Receiver, Topic, health};

use crate::plan::Plan;
use crate::timeline::Timeline;

/// What the launcher knows of one service.
pub struct Watched {
    /// Which service.
    pub name: ServiceName,
    receiver: Box<dyn Receiver<Health>>,
    seen_events: u64,
    /// The newest Health of the present process.
    pub latest: Option<Box<Health>>,
    /// Counters of processes that have died.
    before: Counters,
}

/// Counters that add up over restarts.
#[derive(Debug, Clone, Copy, Default)]
pub struct Counters {
    pub cycles: u64,
    pub missed: u64,
    pub over_budget: u64,
    pub slips: u64,
    pub lost: u64,
    pub late: u64,
    pub duplicate: u64,
    pub invalid: u64,
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
    }
}

/// Instants that `health` accounts from `end_ns` on: nothing was published for them, so all of them
/// are among its misses.
fn accounted_from(health: &Health, end_ns: u64) -> u64 {
    let period_ns = health.period_ns.max(1);
    (health.accounted_ns[1] + period_ns / 2)
        .checked_sub(end_ns)
        .map_or(0, |ns| ns / period_ns + 1)
}

/// Reads Health and keeps the timeline.
pub struct Observer {
    graph: Graph,
    watched: Vec<Watched>,
    timeline: Timeline,
}

impl Observer {
    /// Opens the Health topics, before any service has written there.
    pub fn new(link: Link, plan: &Plan) -> Result<Self, PortError> {
        let graph = Graph::SharedMemory(link);
        let watch = |name| {
            let receiver = graph.receiver(Topic::Health(name))?;
            let before = Counters::default();
            Ok(Watched {
                name,
                receiver,
                seen_events: 0,
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
            timeline: Timeline::new(plan),
        })
    }

    /// Takes what is new; prints events to standard error as they come if `show`.
    pub fn poll(&mut self, show: bool) {
        for service in &mut self.watched {
            for _ in 0..service.receiver.buffer() {
                if !service.receiver.advance() {
                    break;
                }
                let Some(block) = service.receiver.held() else {
                    break;
                };
                if block.header.schema != Health::SCHEMA {
                    continue;
                }
                if let Some(old) = &service.latest
                    && old.header.epoch != block.header.epoch
                {
                    service.before.add(old);
                    service.seen_events = 0;
                }
                let timeline = &mut self.timeline;
                let overwritten = health::new_events(block, &mut service.seen_events, |event| {
                    timeline.add(service.name, event);
                });
                timeline.add_overwritten(overwritten);
                service.latest = Some(Box::new(*block));
            }
        }
        self.timeline.settle(show);
    }

    /// Instant of the first cycle in which every service answered, ns.
    pub fn ready_ns(&self) -> Option<u64> {
        self.timeline.first(EventKind::Ready)
    }

    /// Seconds since then.
    pub fn since_ready_s(&self) -> Option<f64> {
        self.ready_ns()
            .map(|ready_ns| Monotonic.now_ns().saturating_sub(ready_ns) as f64 * 1e-9)
    }

    /// Counters of a service over all its processes. What it missed because a recording was at its
    /// end is no miss.
    pub fn counters(&self, service: &Watched) -> Counters {
        let mut counters = service.before;
        if let Some(health) = &service.latest {
            counters.add(health);
            if let Some(end_ns) = self.timeline.recording_end_ns() {
                let unowed = accounted_from(health, end_ns);
                counters.missed = counters.missed.saturating_sub(unowed);
            }
        }
        counters
    }

    /// Every service watched.
    pub fn watched(&self) -> &[Watched] {
        &self.watched
    }

    /// What has happened.
    pub const fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// The services are about to be stopped: what they say of that is no event.
    pub fn close(&mut self) {
        self.timeline.close(Monotonic.now_ns());
    }

    /// Removes what dead processes left behind.
    pub fn remove_dead_peers(&self) {
        if let Graph::SharedMemory(link) = &self.graph {
            link.remove_dead_peers();
        }
    }
}
