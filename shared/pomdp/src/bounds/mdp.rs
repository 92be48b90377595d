//! The fully observable relaxation: Q_CO(s,a) by value iteration, finished by policy iteration.
//!
//! V(s) = max_a [R(s,a) + gamma sum_s' T(s,a,s') V(s')]. Value iteration alone is hopeless for a
//! discount near 1; policy iteration is exact in a few rounds.

pub use super::SolveError;
use super::linear::{Rows, System, largest};
use super::{contraction, rounding};
use crate::budget::Budget;
use crate::model::Pomdp;

/// Sweeps of value iteration that prepare policy iteration. They decide the time alone: a better
/// start saves rounds, each of which solves a linear system.
const SWEEPS: usize = 200;
/// Rounds of policy iteration; each improves the policy, and there are finitely many.
const ROUNDS_MAX: usize = 1000;
/// An action must be better by this much, relative to the values, to replace another: rounding must
/// not make policies alternate. It is some 4500 times the precision of a double; a much larger one
/// only loosens the bound.
const IMPROVEMENT_MIN: f64 = 1e-12;

/// Q_CO and what follows from it.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    states: usize,
    /// Q[a][s].
    q: Vec<f64>,
    policy: Vec<usize>,
    error: f64,
}

impl Solution {
    /// How many states.
    #[must_use]
    pub const fn states(&self) -> usize {
        self.states
    }

    /// How many actions.
    #[must_use]
    pub fn actions(&self) -> usize {
        self.q.len() / self.states.max(1)
    }

    /// Q_CO(s,a).
    #[must_use]
    pub fn q(&self, state: usize, action: usize) -> f64 {
        self.q[action * self.states + state]
    }

    /// Q_CO(.,a) for every state.
    #[must_use]
    pub fn q_of(&self, action: usize) -> &[f64] {
        &self.q[action * self.states..][..self.states]
    }

    /// The best action in `state`; ties within 1e-9 (relative to the largest value) go to the
    /// lowest index.
    #[must_use]
    pub fn best(&self, state: usize) -> usize {
        self.policy[state]
    }

    /// What the true values may exceed these by: they are at most [`Self::q`] and [`Self::value`]
    /// plus this.
    #[must_use]
    pub const fn error(&self) -> f64 {
        self.error
    }

    /// V_CO(s) = max_a Q_CO(s,a).
    #[must_use]
    pub fn value(&self, state: usize) -> f64 {
        let of_state = self.q.iter().skip(state).step_by(self.states);
        of_state.copied().fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Solves the fully observable relaxation of `model`.
///
/// # Errors
/// [`SolveError`].
pub fn solve(model: &Pomdp) -> Result<Solution, SolveError> {
    solve_within(model, &mut Budget::new(&mut || false))
}

/// As [`solve`], within a budget.
///
/// # Errors
/// [`SolveError`].
pub fn solve_within(model: &Pomdp, budget: &mut Budget<'_>) -> Result<Solution, SolveError> {
    let n = model.states().len();
    let (mass_max, longest) = rows(model);
    let factor = contraction(model.discount(), mass_max)?;
    let mut value = vec![0.0; n];
    let sweep = (0..model.actions().len())
        .flat_map(|a| (0..n).map(move |s| model.successors(s, a).len()))
        .sum();
    for _ in 0..SWEEPS {
        budget.spend(sweep)?;
        let next: Vec<f64> = (0..n)
            .map(|s| backup(model, &value, s, best(model, &value, s)))
            .collect();
        value = next;
    }
    let mut policy: Vec<usize> = (0..n).map(|s| best(model, &value, s)).collect();
    for _ in 0..ROUNDS_MAX {
        value = evaluate(model, &policy, value, budget)?;
        let scale = value.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
        let mut changed = false;
        for (s, action) in policy.iter_mut().enumerate() {
            let candidate = best(model, &value, s);
            let gain = backup(model, &value, s, candidate) - backup(model, &value, s, *action);
            if gain > IMPROVEMENT_MIN * scale {
                *action = candidate;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    let q: Vec<f64> = (0..model.actions().len())
        .flat_map(|a| (0..n).map(move |s| (a, s)))
        .map(|(a, s)| backup(model, &value, s, a))
        .collect();
    // An action that no policy takes may still have a reward beyond all bounds.
    if q.iter().any(|q| !q.is_finite()) {
        return Err(SolveError::Unbounded(model.discount()));
    }
    // One backup more, V + excess / (1 - factor) is above its own backup.
    let excess = (0..n).fold(0.0_f64, |most, s| {
        let best = best(model, &value, s);
        most.max(q[best * n + s] - value[s])
    });
    let excess = excess + rounding(longest) * largest(&q);
    let policy = (0..n).map(|s| lowest_best(&q, n, s)).collect();
    Ok(Solution {
        states: n,
        q,
        policy,
        error: excess / (1.0 - factor),
    })
}

/// Largest sum of a row of T, and most entries of one.
fn rows(model: &Pomdp) -> (f64, usize) {
    let rows = (0..model.actions().len())
        .flat_map(|a| (0..model.states().len()).map(move |s| model.successors(s, a)));
    rows.fold((0.0, 0), |(sum_max, longest), row| {
        let sum: f64 = row.iter().map(|(_, p)| p).sum();
        (f64::max(sum_max, sum), usize::max(longest, row.len()))
    })
}

/// R(s,a) + gamma E V(s').
fn backup(model: &Pomdp, value: &[f64], s: usize, a: usize) -> f64 {
    let next: f64 = model
        .successors(s, a)
        .iter()
        .map(|(to, p)| p * value[*to])
        .sum();
    model.reward(s, a) + model.discount() * next
}

fn best(model: &Pomdp, value: &[f64], s: usize) -> usize {
    let mut best = (0, f64::NEG_INFINITY);
    for a in 0..model.actions().len() {
        let q = backup(model, value, s, a);
        if q > best.1 {
            best = (a, q);
        }
    }
    best.0
}

fn lowest_best(q: &[f64], states: usize, s: usize) -> usize {
    let of = |a: usize| q[a * states + s];
    let actions = q.len() / states;
    let max = (0..actions).map(of).fold(f64::NEG_INFINITY, f64::max);
    let scale = q.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
    (0..actions)
        .find(|&a| of(a) >= max - 1e-9 * scale)
        .unwrap_or(0)
}

/// Value of a policy: V = R + gamma T V.
fn evaluate(
    model: &Pomdp,
    policy: &[usize],
    guess: Vec<f64>,
    budget: &mut Budget<'_>,
) -> Result<Vec<f64>, SolveError> {
    let mut rows = Rows::default();
    let mut right = Vec::with_capacity(policy.len());
    for (s, &a) in policy.iter().enumerate() {
        for (to, p) in model.successors(s, a) {
            rows.push(*to, *p);
        }
        rows.end_row();
        right.push(model.reward(s, a));
    }
    let system = System {
        rows: &rows,
        right: &right,
        discount: model.discount(),
    };
    system.solve(guess, budget)
}
