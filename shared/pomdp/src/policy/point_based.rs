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
    shown: Option<Shown>,
}

/// What some actions show for certain: a part of the state.
#[derive(Debug, Clone, PartialEq)]
struct Shown {
    /// The states of each part.
    parts: Vec<Vec<usize>>,
    /// Whether each action shows the part.
    by_action: Vec<bool>,
    /// alpha·b of each vector, of one part.
    worth: Vec<f64>,
    /// What each action is worth in one part, and in all so far.
    best: Vec<f64>,
    sum: Vec<f64>,
}

impl PointBased {
    /// Multiplications of a decision beyond which a cycle has no time for it; some 20 us.
    pub const PRODUCTS_MAX: usize = 40_000;

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
            shown: None,
            votes: Votes::by_states(best, model.actions().len()),
            actions,
        })
    }

    /// The same policy where a part of the state becomes known from outside the model's
    /// observations, as long as certain actions last: what a fault is, while the robot drives.
    /// `part_of` is each state's part, and `shows` says of each action whether it shows the part.
    /// Such an action is worth sum_p max_alpha alpha·b_p, with b_p the belief within part p: after
    /// it each part is answered by a plan of its own. The others are worth max_alpha alpha·b, so
    /// that a robot that stands does not count on what it will not be shown.
    ///
    /// # Panics
    /// If there is not one part for each state and one answer for each action.
    #[must_use]
    pub fn shown(mut self, part_of: &[usize], shows: &[bool]) -> Self {
        let actions = shows.len();
        assert_eq!(
            part_of.len() * self.actions.len(),
            self.columns.len(),
            "each state has a part"
        );
        assert!(
            self.actions.iter().all(|action| *action < actions),
            "each action shows the part or does not"
        );
        let count = part_of.iter().max().map_or(0, |last| last + 1);
        let mut parts = vec![Vec::new(); count];
        for (state, part) in part_of.iter().enumerate() {
            parts[*part].push(state);
        }
        self.shown = Some(Shown {
            parts,
            by_action: shows.to_vec(),
            worth: vec![0.0; self.actions.len()],
            best: vec![0.0; actions],
            sum: vec![0.0; actions],
        });
        self
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
        if let Some(shown) = &mut self.shown {
            shown.sum.fill(0.0);
            for states in &shown.parts {
                shown.worth.fill(0.0);
                let mut is_possible = false;
                for &state in states {
                    let b = belief.get(state).copied().unwrap_or(0.0);
                    is_possible |= b > 0.0;
                    add(&mut shown.worth, b, &self.columns, state);
                }
                if !is_possible {
                    continue;
                }
                best(&self.actions, &shown.worth, &mut shown.best);
                let parts = self.worth.iter_mut().zip(&shown.worth);
                parts.for_each(|(sum, worth)| *sum += worth);
                let parts = shown.sum.iter_mut().zip(&shown.best);
                parts.for_each(|(sum, best)| *sum += best);
            }
        } else {
            for (state, b) in belief.iter().enumerate() {
                add(&mut self.worth, *b, &self.columns, state);
            }
        }
        best(&self.actions, &self.worth, values);
        if let Some(shown) = &self.shown {
            let sums = values.iter_mut().zip(&shown.sum).zip(&shown.by_action);
            for ((value, sum), _) in sums.filter(|(_, shows)| **shows) {
                *value = *sum;
            }
        }
        choose(values, self.votes.count(belief))
    }
}

/// Adds b times the values of all vectors in a state.
fn add(worth: &mut [f64], b: f64, columns: &[f64], state: usize) {
    if b > 0.0 {
        let column = columns.chunks_exact(worth.len()).nth(state);
        let values = column.into_iter().flatten();
        worth
            .iter_mut()
            .zip(values)
            .for_each(|(worth, value)| *worth += b * value);
    }
}

/// What the best vector of each action is worth.
fn best(actions: &[usize], worth: &[f64], values: &mut [f64]) {
    values.fill(f64::NEG_INFINITY);
    for (action, worth) in actions.iter().zip(worth) {
        if let Some(value) = values.get_mut(*action) {
            *value = value.max(*worth);
        }
    }
}
