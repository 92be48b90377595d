//! The policy of the fast informed bound (Hauskrecht 2000).

use super::{Choice, Policy, Votes, choose};
use crate::bounds::ActionValues;

/// argmax_a b . q_a, where q_a(s) is the fast informed bound of taking `a` in `s`. Unlike
/// [`super::QMdp`] it does not take for granted that all becomes observable after one step; like
/// it, it values no information for its own sake.
#[derive(Debug, Clone, PartialEq)]
pub struct FastInformed {
    q: ActionValues,
    votes: Votes,
}

impl FastInformed {
    /// The policy that follows from the bound's values ([`crate::bounds::fib`]).
    #[must_use]
    pub fn new(q: ActionValues) -> Self {
        let best = |s: usize| {
            let values: Vec<f64> = q.rows().map(|row| row[s]).collect();
            choose(&values, &[]).action
        };
        let best = (0..q.states()).map(best).collect();
        let votes = Votes::by_states(best, q.rows().len());
        Self { q, votes }
    }
}

impl Policy for FastInformed {
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        for (value, q) in values.iter_mut().zip(self.q.rows()) {
            *value = belief.iter().zip(q).map(|(b, q)| b * q).sum();
        }
        choose(values, self.votes.count(belief))
    }
}
