//! The paper's detection filter (Verma, Fernandez, Simmons 2002): the nominal mode has a model, the
//! fault a constant likelihood. With the whitened nominal residual r the constant is
//! `peak · exp(-τ²/2)`, so that each step adds `(|r|² - τ²) / 2` to the log-odds: a CUSUM.
//!
//! **Blind spot.** For a residual of d dimensions with squared bias λ the mean of that step is
//! `(d + λ - τ²) / 2`, as `E|r|² = d + λ`. Nominal residuals must not count as evidence, so
//! `τ² > d`. Then a fault with `λ <= τ² - d` adds no evidence on average, however long it lasts:
//! only chance raises an alarm. [`crate::windowed`] makes the blind spot smaller, [`crate::ages`]
//! has none.

use vigil_checkpoint::CheckpointValue;

use crate::departure::LOG_ODDS_MAX;
use crate::logspace::log_add;

/// Two states, nominal and fault, with a constant likelihood in the fault state.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Constant {
    log_odds: f64,
    gain: f64,
}

impl Default for Constant {
    fn default() -> Self {
        Self {
            log_odds: f64::NEG_INFINITY,
            gain: 0.0,
        }
    }
}

impl Constant {
    /// Natural log-odds of the fault state.
    #[must_use]
    pub const fn log_odds(&self) -> f64 {
        self.log_odds
    }

    /// Log-likelihood ratio of the last step for a fault that was present before it and stays.
    #[must_use]
    pub const fn gain(&self) -> f64 {
        self.gain
    }

    /// One step with the squared norm of the whitened residual, and the constant's `tau_squared`,
    /// which exceeds the residual's dimension. `birth` and `death`: probabilities that a fault
    /// appears and vanishes in this step. What is no number is no evidence.
    pub fn step(&mut self, norm_squared: f64, tau_squared: f64, birth: f64, death: f64) {
        if norm_squared.is_finite() {
            self.take(0.5 * (norm_squared - tau_squared), birth, death);
        }
    }

    /// One step of the two states with the log-likelihood ratio `evidence`.
    pub(crate) fn take(&mut self, evidence: f64, birth: f64, death: f64) {
        assert!(
            !self.log_odds.is_nan() && self.log_odds <= LOG_ODDS_MAX,
            "log-odds of a constant likelihood are a number within their bound"
        );
        let stays = log_add(self.log_odds + (1.0 - death).ln(), birth.ln());
        let leaves = log_add((1.0 - birth).ln(), self.log_odds + death.ln());
        let log_odds = stays - leaves + evidence;
        if log_odds.is_nan() {
            return;
        }
        self.log_odds = log_odds.min(LOG_ODDS_MAX);
        self.gain = evidence;
    }
}

#[cfg(test)]
mod tests {
    use super::Constant;
    use crate::ages::Ages;
    use nalgebra::SVector;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    /// White residuals of three dimensions with a bias of squared size `lambda`.
    fn residuals(lambda: f64, seed: u64) -> impl Iterator<Item = SVector<f64, 3>> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let bias = SVector::from([0.0, 0.0, lambda.sqrt()]);
        std::iter::repeat_with(move || {
            SVector::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal)) + bias
        })
    }

    #[test]
    fn the_recursion_is_the_two_state_bayes_filter() {
        // By hand: prior (1, 0), birth .1, death .2, likelihood ratio e^((9-5)/2).
        let mut filter = Constant::default();
        filter.step(9.0, 5.0, 0.1, 0.2);
        let ratio = 2.0_f64.exp();
        let odds = 0.1 / 0.9 * ratio;
        assert!((filter.log_odds() - odds.ln()).abs() < 1e-12);
        filter.step(9.0, 5.0, 0.1, 0.2);
        let odds = (odds * 0.8 + 0.1) / (0.9 + odds * 0.2) * ratio;
        assert!((filter.log_odds() - odds.ln()).abs() < 1e-12);
    }

    #[test]
    fn evidence_grows_outside_the_blind_spot_only() {
        // d = 3, τ² = 5: blind up to λ = 2. Far from both bounds of the log-odds a step adds the
        // bare evidence, so its mean is the drift.
        for (lambda, seed) in [(0.0, 1), (1.0, 2), (1.9, 3), (2.1, 4), (4.0, 5)] {
            let steps = 60_000;
            let drift = residuals(lambda, seed)
                .take(steps)
                .map(|residual| {
                    let mut filter = Constant {
                        log_odds: 10.0,
                        gain: 0.0,
                    };
                    filter.step(residual.norm_squared(), 5.0, 1e-12, 1e-12);
                    filter.log_odds() - 10.0
                })
                .sum::<f64>()
                / steps as f64;
            let expected = 0.5 * (3.0 + lambda - 5.0);
            // Variance of |r|²/2: (2d + 4λ) / 4.
            let sd = ((1.5 + lambda) / steps as f64).sqrt();
            assert!((drift - expected).abs() < 4.0 * sd, "{lambda}: {drift}");
            assert_eq!(drift > 0.0, lambda > 2.0);
        }
    }

    #[test]
    fn in_the_blind_spot_only_luck_alarms() {
        // One fault per million steps; alarm at even odds.
        let detected = |lambda: f64, learned: bool| {
            let found = |seed: &u64| {
                let (mut constant, mut ages) = (Constant::default(), Ages::<3>::new(1.0));
                residuals(lambda, *seed).take(1000).any(|residual| {
                    constant.step(residual.norm_squared(), 5.0, 1e-6, 1e-6);
                    ages.step(&residual, 1e-6);
                    0.0 < if learned {
                        ages.log_odds()
                    } else {
                        constant.log_odds()
                    }
                })
            };
            (0..100).filter(found).count()
        };
        assert!(detected(0.25, false) < 30, "luck only");
        assert_eq!(detected(4.0, false), 100);
        assert_eq!(
            detected(0.25, true),
            100,
            "the learned bias has no such spot"
        );
    }

    #[test]
    fn the_last_gain_is_half_the_excess_over_the_constant() {
        let mut filter = Constant::default();
        filter.step(9.0, 5.0, 0.1, 0.2);
        assert_eq!(filter.gain(), 2.0);
        filter.step(f64::NAN, 5.0, 0.1, 0.2);
        assert_eq!(filter.gain(), 2.0);
    }

    #[test]
    #[should_panic(expected = "log-odds of a constant likelihood are a number")]
    fn log_odds_that_are_no_number_are_caught() {
        let mut filter = Constant {
            log_odds: f64::NAN,
            gain: 0.0,
        };
        filter.step(1.0, 5.0, 1e-6, 1e-6);
    }

    proptest! {
        #[test]
        fn no_input_breaks_the_odds(
            steps in prop::collection::vec(prop::array::uniform4(prop::num::f64::ANY), 1..20),
        ) {
            let mut filter = Constant::default();
            for [norm, tau, birth, death] in steps {
                filter.step(norm, tau, birth, death);
                filter.step(norm, 5.0, 1e-6, 1e-6);
                prop_assert!(!filter.log_odds().is_nan() && filter.log_odds() <= 40.0);
            }
        }
    }
}
