//! Fixed points of informed bounds, by policy iteration.
//!
//! Over a set E of beliefs: Q(e,a) = R(e,a) + gamma sum_o max_a' sum_j w(e,a,o,j) Q(j,a'), where
//! w(e,a,o,.) writes the unnormalised belief after (a,o) as a mixture of E. As V* is convex, the
//! fixed point is an upper bound whenever these mixtures are right. E = corners gives the fast
//! informed bound, E = beliefs one step from the corners the tighter informed bound.

use super::linear::{Rows, System, largest};
use super::{SolveError, contraction, rounding, slacks};
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
    /// Whether (e,a) may end at a goal.
    may_end: Vec<bool>,
}

/// What a step of policy iteration counts: with discount 1 also a bonus.
struct Step {
    discount: f64,
    bonus: f64,
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
    pub(super) fn end_pair(&mut self, count: usize, reward: f64, may_end: bool) {
        self.may_end.push(may_end);
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
        let mut held = vec![0; self.ends.last().copied().unwrap_or(0)];
        let step = Step {
            discount,
            bonus: 0.0,
        };
        self.choose(&mut held, &q, 0.0, budget)?;
        q = self.improve(q, &mut held, &step, budget)?;
        if discount < 1.0 {
            return self.certify(q, &held, discount, budget);
        }
        let longest = (0..self.rewards.len()).map(|pair| self.terms(pair)).max();
        let error = rounding(longest.unwrap_or(0));
        let scale = largest(&q);
        for slack in slacks(discount, error) {
            let step = Step {
                discount,
                bonus: slack * scale,
            };
            q = self.improve(q, &mut held, &step, budget)?;
            if self.is_above(&q, &held, error * largest(&q), budget)? {
                return Ok(q);
            }
        }
        Err(SolveError::Unbounded(discount))
    }

    /// Takes the best a' of every row; true if one has changed.
    fn choose(
        &self,
        held: &mut [usize],
        q: &[f64],
        margin: f64,
        budget: &mut Budget<'_>,
    ) -> Result<bool, SolveError> {
        let mut is_changed = false;
        for (row, held) in held.iter_mut().enumerate() {
            budget.spend(self.rows.row(row).len() * self.actions)?;
            let action = self.best(row, *held, q, margin).0;
            is_changed |= action != *held;
            *held = action;
        }
        Ok(is_changed)
    }

    /// Policy iteration, from the choices that are held.
    fn improve(
        &self,
        mut q: Vec<f64>,
        held: &mut [usize],
        step: &Step,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<f64>, SolveError> {
        let rewards: Vec<f64> = (0..self.rewards.len())
            .map(|pair| match self.rows_of(pair).is_empty() {
                true => self.rewards[pair],
                false => self.rewards[pair] + step.bonus,
            })
            .collect();
        for _ in 0..ROUNDS_MAX {
            if step.discount >= 1.0 {
                self.mend(held, budget)?;
            }
            let mut rows = Rows::default();
            for pair in 0..self.rewards.len() {
                for row in self.rows_of(pair) {
                    for (j, w) in self.rows.row(row) {
                        rows.push(*j as usize * self.actions + held[row], *w);
                    }
                }
                rows.end_row();
            }
            let system = System {
                rows: &rows,
                right: &rewards,
                discount: step.discount,
            };
            q = system.solve_roughly(q, budget)?;
            let margin = IMPROVEMENT_MIN * largest(&q);
            if !self.choose(held, &q, margin, budget)? {
                break;
            }
        }
        Ok(q)
    }

    /// With discount 1, lets every pair end: rows from which the choices that are held never get
    /// to a goal take one that gets nearer. So a policy is proper.
    fn mend(&self, held: &mut [usize], budget: &mut Budget<'_>) -> Result<(), SolveError> {
        let mut ends = self.may_end.clone();
        for is_held in [true, false] {
            let mut is_changed = true;
            while std::mem::take(&mut is_changed) {
                for pair in (0..ends.len()).rev().filter(|pair| !self.may_end[*pair]) {
                    if ends[pair] {
                        continue;
                    }
                    budget.spend(self.terms(pair))?;
                    let found = self.rows_of(pair).find_map(|row| {
                        let mut actions = 0..self.actions;
                        let action = actions.find(|action| {
                            (!is_held || *action == held[row]) && self.gets_on(row, *action, &ends)
                        });
                        action.map(|action| (row, action))
                    });
                    if let Some((row, action)) = found {
                        held[row] = action;
                        ends[pair] = true;
                        is_changed = true;
                    }
                }
            }
        }
        Ok(())
    }

    /// True if an action after a row may lead to a pair that ends.
    fn gets_on(&self, row: usize, action: usize, ends: &[bool]) -> bool {
        let mut next = self.rows.row(row).iter();
        next.any(|(j, _)| ends[*j as usize * self.actions + action])
    }

    /// Terms of the backup of a pair.
    fn terms(&self, pair: usize) -> usize {
        self.rows_of(pair).map(|row| self.rows.row(row).len()).sum()
    }

    /// True if no backup exceeds Q, to which it may be off by `error`.
    fn is_above(
        &self,
        q: &[f64],
        held: &[usize],
        error: f64,
        budget: &mut Budget<'_>,
    ) -> Result<bool, SolveError> {
        for pair in (0..self.rewards.len()).filter(|pair| !self.rows_of(*pair).is_empty()) {
            budget.spend(self.terms(pair) * self.actions)?;
            let next = self
                .rows_of(pair)
                .map(|row| self.best(row, held[row], q, 0.0).1);
            if self.rewards[pair] + next.sum::<f64>() + error > q[pair] {
                return Ok(false);
            }
        }
        Ok(true)
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
