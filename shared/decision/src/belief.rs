//! Belief tracking: exact, preallocated, never NaN.

use crate::model::Pomdp;

/// Weight of the start belief that is mixed in after an impossible observation.
const RESTART_WEIGHT: f64 = 0.01;

/// What an observation or soft evidence did to the belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Evidence {
    /// Taken; its probability under the predicted belief (for soft evidence: its expected
    /// likelihood).
    Taken(f64),
    /// Impossible under the belief, or not finite: the belief is the prediction with a little of
    /// the start belief mixed in, so that no state is ruled out for ever.
    Impossible,
}

/// A belief over the states of one model.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracker {
    belief: Vec<f64>,
    next: Vec<f64>,
    start: Vec<f64>,
}

impl Tracker {
    /// Begins at the model's start belief.
    #[must_use]
    pub fn new(model: &Pomdp) -> Self {
        let start = model.start().to_vec();
        Self {
            belief: start.clone(),
            next: vec![0.0; start.len()],
            start,
        }
    }

    /// The belief: non-negative, sums to 1.
    #[must_use]
    pub fn belief(&self) -> &[f64] {
        &self.belief
    }

    /// Back to the start belief.
    pub fn reset(&mut self) {
        self.belief.copy_from_slice(&self.start);
    }

    /// Takes over a belief from elsewhere; entries that are not finite or negative count as 0.
    /// Without any mass left, the belief stays as it is, and `false` is returned.
    pub fn anchor(&mut self, weights: &[f64]) -> bool {
        for (slot, weight) in self.next.iter_mut().zip(weights) {
            *slot = if weight.is_finite() {
                weight.max(0.0)
            } else {
                0.0
            };
        }
        let taken = normalise(&mut self.next).is_some();
        if taken {
            std::mem::swap(&mut self.belief, &mut self.next);
        }
        taken
    }

    /// b'(s') = sum_s T(s,a,s') b(s).
    pub fn predict(&mut self, model: &Pomdp, action: usize) {
        self.next.fill(0.0);
        for (s, b) in self.belief.iter().enumerate().filter(|(_, b)| **b > 0.0) {
            for (to, p) in model.successors(s, action) {
                self.next[*to] += b * p;
            }
        }
        // Row sums may be off by the reader's tolerance.
        if normalise(&mut self.next).is_some() {
            std::mem::swap(&mut self.belief, &mut self.next);
        }
    }

    /// Prediction and observation: b'(s') = Z(a,s',z) sum_s T(s,a,s') b(s) / p(z|a,b).
    pub fn update(&mut self, model: &Pomdp, action: usize, observation: usize) -> Evidence {
        self.predict(model, action);
        weigh(
            &mut self.belief,
            &mut self.next,
            &self.start,
            model.likelihood(action, observation),
        )
    }

    /// Soft (virtual) evidence: b'(s) proportional to L(s) b(s). Likelihoods that are not finite
    /// or negative count as 0.
    pub fn weigh(&mut self, likelihood: &[f64]) -> Evidence {
        weigh(&mut self.belief, &mut self.next, &self.start, likelihood)
    }

    /// Entropy of the belief, divided by that of the uniform one: 0 certain, 1 uniform.
    #[must_use]
    pub fn entropy(&self) -> f64 {
        let nats: f64 = self
            .belief
            .iter()
            .filter(|b| **b > 0.0)
            .map(|b| -b * b.ln())
            .sum();
        let states = self.belief.len() as f64;
        if states > 1.0 {
            (nats / states.ln()).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }
}

fn weigh(
    belief: &mut Vec<f64>,
    next: &mut Vec<f64>,
    start: &[f64],
    likelihood: &[f64],
) -> Evidence {
    for ((slot, b), l) in next.iter_mut().zip(belief.iter()).zip(likelihood) {
        *slot = if l.is_finite() { b * l.max(0.0) } else { 0.0 };
    }
    if let Some(p) = normalise(next) {
        std::mem::swap(belief, next);
        return Evidence::Taken(p);
    }
    for (b, s) in belief.iter_mut().zip(start) {
        *b = (1.0 - RESTART_WEIGHT) * *b + RESTART_WEIGHT * s;
    }
    normalise(belief);
    Evidence::Impossible
}

/// Divides by the sum and returns it; `None`, and no change, if the sum is 0 or not finite.
fn normalise(weights: &mut [f64]) -> Option<f64> {
    let sum: f64 = weights.iter().sum();
    if !(sum.is_finite() && sum > 0.0) {
        return None;
    }
    weights.iter_mut().for_each(|w| *w /= sum);
    weights.iter().all(|w| w.is_finite()).then_some(sum)
}
