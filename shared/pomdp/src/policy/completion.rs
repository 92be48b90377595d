//! Vectors for the actions that no plan, or no good one, begins with.
//!
//! One step of dynamic programming at a belief: alpha_a(s) = R(s,a) + gamma sum_o sum_s' T(s,a,s')
//! Z(a,s',o) alpha_o(s'), where alpha_o is the vector that is best if o is observed. Where the
//! state is certain that is the value of taking `a` and then following the plans; elsewhere it is
//! less, but earned for certain. All vectors that go on to others stay below what one step of
//! planning gives, so that a policy which follows them earns at least what they say.

use crate::alpha_vectors::{AlphaVectors, VectorError};
use crate::model::Pomdp;

/// A better value is better by this much, relative to it or to 1: less is the rounding of a bound.
const BETTER: f64 = 1e-9;

/// `vectors`, and what is better at a certain state or at the start belief for some action.
pub(super) fn completed(
    model: &Pomdp,
    vectors: &AlphaVectors,
) -> Result<AlphaVectors, VectorError> {
    let (states, actions) = (model.states().len(), model.actions().len());
    let given = vectors.rows().map(|(action, row)| (action, row.to_vec()));
    let mut all: Vec<(usize, Vec<f64>)> = given.collect();
    // Refused here if they are of another model.
    let known = AlphaVectors::new(states, actions, all.iter().map(|(a, v)| (*a, v)))?;
    let start = model.start().iter().copied().enumerate();
    let start: Vec<(usize, f64)> = start.filter(|(_, b)| *b > 0.0).collect();
    let certain = (0..states).map(|s| vec![(s, 1.0)]);
    for belief in std::iter::once(start).chain(certain) {
        for action in 0..actions {
            let of_action = all.iter().filter(|(a, _)| *a == action);
            let before = of_action.map(|(_, row)| value(row, &belief));
            let before = before.fold(f64::NEG_INFINITY, f64::max);
            let row = backed_up(model, &known, &belief, action);
            let least = before + BETTER * before.abs().clamp(1.0, f64::MAX);
            if value(&row, &belief) > least {
                all.push((action, row));
            }
        }
    }
    AlphaVectors::new(states, actions, all)
}

fn value(row: &[f64], belief: &[(usize, f64)]) -> f64 {
    let of = |(s, b): &(usize, f64)| row.get(*s).map_or(0.0, |v| v * b);
    belief.iter().map(of).sum()
}

fn backed_up(
    model: &Pomdp,
    vectors: &AlphaVectors,
    belief: &[(usize, f64)],
    action: usize,
) -> Vec<f64> {
    let states = model.states().len();
    let mut predicted = vec![0.0; states];
    for (s, b) in belief {
        for (to, p) in model.successors(*s, action) {
            predicted[*to] += b * p;
        }
    }
    let mut seen = vec![0.0; states];
    for o in 0..model.observations().len() {
        let likelihood = model.likelihood(action, o);
        let next = predicted.iter().zip(likelihood).map(|(b, z)| b * z);
        let next: Vec<(usize, f64)> = next.enumerate().filter(|(_, w)| *w > 0.0).collect();
        let mut best: (f64, &[f64]) = (f64::NEG_INFINITY, &[]);
        for (_, row) in vectors.rows() {
            // What cannot be observed here goes on as the first.
            let worth = value(row, &next);
            if worth > best.0 {
                best = (worth, row);
            }
        }
        for ((sum, z), v) in seen.iter_mut().zip(likelihood).zip(best.1) {
            *sum += z * v;
        }
    }
    let value = |s: usize| {
        let next = model.successors(s, action).iter();
        let next: f64 = next.map(|(to, p)| p * seen[*to]).sum();
        model.reward(s, action) + model.discount() * next
    };
    (0..states).map(value).collect()
}
