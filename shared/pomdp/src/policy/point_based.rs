//! The policy of a point-based solution: begin the plan that is worth most.

use super::completion::completed;
use super::{Choice, Policy, Votes, choose};
use crate::alpha_vectors::{AlphaVectors, VectorError};
use crate::model::Pomdp;

/// The action of argmax_alpha alpha·b.
///
/// The value of an action is that of the best vector which begins with it: what is earned for
/// certain if it is taken now. No look-ahead at decision time, which for every action and
/// observation would go through all vectors: they hold it already, one costs |states| operations,
/// and the guarantee of the lower bound is theirs. A solver drops vectors that begin with an action
/// which is never the best; some are put back ([`PointBased::new`]), as the second best is asked
/// for where the best must wait. Take [`super::QMdp`] or another heuristic when there is no time
/// to solve beforehand.
#[derive(Debug, Clone, PartialEq)]
pub struct PointBased {
    /// Action of each vector.
    actions: Vec<usize>,
    /// Values of all vectors in the first state, then in the second, ...
    columns: Vec<f64>,
    /// alpha·b of each vector.
    worth: Vec<f64>,
    votes: Votes,
}

impl PointBased {
    /// Multiplications of a decision beyond which a cycle has no time for it; some 10 us.
    pub const PRODUCTS_MAX: usize = 20_000;

    /// The policy of these vectors of `model`, and for every action of those that begin with it and
    /// then do as these do, one for each state that is certain and one for the start belief, where
    /// they are better than those that there are.
    ///
    /// # Errors
    /// [`VectorError`] if the vectors are not of this model, or a value is beyond a double.
    pub fn new(model: &Pomdp, vectors: &AlphaVectors) -> Result<Self, VectorError> {
        let vectors = completed(model, vectors)?;
        let (actions, rows): (Vec<usize>, Vec<&[f64]>) = vectors.rows().unzip();
        let column = |s: usize| rows.iter().filter_map(move |row| row.get(s).copied());
        let best = |s: usize| {
            let mut values = vec![f64::NEG_INFINITY; model.actions().len()];
            for (action, value) in actions.iter().zip(column(s)) {
                values[*action] = values[*action].max(value);
            }
            choose(&values, &[]).action
        };
        let best = (0..vectors.states()).map(best).collect();
        Ok(Self {
            columns: (0..vectors.states()).flat_map(column).collect(),
            worth: vec![0.0; actions.len()],
            votes: Votes::by_states(best, model.actions().len()),
            actions,
        })
    }

    /// Multiplications of a decision: vectors times states.
    #[must_use]
    pub const fn products(&self) -> usize {
        self.columns.len()
    }

    /// The action of each vector.
    pub(in crate::policy) fn first_actions(&self) -> &[usize] {
        &self.actions
    }

    /// The values of all vectors in a state.
    pub(in crate::policy) fn column(&self, state: usize) -> &[f64] {
        &self.columns[state * self.actions.len()..][..self.actions.len()]
    }
}

impl Policy for PointBased {
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        self.worth.fill(0.0);
        let columns = self.columns.chunks_exact(self.actions.len());
        for (b, column) in belief.iter().zip(columns).filter(|(b, _)| **b > 0.0) {
            for (worth, value) in self.worth.iter_mut().zip(column) {
                *worth += b * value;
            }
        }
        values.fill(f64::NEG_INFINITY);
        for (action, worth) in self.actions.iter().zip(&self.worth) {
            if let Some(value) = values.get_mut(*action) {
                *value = value.max(*worth);
            }
        }
        choose(values, self.votes.count(belief))
    }
}
