//! What each service of a graph obeys: `[services]` of a graph file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::on_miss::OnMiss;

/// Placement and deadline of one service.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Core to pin to. Several services may name one core; every report says so.
    pub core: usize,
    /// `SCHED_FIFO` priority, used where permitted; 0: `SCHED_OTHER`.
    #[serde(default = "Settings::priority")]
    #[schemars(range(min = 0, max = 90))]
    pub priority: u8,
    /// Deadline after the scheduled instant, as a share of the period. Stagger consecutive stages:
    /// each must leave time to the next.
    #[schemars(range(min = 1.0, max = 100.0))]
    pub deadline_percent: f64,
    /// Compute budget of one cycle, as a share of the period; no more than the deadline, if that is
    /// shorter. An identifier that nears it works with fewer hypotheses or particles until there is
    /// room again.
    #[serde(default = "Settings::budget_percent")]
    #[schemars(range(min = 1.0, max = 100.0))]
    pub budget_percent: f64,
    /// What follows a missed deadline, which is always counted.
    #[serde(default)]
    pub on_miss: OnMiss,
    /// How long the service looks for its input without sleeping, about when it is due; a fifth of
    /// the period at most. Only for a service alone on its core.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub spin_us: f64,
}

impl Settings {
    /// Default, in the middle of the real-time priorities.
    const fn priority() -> u8 {
        50
    }

    /// Default: a fifth of the period is left for what the kernel does.
    const fn budget_percent() -> f64 {
        80.0
    }
}
