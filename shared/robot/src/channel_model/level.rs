//! The level of a channel that wanders without a fault.

use vigil_checkpoint::CheckpointValue;

/// Time that a level is a mean over, s. Chosen: a battery's charge changes in hours, its load in
/// seconds.
const LEVEL_S: f64 = 60.0;
/// Time within which the rate follows at which it rises, s. Chosen: a step overshoots by a sixth;
/// with more, a discharge is followed later.
const RATE_S: f64 = 100.0;
/// Time for which readings err alike, s: what the level makes of them errs as those of so many
/// fewer. Chosen: a robot speeds up in about as long.
const ALIKE_S: f64 = 1.0;
/// First readings, whose median is the level: one of them may be a glitch.
const FIRST: usize = 5;

/// What wanders: a mean of all that was read, at first, then of the last minute or so, that moves
/// on at a rate of its own.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct Trend {
    /// The mean.
    pub value: f64,
    /// By how much it rises, 1/s.
    pub rate_1_s: f64,
}

impl Trend {
    /// Moves on.
    pub fn advance(&mut self, dt_s: f64) {
        self.value += self.rate_1_s * dt_s;
    }

    /// Takes a value that lies this step above the mean.
    pub fn correct(&mut self, step: f64, gains: Gains) {
        self.value += gains.value * step;
        self.rate_1_s += gains.rate_1_s * step;
    }
}

/// Parts of a step by which a trend changes.
#[derive(Debug, Clone, Copy)]
pub struct Gains {
    /// Its mean.
    value: f64,
    /// Its rate, 1/s.
    rate_1_s: f64,
}

/// Time over which a trend was followed, s; at most that of its mean.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct Followed {
    s: f64,
}

impl Followed {
    /// The gains of a value that lasted `dt_s`.
    pub fn gains(&mut self, dt_s: f64) -> Gains {
        self.s = (self.s + dt_s).min(LEVEL_S);
        Gains {
            value: if self.s > 0.0 { dt_s / self.s } else { 1.0 },
            rate_1_s: dt_s / (RATE_S * RATE_S),
        }
    }
}

/// How far a channel lies from its prediction, slowly followed.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct Level {
    first: [f64; FIRST],
    /// How many of the first readings there are.
    read: usize,
    followed: Followed,
    trend: Trend,
    /// For how long nothing was taken, s.
    idle_s: f64,
}

impl Level {
    /// The level `dt_s` later, before a reading that lies so far `apart` from its prediction, if it
    /// was read: the very first one is its own. While nothing is taken it soon stays as it is.
    pub fn advance(&mut self, apart: Option<f64>, dt_s: f64) -> f64 {
        self.idle_s += dt_s;
        if self.idle_s < LEVEL_S {
            self.trend.advance(dt_s);
        }
        match apart.filter(|apart| self.read == 0 && apart.is_finite()) {
            Some(apart) => apart,
            None => self.trend.value,
        }
    }

    /// Variance of a reading's distance from the level, over that of the reading.
    #[must_use]
    pub fn variance(&self) -> f64 {
        1.0 + ALIKE_S / self.followed.s.max(ALIKE_S)
    }

    /// Takes a reading that lasted `dt_s` and lies so far `apart` from its prediction; after the
    /// first ones none counts for more than `reach` from the level.
    pub fn take(&mut self, apart: f64, reach: f64, dt_s: f64) {
        if !apart.is_finite() {
            return;
        }
        self.idle_s = 0.0;
        let gains = self.followed.gains(dt_s);
        let Some(slot) = self.first.get_mut(self.read) else {
            // Not `clamp`, which panics on a reach that is no number.
            let step = (apart - self.trend.value).max(-reach).min(reach);
            if step.is_finite() {
                self.trend.correct(step, gains);
            }
            return;
        };
        *slot = apart;
        self.read += 1;
        let mut read = self.first;
        let read = &mut read[..self.read];
        read.sort_by(f64::total_cmp);
        let (low, high) = (read[(self.read - 1) / 2], read[self.read / 2]);
        self.trend.value = 0.5 * low + 0.5 * high;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAR: f64 = f64::INFINITY;

    #[test]
    fn the_median_of_the_first_readings_is_the_level_and_then_it_follows() {
        let mut level = Level::default();
        assert_eq!(level.advance(None, 0.1), 0.0);
        assert_eq!(level.advance(Some(24.0), 0.1), 24.0);
        for (apart, median) in [
            (0.0, 0.0),
            (26.0, 13.0),
            (24.0, 24.0),
            (1e308, 25.0),
            (25.0, 25.0),
        ] {
            level.take(apart, FAR, 0.1);
            assert_eq!(level.advance(Some(3.0), 0.1), median);
        }
        // What is far off moves it no further than what is within reach.
        let mut other = level;
        level.take(1e9, 2.0, 0.1);
        other.take(27.0, 2.0, 0.1);
        let values = [level, other].map(|mut one| one.advance(None, 0.1));
        assert!(values[0] > 25.0 && values[0] < 27.0, "{values:?}");
        assert_eq!(values[0], values[1]);
    }

    #[test]
    fn no_reading_leaves_the_level_without_a_number() {
        let mut level = Level::default();
        for apart in [f64::NAN, 1e308, -1e308, f64::INFINITY, 1e308, -1e308, 1e308] {
            for reach in [1.0, FAR, f64::NAN] {
                level.take(apart, reach, 0.1);
                assert!(level.advance(None, 0.1).is_finite(), "{level:?}");
            }
        }
    }

    #[test]
    fn a_discharge_is_followed_without_delay_in_the_end_and_a_step_in_minutes() {
        let mut level = Level::default();
        let mut late: f64 = 0.0;
        for step in 0..36_000 {
            let volt = 25.0 - 2.0 * f64::from(step) / 36_000.0;
            late = level.advance(Some(volt), 0.1) - volt;
            // 2 V in an hour; without the rate it would be a minute late, 33 mV.
            assert!((-1e-3..0.025).contains(&late), "{late} V after {step}");
            level.take(volt, FAR, 0.1);
        }
        assert!(late.abs() < 1e-5, "{late} V");
        for _ in 0..6000 {
            let left = level.advance(Some(10.0), 0.1) - 10.0;
            assert!(left > -0.2 * 13.0, "{left} V of 13 V");
            level.take(10.0, FAR, 0.1);
        }
        let left = level.advance(None, 0.1) - 10.0;
        assert!(left.abs() < 0.1, "{left} V of 13 V");
        // While nothing is taken, the rate that there was does not go on for ever.
        let mut level = Level::default();
        for second in 0..600 {
            let volt = 25.0 - 1e-3 * f64::from(second);
            level.advance(Some(volt), 1.0);
            level.take(volt, FAR, 1.0);
        }
        let held = (0..3600)
            .map(|_| level.advance(None, 1.0))
            .fold(25.0, f64::min);
        assert!((24.3..24.4).contains(&held), "{held} V");
    }
}
