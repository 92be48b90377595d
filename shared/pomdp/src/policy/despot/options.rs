//! What a search may do, and what it costs.

use crate::bounds::SolveError;
use crate::model::Pomdp;
use crate::policy::PointBased;

/// Largest memory of a planner, bytes: 2 GiB.
pub(super) const BYTES_MAX: usize = 2 << 30;

/// Settings of [`super::Despot`]. The defaults are for the desk: a decision takes about 1 ms in a
/// model of 1000 states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DespotOptions {
    /// K, scenarios of a belief, 1 to 10000. Where a belief has more states than that, more cost
    /// time in proportion, and fewer plan for the luck of a few.
    pub scenarios: usize,
    /// Trials for a new belief, and in each share of spare time. Each looks one step further at one
    /// leaf.
    pub trials: usize,
    /// D, steps that are looked ahead at most, 1 to 1000. Then the best plan that is known without
    /// a search is followed.
    pub depth: usize,
    /// Lambda, what a node of a plan costs, in the model's rewards: larger ones prefer small plans.
    /// 0 by default: on public models none earned more with the scenarios weighted.
    pub regularisation: f64,
    /// Seed of the scenarios.
    pub seed: u64,
    /// Nodes of the tree at most. When they are used up, the plan stands.
    pub nodes: usize,
}

impl Default for DespotOptions {
    fn default() -> Self {
        Self {
            scenarios: 100,
            trials: 300,
            depth: 90,
            regularisation: 0.0,
            seed: 1,
            nodes: 50_000,
        }
    }
}

/// Why a planner cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DespotError {
    /// No scenario, or too many.
    #[error("{0} scenarios: allowed are 1 to 10000")]
    Scenarios(usize),
    /// No step, or too many.
    #[error("depth {0}: allowed is 1 to 1000")]
    Depth(usize),
    /// A cost that is none.
    #[error("regularisation {0}: allowed is 0 or more, and finite")]
    Regularisation(f64),
    /// No node at all.
    #[error("no node: allowed is one or more")]
    Nodes,
    /// The tree would take too much memory.
    #[error(
        "{nodes} nodes and {scenarios} scenarios take {bytes} bytes, allowed are {BYTES_MAX}: \
         choose fewer"
    )]
    Memory {
        /// Nodes that are wanted.
        nodes: usize,
        /// Scenarios that are wanted.
        scenarios: usize,
        /// What they would take.
        bytes: usize,
    },
    /// A bound that the search begins with cannot be found.
    #[error(transparent)]
    Solve(#[from] SolveError),
}

impl DespotOptions {
    /// Multiplications of the trials of a decision beyond which a cycle has no time for it: some
    /// 0.1 ms where most states allow few observations, 1 ms where all allow all.
    pub const PRODUCTS_MAX: usize = 2_000_000;

    /// Multiplications of the trials of a decision about `model`, at most, where a search may end
    /// with what is `solved`.
    #[must_use]
    pub fn products(&self, model: &Pomdp, solved: Option<&PointBased>) -> usize {
        let (n, actions) = (model.states().len(), model.actions().len());
        let pairs = || (0..actions).flat_map(|a| (0..n).map(move |s| (s, a)));
        let possible = |(s, a): (usize, usize)| {
            let all = 0..model.observations().len();
            all.filter(|z| model.likelihood(a, *z)[s] > 0.0).count()
        };
        let successors = pairs().map(|(s, a)| model.successors(s, a).len());
        let moves = self.scenarios.min(n) * successors.fold(0, usize::max);
        let observed = moves.min(n) * pairs().map(possible).fold(0, usize::max);
        let plans = 2 * actions + solved.map_or(0, |solved| solved.first_actions().len());
        self.trials
            .saturating_mul(actions * (moves + observed * plans))
    }

    /// Refuses what no search can do.
    pub(super) const fn check(&self) -> Result<(), DespotError> {
        if self.scenarios < 1 || self.scenarios > 10_000 {
            return Err(DespotError::Scenarios(self.scenarios));
        }
        if self.depth < 1 || self.depth > 1000 {
            return Err(DespotError::Depth(self.depth));
        }
        if !(self.regularisation >= 0.0 && self.regularisation.is_finite()) {
            return Err(DespotError::Regularisation(self.regularisation));
        }
        if self.nodes < 1 {
            return Err(DespotError::Nodes);
        }
        Ok(())
    }
}
