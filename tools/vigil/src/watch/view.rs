//! What is known of a graph at an instant.

use vigil_blocks::{Action, DetectionBelief, FaultBelief, Faults, Header, Health, SensorFrame};
use vigil_timeline::TimelineEntry;

use super::end_to_end::EndToEnd;
use super::history::History;

/// What is known of a graph: the newest block of each topic, and what is kept of earlier ones.
#[derive(Debug, Clone, Default)]
pub struct View {
    /// True once the graph runs no longer.
    pub has_ended: bool,
    /// Process id of the launcher; `None` if there is none.
    pub launcher: Option<u32>,
    /// Of each service, whether its process lives; `None` if none is listed.
    pub lives: [Option<bool>; 4],
    /// Since the graph's start, s.
    pub up_s: Option<f64>,
    /// The newest faults; those that the supervisor kept, before it has said anything.
    pub faults: Option<Box<Faults>>,
    /// The newest frame.
    pub frame: Option<Box<SensorFrame>>,
    /// The detector's newest belief.
    pub detection: Option<Box<DetectionBelief>>,
    /// The identifier's newest belief.
    pub diagnosis: Option<Box<FaultBelief>>,
    /// The newest action.
    pub action: Option<Box<Action>>,
    /// The newest Health of each service.
    pub health: [Option<Box<Health>>; 4],
    /// How long actions take.
    pub end_to_end: EndToEnd,
    /// The last minute.
    pub histories: Histories,
    /// The newest events, as people are told them; the newest last.
    pub events: Vec<TimelineEntry>,
}

/// Numbers over the last minute.
#[derive(Debug, Clone, Default)]
pub struct Histories {
    /// The detector's probability of a fault.
    pub p_fault: History,
    /// The identifier's of each node of the tree.
    pub nodes: Vec<History>,
    /// The identifier's of no known fault.
    pub p_unknown: History,
    /// Cycle time of each service, us.
    pub cycle_us: [History; 4],
}

impl View {
    /// True once every topic has said something, of services those that live.
    pub fn is_complete(&self) -> bool {
        let stages = self.faults.is_some() && self.detection.is_some() && self.diagnosis.is_some();
        let ends = self.frame.is_some() && self.action.is_some();
        let mut services = self.health.iter().zip(&self.lives);
        let is_heard =
            |(health, lives): (&Option<_>, &Option<bool>)| health.is_some() || *lives != Some(true);
        stages && ends && services.all(is_heard)
    }

    /// The instant of the newest block, ns; `None` before the first.
    pub fn newest_ns(&self) -> Option<u64> {
        let published = |header: &Header| header.t_publish_ns;
        let health = self.health.iter().flatten();
        let stages = [
            self.faults.as_ref().map(|block| published(&block.header)),
            self.frame.as_ref().map(|block| published(&block.header)),
            self.detection.as_ref().map(|it| published(&it.header)),
            self.diagnosis.as_ref().map(|it| published(&it.header)),
            self.action.as_ref().map(|block| published(&block.header)),
        ];
        let health = health.map(|block| published(&block.header));
        stages.into_iter().flatten().chain(health).max()
    }
}

impl Histories {
    /// Takes the detector's belief.
    pub fn take_detection(&mut self, block: &DetectionBelief, now_ns: u64) {
        self.p_fault.push(now_ns, block.p_fault);
    }

    /// Takes the identifier's belief.
    pub fn take_diagnosis(&mut self, block: &FaultBelief, now_ns: u64) {
        let nodes = (block.node_count as usize).min(block.p.len());
        self.nodes.resize_with(nodes, History::default);
        for (history, p) in self.nodes.iter_mut().zip(&block.p) {
            history.push(now_ns, *p);
        }
        self.p_unknown.push(now_ns, block.p_unknown);
    }

    /// Takes the Health of the service in this place.
    pub fn take_health(&mut self, place: usize, block: &Health, now_ns: u64) {
        if block.cycles > 0 {
            self.cycle_us[place].push(now_ns, block.last_cycle_ns as f64 * 1e-3);
        }
    }
}
