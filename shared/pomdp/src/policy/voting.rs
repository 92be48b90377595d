//! Action voting: every state votes for its best action, with its probability.

use super::{Choice, Measure, Policy, choose};
use crate::bounds::mdp::Solution;

/// argmax_a w(a), w(a) = sum_s b(s) [pi_CO(s) = a].
#[derive(Debug, Clone, PartialEq)]
pub struct ActionVoting {
    solution: Solution,
}

impl ActionVoting {
    /// The policy that follows from a solved model.
    #[must_use]
    pub const fn new(solution: Solution) -> Self {
        Self { solution }
    }
}

impl Policy for ActionVoting {
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        values.fill(0.0);
        for (state, b) in belief.iter().enumerate() {
            if let Some(vote) = values.get_mut(self.solution.best(state)) {
                *vote += b;
            }
        }
        choose(values)
    }

    fn measure(&self) -> Measure {
        Measure::Votes
    }
}
