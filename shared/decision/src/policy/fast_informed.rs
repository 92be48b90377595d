//! The policy of the fast informed bound (Hauskrecht 2000).

use super::{Choice, Policy, choose};
use crate::mdp::Solution;
use crate::model::Pomdp;

/// Sweeps after which the iteration ends in any case; every iterate is an upper bound.
const SWEEPS_MAX: usize = 20_000;
/// The iteration ends when no value moves by more than this, relative to the largest.
const MOVE_MIN: f64 = 1e-13;

/// argmax_a b . q_a, where q_a(s) is the fast informed bound of taking `a` in `s`. Unlike
/// [`super::QMdp`] it does not take for granted that all becomes observable after one step; like
/// it, it values no information for its own sake.
#[derive(Debug, Clone, PartialEq)]
pub struct FastInformed {
    /// q[a][s].
    q: Vec<Vec<f64>>,
}

impl FastInformed {
    /// The policy that follows from `q[a][s]`, one row an action.
    #[must_use]
    pub const fn new(q: Vec<Vec<f64>>) -> Self {
        Self { q }
    }
}

impl Policy for FastInformed {
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        for (value, q) in values.iter_mut().zip(&self.q) {
            *value = belief.iter().zip(q).map(|(b, q)| b * q).sum();
        }
        choose(values)
    }
}

/// q[a][s] of the fast informed bound, from Q_CO downwards:
/// q_a(s) = R(s,a) + gamma sum_z max_a' sum_s' T(s,a,s') Z(a,s',z) q_a'(s').
#[must_use]
pub fn informed_values(model: &Pomdp, solution: &Solution) -> Vec<Vec<f64>> {
    let actions = model.actions().len();
    let mut q: Vec<Vec<f64>> = (0..actions).map(|a| solution.q_of(a).to_vec()).collect();
    let scale = q.iter().flatten().fold(1.0_f64, |m, v| m.max(v.abs()));
    for _ in 0..SWEEPS_MAX {
        let mut moved = 0.0_f64;
        let next: Vec<Vec<f64>> = (0..actions)
            .map(|a| {
                (0..model.states().len())
                    .map(|s| informed_backup(model, &q, s, a))
                    .collect()
            })
            .collect();
        for (new, old) in next.iter().flatten().zip(q.iter().flatten()) {
            moved = moved.max((new - old).abs());
        }
        q = next;
        if moved <= MOVE_MIN * scale {
            break;
        }
    }
    q
}

fn informed_backup(model: &Pomdp, q: &[Vec<f64>], s: usize, a: usize) -> f64 {
    let mut next = 0.0;
    for z in 0..model.observations().len() {
        let likelihood = model.likelihood(a, z);
        let of = |q: &Vec<f64>| -> f64 {
            let successors = model.successors(s, a).iter();
            successors.map(|(to, p)| p * likelihood[*to] * q[*to]).sum()
        };
        next += q.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
    }
    model.reward(s, a) + model.discount() * next
}
