//! Fixed points of informed bounds, by policy iteration.
//!
//! Over a set E of beliefs: Q(e,a) = R(e,a) + gamma sum_o max_a' sum_j w(e,a,o,j) Q(j,a'), where
//! w(e,a,o,.) writes the unnormalised belief after (a,o) as a mixture of E. As V* is convex, the
//! fixed point is an upper bound whenever these mixtures are right. E = corners gives the fast
//! informed bound, E = beliefs one step from the corners the tighter informed bound.

use super::linear::{Rows, System, largest};
use super::{SolveError, contraction, rounding};
use crate::budget::Budget;

/// Largest number of table entries (16 bytes each): 320 MB. Beyond it the bound is refused.
pub(super) const ENTRIES_MAX: usize = 20_000_000;
/// Rounds of policy iteration; one or two are the rule.
const ROUNDS_MAX: usize = 100;
/// A choice must be better by this much, relative to the values, to replace another: rounding must
/// not make policies alternate. It is some 450 times the precision of a double; a much larger one
/// only loosens the bound.
const IMPROVEMENT_MIN: f64 = 1e-13;

/// The mixtures of every (e, a, o).
#[derive(Debug, Clone, Default)]
pub(super) struct Mixtures {
    actions: usize,
    /// One row per (e, a, o) that is possible.
    rows: Rows,
    /// End of the rows of (e, a).
    ends: Vec<usize>,
    /// R(e,a).
    rewards: Vec<f64>,
}

impl Mixtures {
    pub(super) fn new(actions: usize) -> Self {
        Self {
            actions,
            ..Self::default()
        }
    }

    /// The rows being written, for the next (e, a).
    pub(super) fn rows_mut(&mut self) -> &mut Rows {
        &mut self.rows
    }

    /// Ends the rows of (e, a), of which there were `count`.
    pub(super) fn end_pair(&mut self, count: usize, reward: f64) {
        let first = self.ends.last().copied().unwrap_or(0);
        self.ends.push(first + count);
        self.rewards.push(reward);
    }

    fn rows_of(&self, pair: usize) -> std::ops::Range<usize> {
        let first = if pair == 0 { 0 } else { self.ends[pair - 1] };
        first..self.ends[pair]
    }

    /// sum_j w(j) Q(j,a').
    fn mix(&self, row: usize, action: usize, q: &[f64]) -> f64 {
        let terms = self.rows.row(row).iter();
        terms
            .map(|(j, w)| w * q[*j as usize * self.actions + action])
            .sum()
    }

    /// The best a' of a row and its value; `held` stays unless another is clearly better.
    fn best(&self, row: usize, held: usize, q: &[f64], margin: f64) -> (usize, f64) {
        let mut best = (held, self.mix(row, held, q));
        let least = best.1 + margin;
        for action in 0..self.actions {
            let value = self.mix(row, action, q);
            if value > best.1 && value > least {
                best = (action, value);
            }
        }
        best
    }

    /// Q[e·A + a], from the guess `q`, with what is left of the error added: an upper bound of the
    /// fixed point.
    pub(super) fn solve(
        &self,
        mut q: Vec<f64>,
        discount: f64,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<f64>, SolveError> {
        let pairs = self.rewards.len();
        let mut held = vec![0; self.ends.last().copied().unwrap_or(0)];
        for round in 0..ROUNDS_MAX {
            let margin = IMPROVEMENT_MIN * largest(&q) * f64::from(u8::from(round > 0));
            let mut is_changed = round == 0;
            for (row, held) in held.iter_mut().enumerate() {
                budget.spend(self.rows.row(row).len() * self.actions)?;
                let action = self.best(row, *held, &q, margin).0;
                is_changed |= action != *held;
                *held = action;
            }
            if !is_changed {
                break;
            }
            let mut rows = Rows::default();
            for pair in 0..pairs {
                for row in self.rows_of(pair) {
                    for (j, w) in self.rows.row(row) {
                        rows.push(*j as usize * self.actions + held[row], *w);
                    }
                }
                rows.end_row();
            }
            let system = System {
                rows: &rows,
                right: &self.rewards,
                discount,
            };
            q = system.solve_roughly(q, budget)?;
        }
        self.certify(q, &held, discount, budget)
    }

    /// The operator contracts by g = discount times the largest mass: Q plus the largest
    /// (HQ - Q) / (1 - g) is above the fixed point.
    fn certify(
        &self,
        mut q: Vec<f64>,
        held: &[usize],
        discount: f64,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<f64>, SolveError> {
        let (mut excess, mut mass_max, mut longest) = (0.0_f64, 0.0_f64, 0);
        for pair in 0..self.rewards.len() {
            let (mut next, mut mass, mut terms) = (0.0, 0.0, 0);
            for row in self.rows_of(pair) {
                budget.spend(self.rows.row(row).len() * self.actions)?;
                next += self.best(row, held[row], &q, 0.0).1;
                mass += self.rows.row(row).iter().map(|(_, w)| w).sum::<f64>();
                terms += self.rows.row(row).len();
            }
            excess = excess.max(self.rewards[pair] + discount * next - q[pair]);
            mass_max = mass_max.max(mass);
            longest = longest.max(terms);
        }
        let excess = excess + rounding(longest) * largest(&q);
        let error = excess / (1.0 - contraction(discount, mass_max)?);
        if !error.is_finite() {
            return Err(SolveError::Unbounded(discount));
        }
        q.iter_mut().for_each(|q| *q += error);
        Ok(q)
    }
}
