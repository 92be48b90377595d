//! Belief tracking: exact, preallocated, never NaN.
//!
//! A step costs what can happen, not what the model holds: it visits the states that the belief
//! does not rule out, and from each the successors that the observation leaves possible. Nothing is
//! dropped for being small: probabilities down to the smallest normal double (2.2e-308) are kept.

use crate::model::{Pomdp, SUM_TOLERANCE};
use crate::weights::Weights;

/// Weight of the start belief that is mixed in after an impossible observation. Chosen by hand: one
/// later observation of likelihood ratio 100 makes up for it. Smaller leaves a state that was ruled
/// out wrongly so for longer; larger throws away more of what was known.
const RESTART_WEIGHT: f64 = 0.01;
/// An observation's probability is at most this: a row of T and one of Z may each sum to 1 and the
/// tolerance.
const PROBABILITY_MAX: f64 = 1.0 + 3.0 * SUM_TOLERANCE;
/// The entropy of a belief exceeds ln n by rounding and by [`SUM_TOLERANCE`] at most, in nats.
const ENTROPY_TOLERANCE: f64 = 1e-6;

/// What an observation or soft evidence did to the belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Evidence {
    /// Taken; its probability p(z|a,b) before the step (for soft evidence: its expected
    /// likelihood). The logarithm, summed, is the log-likelihood of all that was seen.
    Taken(f64),
    /// Impossible under the belief, or not finite. The belief is restored by one rule: it becomes
    /// the prediction (for soft evidence: stays what it was), with 0.01 of the start belief mixed
    /// in, so that no state is ruled out for ever.
    Impossible,
}

/// A belief over the states of one model (Smallwood and Sondik, 1973). Every call must be given
/// that model, and actions and observations that it has. Nothing is allocated after
/// [`Tracker::new`].
#[derive(Debug, Clone)]
pub struct Tracker {
    /// Sums to 1.
    belief: Weights,
    /// All 0 between calls.
    next: Weights,
    start: Vec<f64>,
}

impl PartialEq for Tracker {
    fn eq(&self, other: &Self) -> bool {
        self.belief() == other.belief() && self.start == other.start
    }
}

impl Tracker {
    /// Begins at the model's start belief.
    #[must_use]
    pub fn new(model: &Pomdp) -> Self {
        let start = model.start().to_vec();
        let mut tracker = Self {
            belief: Weights::new(start.len()),
            next: Weights::new(start.len()),
            start,
        };
        tracker.reset();
        tracker
    }

    /// The belief, one probability a state: non-negative, sums to 1.
    #[must_use]
    pub fn belief(&self) -> &[f64] {
        self.belief.values()
    }

    /// The states that the belief does not rule out, in no particular order.
    #[must_use]
    pub fn support(&self) -> &[u32] {
        self.belief.support()
    }

    /// Back to the start belief.
    pub fn reset(&mut self) {
        self.next.set(self.start.iter().copied());
        self.accept(self.next.sum());
    }

    /// Takes over a belief from elsewhere: one weight a state, in any scale. Entries that are not
    /// finite or negative count as 0.
    /// Without any mass left, the belief stays as it is, and `false` is returned.
    pub fn anchor(&mut self, weights: &[f64]) -> bool {
        let sound = |w: &f64| if w.is_finite() { w.max(0.0) } else { 0.0 };
        self.next.set(weights.iter().map(sound));
        self.accept(self.next.sum()).is_some()
    }

    /// Gives away the belief as numbers, to go on from it later to the last bit: the order in which
    /// states are summed is part of it.
    pub fn keep(&self, put: &mut dyn FnMut(f64)) {
        self.belief.keep(put);
    }

    /// Goes on from what [`Self::keep`] gave away for the same model.
    pub fn resume(&mut self, take: &mut dyn FnMut() -> f64) {
        self.belief.resume(take);
    }

    /// b'(s') = sum_s T(s,a,s') b(s), normalised.
    pub fn predict(&mut self, model: &Pomdp, action: usize) {
        for &s in self.belief.support() {
            let b = self.belief.at(s);
            for &(to, p) in model.successors(s as usize, action) {
                self.next.add(to as u32, b * p);
            }
        }
        self.accept(self.next.sum());
    }

    /// Prediction and observation: b'(s') = Z(a,s',z) sum_s T(s,a,s') b(s) / p(z|a,b), where
    /// p(z|a,b) is the sum of the numerator over s'.
    pub fn update(&mut self, model: &Pomdp, action: usize, observation: usize) -> Evidence {
        if let Some(joint) = model.joint() {
            let rows = joint.rows(action, observation);
            for &s in self.belief.support() {
                let b = self.belief.at(s);
                let (columns, values) = rows.row(s as usize);
                for (to, p) in columns.iter().zip(values) {
                    self.next.add(*to, b * p);
                }
            }
        } else {
            let likelihood = model.likelihood(action, observation);
            for &s in self.belief.support() {
                let b = self.belief.at(s);
                for &(to, p) in model.successors(s as usize, action) {
                    self.next.add(to as u32, b * (p * likelihood[to]));
                }
            }
        }
        if let Some(p) = self.accept(self.next.sum()) {
            assert!(
                p > 0.0 && p <= PROBABILITY_MAX,
                "the probability of an observation is above 0 and at most 1: {p}"
            );
            return Evidence::Taken(p);
        }
        self.predict(model, action);
        self.restore();
        Evidence::Impossible
    }

    /// Soft (virtual) evidence, of one likelihood a state: b'(s) proportional to L(s) b(s).
    /// Likelihoods that are missing, not finite or negative count as 0, as do those for which the
    /// product is below 2.2e-308.
    pub fn weigh(&mut self, likelihood: &[f64]) -> Evidence {
        for &s in self.belief.support() {
            let l = likelihood.get(s as usize).copied().unwrap_or(0.0);
            if l.is_finite() {
                self.next.add(s, self.belief.at(s) * l);
            }
        }
        if let Some(p) = self.accept(self.next.sum()) {
            return Evidence::Taken(p);
        }
        self.restore();
        Evidence::Impossible
    }

    /// Entropy of the belief, divided by that of the uniform one: 0 certain, 1 uniform.
    #[must_use]
    pub fn entropy(&self) -> f64 {
        let belief = self.belief.support().iter().map(|&s| self.belief.at(s));
        let nats: f64 = belief.map(|b| -b * b.ln()).sum();
        let nats_max = (self.start.len() as f64).ln();
        assert!(
            (-ENTROPY_TOLERANCE..=nats_max + ENTROPY_TOLERANCE).contains(&nats),
            "the entropy of a belief is between 0 and ln n: {nats}"
        );
        if nats_max > 0.0 {
            (nats / nats_max).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    /// Makes `next`, divided by its sum, the belief; `None`, and no change, if the sum is 0 or not
    /// finite. `next` is 0 afterwards.
    fn accept(&mut self, sum: f64) -> Option<f64> {
        if !(sum.is_finite() && sum > 0.0) {
            self.next.clear();
            return None;
        }
        self.belief.clear();
        self.belief.take_scaled(&mut self.next, 1.0 / sum);
        self.assert_belief();
        Some(sum)
    }

    fn assert_belief(&self) {
        let sum = self.belief.sum();
        let is_negative = |s: &u32| self.belief.at(*s) < 0.0;
        assert!(
            // Rounding over 10^5 states, the most that a model has, is 2e-11.
            (sum - 1.0).abs() <= SUM_TOLERANCE && !self.support().iter().any(is_negative),
            "a belief sums to 1 and holds no negative number: {sum}"
        );
    }

    /// Mixes in the start belief.
    fn restore(&mut self) {
        let belief = self.belief.values().iter();
        let mixed = belief
            .zip(&self.start)
            .map(|(b, s)| (1.0 - RESTART_WEIGHT) * b + RESTART_WEIGHT * s);
        self.next.set(mixed);
        self.accept(self.next.sum());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COIN: &str = "discount: 0.9\nvalues: reward\nstates: heads tails\nactions: toss\n\
        observations: bright dark\nT: toss uniform\nO: toss\n0.75 0.25\n0.25 0.75\n";

    /// A belief that sums to 2.
    fn broken() -> (Pomdp, Tracker) {
        let model = Pomdp::parse(COIN).unwrap();
        let mut tracker = Tracker::new(&model);
        tracker.assert_belief();
        assert!((tracker.entropy() - 1.0).abs() < 1e-12);
        tracker.belief.set([1.0, 1.0].into_iter());
        (model, tracker)
    }

    #[test]
    #[should_panic(expected = "a belief sums to 1 and holds no negative number: 2")]
    fn a_belief_that_does_not_sum_to_one_is_caught() {
        let (_, mut tracker) = broken();
        tracker.next.set([1.0, 1.0].into_iter());
        tracker.accept(1.0);
    }

    #[test]
    #[should_panic(expected = "the probability of an observation is above 0 and at most 1: 1.1")]
    fn a_probability_above_one_is_caught() {
        let (model, mut tracker) = broken();
        tracker.belief.set([1.1, 1.1].into_iter());
        tracker.update(&model, 0, 0);
    }

    #[test]
    #[should_panic(expected = "the entropy of a belief is between 0 and ln n")]
    fn an_entropy_beyond_the_uniform_one_is_caught() {
        let (_, mut tracker) = broken();
        tracker.belief.set([0.4, 0.4].into_iter());
        let _ = tracker.entropy();
    }
}
