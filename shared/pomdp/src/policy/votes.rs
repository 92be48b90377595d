//! The votes of the states: each speaks for its own best action, with its probability.

use super::entropy::{minus_p_ln_p, normalised};
use crate::bounds::mdp::Solution;

/// w(a) = sum_s b(s) [pi(s) = a], where pi(s) is the state's own best action. Preallocated.
#[derive(Debug, Clone, PartialEq)]
pub struct Votes {
    /// pi.
    best: Vec<usize>,
    /// w of the belief that was counted last.
    mass: Vec<f64>,
}

impl Votes {
    /// By pi_CO of a solved model.
    #[must_use]
    pub fn new(solution: &Solution) -> Self {
        let best = (0..solution.states()).map(|s| solution.best(s));
        Self::by_states(best.collect(), solution.actions())
    }

    /// By the best action of each state, of so many actions.
    pub(super) fn by_states(best: Vec<usize>, actions: usize) -> Self {
        Self {
            best,
            mass: vec![0.0; actions],
        }
    }

    /// pi(s).
    pub(super) fn best(&self, state: usize) -> usize {
        self.best[state]
    }

    /// The votes under a belief, one number per action.
    pub fn count(&mut self, belief: &[f64]) -> &[f64] {
        self.mass.fill(0.0);
        for (b, best) in belief.iter().zip(&self.best) {
            if let Some(mass) = self.mass.get_mut(*best) {
                *mass += b;
            }
        }
        &self.mass
    }

    /// The votes that were counted last.
    #[must_use]
    pub fn counted(&self) -> &[f64] {
        &self.mass
    }

    /// Gives away the votes that were counted last.
    pub(super) fn keep(&self, put: &mut dyn FnMut(f64)) {
        self.mass.iter().for_each(|mass| put(*mass));
    }

    /// Takes what [`Self::keep`] gave away.
    pub(super) fn resume(&mut self, take: &mut dyn FnMut() -> f64) {
        self.mass.iter_mut().for_each(|mass| *mass = take());
    }

    /// Entropy of the votes that were counted last, 0 to 1.
    #[must_use]
    pub fn entropy(&self) -> f64 {
        let nats: f64 = self.mass.iter().map(|w| minus_p_ln_p(*w)).sum();
        normalised(nats, self.mass.len())
    }
}
