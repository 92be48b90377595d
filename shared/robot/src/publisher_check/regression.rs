//! A channel against what is expected of it.

use vigil_checkpoint::CheckpointValue;

/// Ratios between this and its inverse are those of a channel with the other sign: -1, by a factor
/// of 2.5 either way for slip and gains.
const REVERSED: f64 = -0.4;
/// Squared correlation with the command above which a channel follows it: 0.77, which no noise
/// reaches over a second.
const FOLLOWS: f64 = 0.6;

/// Sums of a channel against what is expected of it.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct RegressionSums {
    /// Time over which they were taken, s.
    pub time_s: f64,
    found: f64,
    /// Squares of what is expected.
    pub(super) expected: f64,
    squares: f64,
}

impl RegressionSums {
    /// Takes a value, and what is expected, over this time.
    pub fn add(&mut self, value: f64, expected: f64, dt_s: f64) {
        self.time_s += dt_s;
        self.found += value * expected * dt_s;
        self.expected += expected * expected * dt_s;
        self.squares += value * value * dt_s;
    }

    /// Part of the channel's squares that what is expected explains.
    #[must_use]
    pub fn explained(&self) -> f64 {
        let squares = (self.squares * self.expected).max(f64::MIN_POSITIVE);
        self.found * self.found / squares
    }

    pub(super) fn ratio(&self) -> f64 {
        self.found / self.expected
    }

    pub(super) fn follows(&self) -> bool {
        self.explained() > FOLLOWS
    }

    /// True if it follows with the sign opposite to `sense`, 1 or -1.
    pub(super) fn is_reversed(&self, sense: f64) -> bool {
        (1.0 / REVERSED..=REVERSED).contains(&(sense * self.ratio())) && self.follows()
    }
}
