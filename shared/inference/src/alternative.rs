//! Which of two explanations holds, when either may: a two-state Markov chain.
//!
//! Mixing both anew with every reading would cost the one that holds the logarithm of its share
//! each time; here it costs that once.

use crate::logspace::{log_add, probability};

/// Two explanations of a series of readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alternative {
    p: f64,
}

impl Alternative {
    /// The second explanation holds with this probability, before any reading.
    #[must_use]
    pub const fn new(p: f64) -> Self {
        Self { p }
    }

    /// Takes a reading that is so much more likely by the second explanation than by the first
    /// (natural logarithm); before it the explanations change places with the probability
    /// `changes`. Returns how much more likely it is than by the first alone.
    pub fn step(&mut self, log_ratio: f64, changes: f64) -> f64 {
        if log_ratio.is_nan() {
            return 0.0;
        }
        // Neither becomes impossible.
        let changes = changes.clamp(1e-12, 0.5);
        let before = self.p + changes * (1.0 - 2.0 * self.p);
        let (first, second) = ((-before).ln_1p(), before.ln() + log_ratio);
        self.p = probability(second - first);
        log_add(first, second)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHANGES: f64 = 1e-5;

    fn gained(either: &mut Alternative, log_ratio: f64, count: usize) -> f64 {
        (0..count).map(|_| either.step(log_ratio, CHANGES)).sum()
    }

    #[test]
    fn the_explanation_that_holds_costs_its_share_once_however_long_it_lasts() {
        let mut either = Alternative::new(0.2);
        let cost = gained(&mut either, -3.0, 10_000);
        assert!((cost - 0.8_f64.ln()).abs() < 0.2, "{cost}");
        let mut either = Alternative::new(0.2);
        let gain = gained(&mut either, 5.0, 100);
        assert!((gain - 500.0 - 0.2_f64.ln()).abs() < 0.2, "{gain}");
        // .. and a change costs its own probability once.
        let cost = gained(&mut either, -3.0, 10_000);
        assert!((cost - CHANGES.ln()).abs() < 4.0, "{cost}");
    }

    #[test]
    fn the_chain_is_the_two_state_bayes_filter() {
        let mut either = Alternative::new(0.5);
        let (mut first, mut second) = (0.5, 0.5);
        let mut gained = 0.0;
        for ratio in [1.0_f64, -2.0, 0.5, -1.0, 3.0] {
            gained += either.step(ratio, 0.1);
            (first, second) = (first * 0.9 + second * 0.1, second * 0.9 + first * 0.1);
            second *= ratio.exp();
            assert!((gained - f64::ln(first + second)).abs() < 1e-12);
        }
    }

    #[test]
    fn no_reading_makes_it_less_than_a_number() {
        for ratio in [f64::NAN, 1e300, -1e300, f64::INFINITY, f64::NEG_INFINITY] {
            let mut either = Alternative::new(0.5);
            for _ in 0..10 {
                assert!(!either.step(ratio, 1e-3).is_nan());
            }
            assert!(either.step(0.0, 1e-3).is_finite());
        }
    }
}
