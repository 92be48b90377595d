//! Whether a sensor repeats itself exactly, as a frozen or dead one does.

use vigil_checkpoint::CheckpointValue;
use vigil_inference::departure::LOG_ODDS_MAX;
use vigil_inference::logspace::log_add;

use super::Reading;

/// Probability that a frozen sensor does not repeat itself. A changed sample costs 4.6 nats, a
/// repeat gains 7 where one in 1,700 repeats by chance.
pub(super) const FAILS: f64 = 0.01;

/// Log-likelihood of a reading of a frozen sensor, over that of a healthy one, which repeats itself
/// with the probability `healthy`.
#[must_use]
pub fn log_ratio(reading: &Reading, healthy: f64) -> f64 {
    f64::from(reading.repeats) * ((1.0 - FAILS) / healthy).ln()
        + f64::from(reading.plain) * (FAILS / (1.0 - healthy)).ln()
}

/// Log-odds that a sensor is frozen, and what the last observation said for it.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub(super) struct Repeats {
    pub log_odds: f64,
    pub gain: f64,
}

impl Default for Repeats {
    fn default() -> Self {
        Self {
            log_odds: f64::NEG_INFINITY,
            gain: 0.0,
        }
    }
}

impl Repeats {
    /// Takes a reading; `birth` is the probability that the sensor has frozen since the last one.
    /// Returns its [`log_ratio`].
    pub fn step(&mut self, reading: &Reading, healthy: f64, birth: f64) -> f64 {
        let seen = log_ratio(reading, healthy);
        let before = log_add(self.log_odds, birth.ln());
        self.log_odds = (before + seen).clamp(birth.ln(), LOG_ODDS_MAX);
        // At the lower bound there is nothing to lose: a gain below what was lost is none.
        self.gain = seen.max(self.log_odds - before);
        seen
    }
}
