//! The end of a fault: a Markov chain of two states, present and ended.
//!
//! A detection filter adds up all evidence since a fault's onset; after a long fault that sum takes
//! long to be outweighed. Here each step's likelihood ratio of the learned fault to the nominal
//! mode moves the odds of a chain whose rates bound them. So the delay with which an end is
//! detected depends on the size of the fault, not on how long it lasted.

use vigil_checkpoint::CheckpointValue;

use crate::logspace::log_add;

/// Largest change of the log-odds by one step, nats, so that no single measurement decides. Chosen
/// by hand: the chain of a fault that mends in minutes saturates near 9 nats, so that three
/// measurements lead from there to -4. Smaller delays each end; larger lets one outlier end a
/// fault.
const GAIN_MAX: f64 = 5.0;

/// The two-state chain.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Ending {
    appears_1_s: f64,
    vanishes_1_s: f64,
    log_odds: f64,
}

impl Ending {
    /// A chain whose fault appears and vanishes at these rates, 1/s of motion.
    #[must_use]
    pub const fn new(appears_1_s: f64, vanishes_1_s: f64) -> Self {
        Self {
            appears_1_s,
            vanishes_1_s,
            log_odds: f64::INFINITY,
        }
    }

    /// Makes the fault certain.
    pub const fn begin(&mut self) {
        self.log_odds = f64::INFINITY;
    }

    /// Natural log-odds that the fault is still present.
    #[must_use]
    pub const fn log_odds(&self) -> f64 {
        self.log_odds
    }

    /// Takes the log-likelihood ratio `gain` of `dt_s` of motion.
    pub fn step(&mut self, gain: f64, dt_s: f64) {
        // Beyond a half the chain would alternate; at 0 a state would be permanent.
        let change = |rate_1_s: f64| match rate_1_s * dt_s {
            p if p.is_nan() => 1e-12,
            p => p.clamp(1e-12, 0.5),
        };
        let (appears, vanishes) = (change(self.appears_1_s), change(self.vanishes_1_s));
        // Certainty, an infinity, is bounded: the exponential of 700 is the last that is a double.
        let odds = self.log_odds.clamp(-700.0, 700.0);
        let stays = log_add(odds + (-vanishes).ln_1p(), appears.ln());
        let leaves = log_add((-appears).ln_1p(), odds + vanishes.ln());
        let gain = if gain.is_nan() { 0.0 } else { gain };
        self.log_odds = stays - leaves + gain.clamp(-GAIN_MAX, GAIN_MAX);
        assert!(
            self.log_odds.is_finite(),
            "the log-odds of an end are finite after a step"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chain_is_the_two_state_bayes_filter() {
        let mut ending = Ending::new(0.2, 1.0);
        let (mut present, mut ended) = (1.0, 0.0);
        for gain in [1.0_f64, -2.0, 0.5, -1.0, -1.0] {
            ending.step(gain, 0.1);
            (present, ended) = (present * 0.9 + ended * 0.02, present * 0.1 + ended * 0.98);
            present *= gain.exp();
            assert!((ending.log_odds() - (present / ended).ln()).abs() < 1e-9);
        }
    }

    #[test]
    fn an_end_is_detected_as_soon_after_an_hour_as_after_a_second() {
        let delay = |steps: usize| {
            let mut ending = Ending::new(1e-3, 1.0 / 60.0);
            (0..steps).for_each(|_| ending.step(2.0, 0.05));
            let mut count = 0;
            while ending.log_odds() > -4.0 {
                ending.step(-0.5, 0.05);
                count += 1;
            }
            count
        };
        assert_eq!(delay(20), delay(72_000));
        assert!(delay(20) < 40);
    }

    #[test]
    #[should_panic(expected = "the log-odds of an end are finite after a step")]
    fn log_odds_that_are_no_number_are_caught() {
        let mut ending = Ending::new(1e-3, 1e-2);
        ending.log_odds = f64::NAN;
        ending.step(0.0, 0.05);
    }

    #[test]
    fn one_step_moves_the_odds_by_five_nats_at_most() {
        let after = |gain| {
            let mut ending = Ending::new(1e-3, 1e-2);
            ending.log_odds = 0.0;
            ending.step(gain, 0.05);
            ending.log_odds()
        };
        assert_eq!(after(6.0), after(5.0));
        assert_eq!(after(-6.0), after(-5.0));
        assert!((after(4.0) - after(0.0) - 4.0).abs() < 1e-12);
        assert_eq!(after(f64::NAN), after(0.0));
    }

    #[test]
    fn a_fault_that_begins_is_certain() {
        let mut ending = Ending::new(1e-3, 1e-2);
        assert_eq!(ending.log_odds(), f64::INFINITY);
        ending.step(-5.0, 0.05);
        assert!(ending.log_odds() < 8.0);
        ending.begin();
        assert_eq!(ending.log_odds(), f64::INFINITY);
    }

    #[test]
    fn no_rate_breaks_it() {
        for rate_1_s in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e300] {
            let mut ending = Ending::new(rate_1_s, rate_1_s);
            (0..10).for_each(|_| ending.step(-1.0, 0.05));
            assert!(ending.log_odds().is_finite());
        }
    }

    #[test]
    fn no_gain_makes_it_less_than_a_number() {
        for gain in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300] {
            let mut ending = Ending::new(1e-3, 1e-2);
            (0..100).for_each(|_| ending.step(gain, 0.05));
            assert!(ending.log_odds().is_finite());
        }
    }
}
