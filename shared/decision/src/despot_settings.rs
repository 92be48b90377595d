//! What the policy `despot` may spend: `[supervisor.despot]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use vigil_pomdp::policy::DespotOptions;

/// A search that begins with each new belief and goes on in every cycle while it stands.
#[derive(Debug, Clone, Copy, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DespotSettings {
    /// Scenarios of a belief. With as many as the decision model has states, plans are exact.
    #[default(64)]
    #[schemars(range(min = 1, max = 1000))]
    pub scenarios: u32,
    /// Trials of a decision about a new belief, and of each cycle in which the belief stands. Each
    /// looks one step further. Too many for a cycle are refused.
    #[default(4)]
    #[schemars(range(min = 1, max = 1000))]
    pub trials: u32,
    /// Nodes of the tree of a belief: once they are used up, its plan stands.
    #[default(20_000)]
    #[schemars(range(min = 100, max = 1_000_000))]
    pub nodes: u32,
    /// Seed of the scenarios. Equal journals and seeds give equal actions.
    #[default(1)]
    pub seed: u64,
}

impl DespotSettings {
    /// As the policy takes them.
    #[must_use]
    pub fn options(&self) -> DespotOptions {
        DespotOptions {
            scenarios: self.scenarios as usize,
            trials: self.trials as usize,
            nodes: self.nodes as usize,
            seed: self.seed,
            ..DespotOptions::default()
        }
    }
}
