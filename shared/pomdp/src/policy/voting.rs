//! Action voting: every state votes for its best action, with its probability.

use super::{Choice, Measure, Policy, Votes, choose};
use crate::bounds::mdp::Solution;

/// argmax_a w(a), w(a) = sum_s b(s) [pi_CO(s) = a].
#[derive(Debug, Clone, PartialEq)]
pub struct ActionVoting {
    votes: Votes,
}

impl ActionVoting {
    /// The policy that follows from a solved model.
    #[must_use]
    pub fn new(solution: &Solution) -> Self {
        Self {
            votes: Votes::new(solution),
        }
    }
}

impl Policy for ActionVoting {
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        let votes = self.votes.count(belief);
        for (value, vote) in values.iter_mut().zip(votes) {
            *value = *vote;
        }
        choose(values, votes)
    }

    fn measure(&self) -> Measure {
        Measure::Votes
    }
}
