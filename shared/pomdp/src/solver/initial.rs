//! The bounds that a search begins with.

use super::report::{Bracket, SearchResult};
use crate::alpha_vectors::AlphaVectors;
use crate::bounds::tib::{self, Tib};
use crate::bounds::{ActionValues, SolveError, blind, fib, mdp};
use crate::budget::Budget;
use crate::model::{Pomdp, SUM_TOLERANCE};
use crate::sparse_beliefs::MERGED;

/// What the budget allowed.
#[derive(Debug)]
pub(super) struct Initial {
    pub blind: Option<ActionValues>,
    pub fast: Option<ActionValues>,
    pub tighter: Option<Tib>,
}

impl Initial {
    pub(super) fn new(model: &Pomdp, budget: &mut Budget<'_>) -> Result<Self, SolveError> {
        let blind = in_time(blind::solve(model, budget))?;
        let fast = in_time(fib::solve(model, budget))?;
        let tighter = match &fast {
            None => None,
            Some(fast) => match tib::solve_from(model, fast, budget) {
                // Too large for it: the fast informed bound must do.
                Err(SolveError::Entries(_)) => None,
                found => in_time(found)?,
            },
        };
        Ok(Self {
            blind,
            fast,
            tighter,
        })
    }

    /// Narrows the bracket by the blind and the fast bound, and keeps the blind policy's vectors.
    /// The tighter bound works in the tree ([`Self::corners`]).
    pub(super) fn narrow(&self, model: &Pomdp, found: &mut SearchResult) {
        let actions = model.actions().len();
        if let Some(blind) = &self.blind {
            found.bracket.lower = found.bracket.lower.max(blind.value(model.start()));
            let rows = blind.rows().enumerate();
            found.vectors = AlphaVectors::new(model.states().len(), actions, rows).ok();
        }
        if let Some(fast) = &self.fast {
            found.bracket.upper = found.bracket.upper.min(fast.value(model.start()));
        }
    }

    /// Upper bounds where the state is certain.
    pub(super) fn corners(&self, states: usize) -> Vec<f64> {
        let corner = |s: usize| {
            let fast = self.fast.iter().flat_map(ActionValues::rows).map(|q| q[s]);
            let fast = fast.fold(f64::NEG_INFINITY, f64::max);
            let tighter = self
                .tighter
                .iter()
                .map(|tib| tib.value_sparse(&[(s as u32, 1.0)]));
            tighter.fold(fast, f64::min)
        };
        (0..states).map(corner).collect()
    }

    /// What rounding, and the merging of beliefs that differ by no more, may amount to; `lower` is
    /// a lower bound at the start belief.
    pub(super) fn rounding(
        &self,
        model: &Pomdp,
        lower: f64,
        budget: &mut Budget<'_>,
    ) -> Result<f64, SolveError> {
        let bounds = self.blind.iter().chain(&self.fast);
        let values = bounds.flat_map(ActionValues::rows).flatten();
        let largest = values.fold(0.0_f64, |m, v| m.max(v.abs()));
        let steps = if model.discount() < 1.0 {
            1.0 / (1.0 - model.discount())
        } else {
            mdp::steps_max(model, lower, budget)?
        };
        Ok(MERGED * largest * steps)
    }
}

fn in_time<T>(found: Result<T, SolveError>) -> Result<Option<T>, SolveError> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(SolveError::Stopped) => Ok(None),
        Err(error) => Err(error),
    }
}

/// The largest expected reward of one step, by size.
pub(super) fn largest_reward(model: &Pomdp) -> f64 {
    let states = 0..model.states().len();
    let rewards = states.flat_map(|s| (0..model.actions().len()).map(move |a| model.reward(s, a)));
    rewards.fold(0.0, |most, reward| most.max(reward.abs()))
}

/// The least and the largest reward for ever.
pub(super) fn trivial(model: &Pomdp) -> Bracket {
    let states = 0..model.states().len();
    let rewards = states.flat_map(|s| (0..model.actions().len()).map(move |a| model.reward(s, a)));
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for reward in rewards {
        least = least.min(reward);
        most = most.max(reward);
    }
    // Mass that is gained or lost in a step, whichever makes the bracket wider: a row of T and one
    // of Z may each be off, and their product by a little more than the sum.
    let for_ever = |reward: f64, outward: f64| {
        let sign = outward * reward.signum();
        let discount = model.discount() * (1.0 + sign * 2.1 * SUM_TOLERANCE);
        if discount < 1.0 {
            reward / (1.0 - discount)
        } else {
            outward * f64::INFINITY
        }
    };
    Bracket {
        lower: for_ever(least, -1.0),
        upper: for_ever(most, 1.0),
    }
}
