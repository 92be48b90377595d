//! The fully observable relaxation: Q_CO(s,a) by value iteration, finished by policy iteration.
//!
//! V(s) = max_a [R(s,a) + gamma sum_s' T(s,a,s') V(s')]. Value iteration alone is hopeless for a
//! discount near 1; policy iteration is exact in a few rounds. With discount 1 it begins with a
//! proper policy, and with any discount below by value iteration.

pub use super::SolveError;
use super::linear::{Rows, System, largest};
use super::{contraction, proper, rounding, slacks};
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

/// Times that a pay for each step is quartered until no policy gains by never ending.
#[cfg(feature = "solver")]
const PAYS: usize = 40;

/// Q_CO and what follows from it, in units of reward.
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

    /// Q_CO(.,a), one value a state.
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
/// [`SolveError::Unbounded`] and [`SolveError::Mass`] for values without bound; with discount 1
/// what the model lacks for a goal problem; [`SolveError::Size`] for a system that is neither
/// solved by iteration nor small.
pub fn solve(model: &Pomdp) -> Result<Solution, SolveError> {
    solve_within(model, &mut Budget::new(&mut || false))
}

/// As [`solve`], within a budget.
///
/// # Errors
/// As of [`solve`], and [`SolveError::Stopped`] if the budget ends.
pub fn solve_within(model: &Pomdp, budget: &mut Budget<'_>) -> Result<Solution, SolveError> {
    let n = model.states().len();
    let (mass_max, longest) = rows(model);
    let discount = model.discount();
    let mut value = vec![0.0; n];
    let (policy, factor) = if discount < 1.0 {
        let factor = contraction(discount, mass_max)?;
        value = sweeps(model, value, budget)?;
        ((0..n).map(|s| best(model, &value, s)).collect(), factor)
    } else {
        (proper::shortest(model)?, 1.0)
    };
    let (policy, value) = improved(model, 0.0, policy, value, budget)?;
    let q: Vec<f64> = (0..model.actions().len())
        .flat_map(|a| (0..n).map(move |s| (a, s)))
        .map(|(a, s)| backup(model, &value, s, a))
        .collect();
    // An action that no policy takes may still have a reward beyond all bounds.
    if q.iter().any(|q| !q.is_finite()) {
        return Err(SolveError::Unbounded(discount));
    }
    let error = if discount < 1.0 {
        // One backup more, V + excess / (1 - factor) is above its own backup.
        (excess(model, &value) + rounding(longest) * largest(&q)) / (1.0 - factor)
    } else {
        goal_error(model, longest, policy, &value, budget)?
    };
    let policy = (0..n).map(|s| lowest_best(&q, n, s)).collect();
    Ok(Solution {
        states: n,
        q,
        policy,
        error,
    })
}

/// Value iteration.
fn sweeps(
    model: &Pomdp,
    mut value: Vec<f64>,
    budget: &mut Budget<'_>,
) -> Result<Vec<f64>, SolveError> {
    let n = value.len();
    let sweep = (0..model.actions().len())
        .flat_map(|a| (0..n).map(move |s| model.moves(s, a).len()))
        .sum();
    for _ in 0..SWEEPS {
        budget.spend(sweep)?;
        let next: Vec<f64> = (0..n)
            .map(|s| backup(model, &value, s, best(model, &value, s)))
            .collect();
        value = next;
    }
    Ok(value)
}

/// Policy iteration, with a `bonus` for each step outside the goals. With discount 1 the policy
/// that it begins with is proper.
fn improved(
    model: &Pomdp,
    bonus: f64,
    mut policy: Vec<usize>,
    mut value: Vec<f64>,
    budget: &mut Budget<'_>,
) -> Result<(Vec<usize>, Vec<f64>), SolveError> {
    for _ in 0..ROUNDS_MAX {
        value = evaluate(model, &policy, bonus, value, budget)?;
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
        if model.discount() >= 1.0 {
            proper::check(model, &policy)?;
        }
    }
    Ok((policy, value))
}

/// What a value falls short of its best backup by, at most.
fn excess(model: &Pomdp, value: &[f64]) -> f64 {
    value.iter().enumerate().fold(0.0_f64, |most, (s, v)| {
        most.max(backup(model, value, s, best(model, value, s)) - v)
    })
}

/// What the true values may exceed `value` by, with discount 1: the difference to values with a
/// bonus for each step that is larger than what rounding may amount to, as these are certainly no
/// less than their backup. That no policy gains by never ending is found out on the way.
fn goal_error(
    model: &Pomdp,
    longest: usize,
    policy: Vec<usize>,
    value: &[f64],
    budget: &mut Budget<'_>,
) -> Result<f64, SolveError> {
    let scale = value.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
    let bonus = 4.0 * (IMPROVEMENT_MIN + rounding(longest)) * scale;
    let (policy, outer) = improved(model, bonus, policy, value.to_vec(), budget)?;
    let is_above = |above: &[f64]| {
        let error = rounding(longest) * largest(above);
        above.iter().enumerate().all(|(s, v)| {
            model.is_goal(s) || backup(model, above, s, best(model, above, s)) + error <= *v
        })
    };
    // The least that is enough.
    for bonus in slacks(model.discount(), rounding(longest)).map(|slack| slack * scale) {
        let above = evaluate(model, &policy, bonus, outer.clone(), budget)?;
        if is_above(&above) {
            let differences = above.iter().zip(value).map(|(above, v)| above - v);
            return Ok(differences.fold(0.0, f64::max));
        }
    }
    Err(SolveError::Unbounded(model.discount()))
}

/// The most steps that a policy needs which earns at least `lower` at the start belief, about; with
/// discount 1.
#[cfg(feature = "solver")]
pub(crate) fn steps_max(
    model: &Pomdp,
    lower: f64,
    budget: &mut Budget<'_>,
) -> Result<f64, SolveError> {
    let rewards = (0..model.states().len())
        .flat_map(|s| (0..model.actions().len()).map(move |a| model.reward(s, a)));
    let mut pay = 0.5 * rewards.fold(0.0_f64, |most, reward| most.max(reward.abs()));
    let policy = proper::shortest(model)?;
    for _ in 0..PAYS {
        match improved(model, pay, policy.clone(), vec![0.0; policy.len()], budget) {
            Ok((_, value)) => {
                let most: f64 = value.iter().zip(model.start()).map(|(v, b)| v * b).sum();
                return Ok(((most - lower) / pay).max(1.0));
            }
            Err(SolveError::Stopped) => return Err(SolveError::Stopped),
            // So much pays for never ending.
            Err(_) => pay /= 4.0,
        }
    }
    Err(SolveError::Unbounded(model.discount()))
}

/// Largest sum of a row of T, and most entries of one.
fn rows(model: &Pomdp) -> (f64, usize) {
    let rows = (0..model.actions().len())
        .flat_map(|a| (0..model.states().len()).map(move |s| model.moves(s, a)));
    rows.fold((0.0, 0), |(sum_max, longest), row| {
        let sum: f64 = row.iter().map(|(_, p)| p).sum();
        (f64::max(sum_max, sum), usize::max(longest, row.len()))
    })
}

/// R(s,a) + gamma E V(s').
fn backup(model: &Pomdp, value: &[f64], s: usize, a: usize) -> f64 {
    let next: f64 = model.moves(s, a).iter().map(|(to, p)| p * value[*to]).sum();
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
    bonus: f64,
    guess: Vec<f64>,
    budget: &mut Budget<'_>,
) -> Result<Vec<f64>, SolveError> {
    let mut rows = Rows::default();
    let mut right = Vec::with_capacity(policy.len());
    for (s, &a) in policy.iter().enumerate() {
        for (to, p) in model.moves(s, a) {
            rows.push(*to, *p);
        }
        rows.end_row();
        let bonus = if model.is_goal(s) { 0.0 } else { bonus };
        right.push(model.reward(s, a) + bonus);
    }
    let system = System {
        rows: &rows,
        right: &right,
        discount: model.discount(),
    };
    if model.discount() < 1.0 {
        system.solve(guess, budget)
    } else {
        system.solve_roughly(guess, budget)
    }
}
