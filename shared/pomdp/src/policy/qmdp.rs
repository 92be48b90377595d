//! Q-MDP: the action with the largest expected value if all became observable after it.

use super::{Choice, Policy, Votes, choose};
use crate::bounds::mdp::Solution;

/// argmax_a sum_s b(s) Q_CO(s,a). Never gathers information for its own sake; see
/// [`super::ActionVoting`] for a policy that is robust to unequal scales of the values.
#[derive(Debug, Clone, PartialEq)]
pub struct QMdp {
    solution: Solution,
    votes: Votes,
}

impl QMdp {
    /// The policy that follows from a solved model.
    #[must_use]
    pub fn new(solution: Solution) -> Self {
        let votes = Votes::new(&solution);
        Self { solution, votes }
    }
}

impl Policy for QMdp {
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        for (action, value) in values.iter_mut().enumerate() {
            *value = belief
                .iter()
                .zip(self.solution.q_of(action))
                .map(|(b, q)| b * q)
                .sum();
        }
        choose(values, self.votes.count(belief))
    }
}
