//! Is a fault that was alarmed still there? Two states, present and ended, against each other.
//!
//! A detection filter asks when a fault began and adds up all that has spoken for it since; after a
//! long fault that sum takes long to be outweighed. Here only the present counts: each step's
//! likelihood ratio, that of the fault as it has been learned to the nominal mode's, moves the odds
//! of a two-state chain whose rates bound them. So the time until an end is seen depends on the
//! size of the fault and not on how long it lasted.

use crate::logspace::log_add;

/// One step changes the odds by this much at most, natural logarithm: a single reading decides
/// nothing. A fault that mends in minutes has odds of e^9 at most: to those that end it, e^-4, it
/// takes three readings.
const GAIN_MAX: f64 = 5.0;

/// The two-state chain.
#[derive(Debug, Clone, Copy, PartialEq)]
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

    /// The fault is there.
    pub const fn begin(&mut self) {
        self.log_odds = f64::INFINITY;
    }

    /// Natural log-odds that it is still there.
    #[must_use]
    pub const fn log_odds(&self) -> f64 {
        self.log_odds
    }

    /// Takes the log-likelihood ratio of `dt_s` of motion.
    pub fn step(&mut self, gain: f64, dt_s: f64) {
        let [appears, vanishes] = [self.appears_1_s, self.vanishes_1_s]
            .map(|rate_1_s| (rate_1_s * dt_s).clamp(1e-12, 0.5));
        // Bounded, so that certainty is no infinity.
        let odds = self.log_odds.clamp(-700.0, 700.0);
        let stays = log_add(odds + (-vanishes).ln_1p(), appears.ln());
        let leaves = log_add((-appears).ln_1p(), odds + vanishes.ln());
        let gain = if gain.is_nan() { 0.0 } else { gain };
        self.log_odds = stays - leaves + gain.clamp(-GAIN_MAX, GAIN_MAX);
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
    fn an_end_is_seen_as_soon_after_an_hour_as_after_a_second() {
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
    fn no_gain_makes_it_less_than_a_number() {
        for gain in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300] {
            let mut ending = Ending::new(1e-3, 1e-2);
            (0..100).for_each(|_| ending.step(gain, 0.05));
            assert!(ending.log_odds().is_finite());
        }
    }
}
