//! The fully observable relaxation: Q_CO(s,a) by value iteration, finished by policy iteration.
//!
//! V(s) = max_a [R(s,a) + gamma sum_s' T(s,a,s') V(s')]. Value iteration alone is hopeless for a
//! discount near 1; policy iteration is exact in a few rounds.

use crate::model::Pomdp;

/// Sweeps of value iteration that prepare policy iteration.
const SWEEPS: usize = 200;
/// Rounds of policy iteration; each improves the policy, and there are finitely many.
const ROUNDS_MAX: usize = 1000;
/// Largest number of states for the dense linear solve.
const STATES_MAX: usize = 4000;
/// An action must be better by this much, relative to the values, to replace another.
const IMPROVEMENT_MIN: f64 = 1e-12;

/// Why a model could not be solved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// The values are unbounded, or the equations singular: a discount of 1 without an end, or
    /// rewards too large for a double.
    #[error(
        "the values are not bounded with discount {0}: allowed is a discount below 1, or policies \
         that come to an end, and rewards whose sums are finite"
    )]
    Unbounded(f64),
    /// Too many states for the dense solve.
    #[error("{0} states, allowed are {STATES_MAX}")]
    Size(usize),
}

/// Q_CO and what follows from it.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    states: usize,
    /// Q[a][s].
    q: Vec<f64>,
    policy: Vec<usize>,
}

impl Solution {
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

    /// V_CO(s) = max_a Q_CO(s,a).
    #[must_use]
    pub fn value(&self, state: usize) -> f64 {
        self.q(state, self.policy[state])
    }
}

/// Solves the fully observable relaxation of `model`.
///
/// # Errors
/// [`SolveError`].
pub fn solve(model: &Pomdp) -> Result<Solution, SolveError> {
    let n = model.states().len();
    if n > STATES_MAX {
        return Err(SolveError::Size(n));
    }
    let mut value = vec![0.0; n];
    for _ in 0..SWEEPS {
        let next: Vec<f64> = (0..n)
            .map(|s| backup(model, &value, s, best(model, &value, s)))
            .collect();
        value = next;
    }
    let mut policy: Vec<usize> = (0..n).map(|s| best(model, &value, s)).collect();
    for _ in 0..ROUNDS_MAX {
        value = evaluate(model, &policy).ok_or(SolveError::Unbounded(model.discount()))?;
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
    let policy = (0..n).map(|s| lowest_best(&q, n, s)).collect();
    Ok(Solution {
        states: n,
        q,
        policy,
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

/// Value of a policy: (I - gamma T) V = R, by Gauss elimination with partial pivoting, and one
/// step of iterative refinement.
fn evaluate(model: &Pomdp, policy: &[usize]) -> Option<Vec<f64>> {
    let n = policy.len();
    let mut matrix = vec![0.0; n * n];
    for (s, &a) in policy.iter().enumerate() {
        matrix[s * n + s] += 1.0;
        for (to, p) in model.successors(s, a) {
            matrix[s * n + to] -= model.discount() * p;
        }
    }
    let factors = Factors::new(matrix, n)?;
    let right: Vec<f64> = policy
        .iter()
        .enumerate()
        .map(|(s, &a)| model.reward(s, a))
        .collect();
    let mut value = factors.solve(&right);
    let residual: Vec<f64> = (0..n)
        .map(|s| backup(model, &value, s, policy[s]) - value[s])
        .collect();
    for (v, correction) in value.iter_mut().zip(factors.solve(&residual)) {
        *v += correction;
    }
    value.iter().all(|v| v.is_finite()).then_some(value)
}

/// LU factors with row exchanges.
struct Factors {
    n: usize,
    lu: Vec<f64>,
    order: Vec<usize>,
}

impl Factors {
    fn new(mut lu: Vec<f64>, n: usize) -> Option<Self> {
        let mut order: Vec<usize> = (0..n).collect();
        for column in 0..n {
            let size = |row: &usize| lu[row * n + column].abs();
            let pivot = (column..n).max_by(|a, b| size(a).total_cmp(&size(b)))?;
            if lu[pivot * n + column].abs() < 1e-14 {
                return None;
            }
            if pivot != column {
                for k in 0..n {
                    lu.swap(pivot * n + k, column * n + k);
                }
                order.swap(pivot, column);
            }
            for row in column + 1..n {
                let factor = lu[row * n + column] / lu[column * n + column];
                if factor != 0.0 {
                    lu[row * n + column] = factor;
                    for k in column + 1..n {
                        lu[row * n + k] -= factor * lu[column * n + k];
                    }
                }
            }
        }
        Some(Self { n, lu, order })
    }

    fn solve(&self, right: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut x: Vec<f64> = self.order.iter().map(|&row| right[row]).collect();
        for row in 0..n {
            let sum: f64 = (0..row).map(|k| self.lu[row * n + k] * x[k]).sum();
            x[row] -= sum;
        }
        for row in (0..n).rev() {
            let sum: f64 = (row + 1..n).map(|k| self.lu[row * n + k] * x[k]).sum();
            x[row] = (x[row] - sum) / self.lu[row * n + row];
        }
        x
    }
}
