//! MLS: the best action of the most likely state.

use super::{Choice, Measure, Policy, Votes, choose, least_of_best};
use crate::bounds::mdp::Solution;

/// pi_CO(argmax_s b(s)); ignores all other states.
#[derive(Debug, Clone, PartialEq)]
pub struct MostLikelyState {
    votes: Votes,
}

impl MostLikelyState {
    /// The policy that follows from a solved model.
    #[must_use]
    pub fn new(solution: &Solution) -> Self {
        Self {
            votes: Votes::new(solution),
        }
    }
}

impl Policy for MostLikelyState {
    /// Values are the probability of the most likely state for its action, 0 for the others. States
    /// that are equally likely are a tie of their actions.
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        values.fill(0.0);
        let largest = belief.iter().fold(f64::NEG_INFINITY, |max, b| b.max(max));
        let least = least_of_best(largest);
        for (state, b) in belief.iter().enumerate().filter(|(_, b)| **b >= least) {
            if let Some(value) = values.get_mut(self.votes.best(state)) {
                *value = value.max(*b);
            }
        }
        choose(values, self.votes.count(belief))
    }

    fn measure(&self) -> Measure {
        Measure::Votes
    }
}
