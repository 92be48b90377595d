//! How a service is.

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::{Degraded, Health};
use vigil_cycle::Placement;
use vigil_cycle::topic::ServiceName;
use vigil_timeline::service_state_text;

use crate::watch::View;

/// Health comes 20 times a second: without it for so long a service is silent.
const SILENT_S: f64 = 1.0;

/// A service of the graph.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Service {
    /// Its name.
    pub name: &'static str,
    /// `starting`, `ready`, `running`, `degraded`, `stopping`, `silent` or `gone`.
    pub state: &'static str,
    /// Why it is degraded.
    pub degraded: Vec<&'static str>,
    /// What it says of itself; null before it has said anything.
    pub health: Option<ServiceHealth>,
}

/// What a service says of itself.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ServiceHealth {
    /// Process id.
    pub pid: u32,
    /// Since it said so.
    pub age_s: f64,
    /// Cycles done.
    pub cycles: u64,
    /// From wake-up to publication, of the last cycle.
    pub cycle_us_last: f64,
    /// Of the longest cycle.
    pub cycle_us_max: f64,
    /// What a cycle may take.
    pub budget_us: f64,
    /// Deadlines missed.
    pub missed: u64,
    /// Cycles longer than the budget.
    pub over_budget: u64,
    /// Input blocks that never arrived.
    pub lost: u64,
    /// Input blocks that arrived after their deadline.
    pub late: u64,
    /// Input blocks that were refused.
    pub rejected: u64,
    /// Core that it runs on.
    pub core: u32,
    /// True if it may run on no other core.
    pub pinned: bool,
    /// `fifo:PRIORITY` or `other`.
    pub scheduling: String,
}

impl Service {
    /// The services that a view knows, in the order of the data.
    pub fn all(view: &View, now_ns: u64) -> Vec<Self> {
        let of_place = |name: ServiceName| {
            let health = view.health[name.index()].as_deref();
            Self::new(name, health, view.lives[name.index()], now_ns)
        };
        let is_there = |service: &Self| service.health.is_some() || service.state == "gone";
        let all = ServiceName::ALL.into_iter().map(of_place);
        all.filter(is_there).collect()
    }

    fn new(name: ServiceName, health: Option<&Health>, lives: Option<bool>, now_ns: u64) -> Self {
        let degraded = health.map_or(0, |health| health.degraded);
        let health = health.map(|health| (health.state, ServiceHealth::new(health, now_ns)));
        let state = match (lives, &health) {
            (Some(false), _) => "gone",
            (_, None) => "silent",
            (_, Some((_, health))) if health.age_s > SILENT_S => "silent",
            _ if degraded != 0 => "degraded",
            (_, Some((state, _))) => service_state_text(*state),
        };
        Self {
            name: name.as_str(),
            state,
            degraded: reasons(degraded),
            health: health.map(|(_, health)| health),
        }
    }

    /// True if it works as it should.
    pub fn is_well(&self) -> bool {
        ["running", "ready", "starting"].contains(&self.state)
    }
}

impl ServiceHealth {
    fn new(health: &Health, now_ns: u64) -> Self {
        let us = |ns: u64| (ns as f64 / 100.0).round() / 10.0;
        let age_ns = now_ns.saturating_sub(health.header.t_publish_ns);
        Self {
            pid: health.pid,
            age_s: (age_ns as f64 * 1e-6).round() * 1e-3,
            cycles: health.cycles,
            cycle_us_last: us(health.last_cycle_ns),
            cycle_us_max: us(health.worst_cycle_ns),
            budget_us: us(health.budget_ns),
            missed: health.missed,
            over_budget: health.over_budget,
            lost: health.lost,
            late: health.late,
            rejected: health.invalid,
            core: health.core,
            pinned: health.pinned != 0,
            scheduling: Placement::scheduling(health.policy, health.priority),
        }
    }
}

fn reasons(bits: u32) -> Vec<&'static str> {
    let reasons = [
        (Degraded::INPUT_LOST, "input-lost"),
        (Degraded::LATE, "late"),
        (Degraded::FEWER_PARTICLES, "fewer-particles"),
        (Degraded::QUARANTINE, "quarantine"),
    ];
    let present = reasons.into_iter().filter(|(bit, _)| bits & bit != 0);
    present.map(|(_, word)| word).collect()
}
