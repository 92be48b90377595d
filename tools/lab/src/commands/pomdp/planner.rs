//! What the policy `despot` may spend.

use vigil_pomdp::policy::DespotOptions;

/// Options of `despot`.
#[derive(Debug, clap::Args)]
pub struct PlannerArgs {
    /// Scenarios of a belief, for despot: 1 to 10000.
    #[arg(long, value_name = "N", default_value_t = DespotOptions::default().scenarios)]
    scenarios: usize,
    /// Trials of a decision, for despot. Each looks one step further at one leaf.
    #[arg(long, value_name = "N", default_value_t = DespotOptions::default().trials)]
    trials: usize,
    /// Steps that despot looks ahead at most, 1 to 1000.
    #[arg(long, value_name = "N", default_value_t = DespotOptions::default().depth)]
    depth: usize,
    /// What a node of a plan of despot costs, in the model's rewards.
    #[arg(long, value_name = "X", default_value_t = DespotOptions::default().regularisation)]
    regularisation: f64,
    /// Seed of the scenarios of despot.
    #[arg(long, value_name = "S", default_value_t = DespotOptions::default().seed)]
    planner_seed: u64,
    /// Nodes of the tree of despot at most.
    #[arg(long, value_name = "N", default_value_t = DespotOptions::default().nodes)]
    nodes: usize,
}

impl PlannerArgs {
    /// As the policy takes them.
    pub const fn options(&self) -> DespotOptions {
        DespotOptions {
            scenarios: self.scenarios,
            trials: self.trials,
            depth: self.depth,
            regularisation: self.regularisation,
            seed: self.planner_seed,
            nodes: self.nodes,
        }
    }
}
