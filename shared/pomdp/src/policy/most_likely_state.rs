//! MLS: the best action of the most likely state.

use super::{Choice, Measure, Policy, choose};
use crate::bounds::mdp::Solution;

/// pi_CO(argmax_s b(s)); ignores all other states.
#[derive(Debug, Clone, PartialEq)]
pub struct MostLikelyState {
    solution: Solution,
}

impl MostLikelyState {
    /// The policy that follows from a solved model.
    #[must_use]
    pub const fn new(solution: Solution) -> Self {
        Self { solution }
    }
}

impl Policy for MostLikelyState {
    /// Values are the probability of the most likely state for its action, 0 for the others.
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        values.fill(0.0);
        let state = choose(belief).action;
        if let (Some(value), Some(b)) =
            (values.get_mut(self.solution.best(state)), belief.get(state))
        {
            *value = *b;
        }
        choose(values)
    }

    fn measure(&self) -> Measure {
        Measure::Votes
    }
}
