//! The level of a channel that wanders without a fault.

use vigil_checkpoint::CheckpointValue;

/// Time within which a level follows, s. Chosen: a battery's charge changes in hours, its load in
/// seconds.
const LEVEL_S: f64 = 60.0;

/// How far a channel lies from its prediction, slowly followed.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct Level {
    /// For how long it has been followed, s; 0: nothing was read yet.
    followed_s: f64,
    value: f64,
}

impl Level {
    /// The level at an observation that lasted `dt_s` and lies so far `apart` from its prediction,
    /// if it was read. The first reading is the level; then it is a mean, of the last minute in the
    /// end.
    pub fn take(&mut self, apart: Option<f64>, dt_s: f64) -> f64 {
        let Some(apart) = apart else {
            return self.value;
        };
        self.followed_s = (self.followed_s + dt_s).min(LEVEL_S);
        let share = if self.followed_s > 0.0 {
            dt_s / self.followed_s
        } else {
            1.0
        };
        self.value += share * (apart - self.value);
        self.value
    }

    /// The level, which stays as it is.
    #[must_use]
    pub const fn value(&self) -> f64 {
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_reading_is_the_level_and_then_it_is_a_mean() {
        let mut level = Level::default();
        assert_eq!(level.take(None, 0.1), 0.0);
        assert_eq!(level.take(Some(24.0), 0.1), 24.0);
        for (apart, mean) in [(26.0, 25.0), (22.0, 24.0), (28.0, 25.0)] {
            assert!((level.take(Some(apart), 0.1) - mean).abs() < 1e-12);
        }
        assert_eq!((level.take(None, 0.1), level.value()), (25.0, 25.0));
    }

    #[test]
    fn a_discharge_is_followed_a_minute_late_and_a_step_in_two() {
        let mut level = Level::default();
        let mut late = 0.0;
        for step in 0..36_000 {
            let volt = 25.0 - 2.0 * f64::from(step) / 36_000.0;
            late = level.take(Some(volt), 0.1) - volt;
        }
        // 2 V in an hour, a minute late.
        assert!((late - 2.0 / 60.0).abs() < 1e-3, "{late} V");
        for _ in 0..1200 {
            level.take(Some(10.0), 0.1);
        }
        let left = (level.value() - 10.0) / (23.0 + late - 10.0);
        assert!((left - (-2.0_f64).exp()).abs() < 5e-3, "{left}");
    }
}
