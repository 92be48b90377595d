//! Wheel rates and steering angles, and what an encoder says about its wheel.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vigil_inference::logspace::{log_add, log_normal};

use super::Reading;
use super::repeats::FAILS;
use crate::description::Description;

/// Rate (rad/s) that rolling without slip demands of `wheel` at a curvature (1/m) and speed (m/s):
/// `v·hypot(κX, 1 - κY) / r`.
#[must_use]
pub fn rolling_rate(robot: &Description, wheel: usize, curvature: f64, speed: f64) -> f64 {
    let at = &robot.wheels[wheel];
    speed * (curvature * at.x).hypot(1.0 - curvature * at.y) / robot.wheel_radius_m
}

/// Ackermann steering angle (rad) of `wheel` at a curvature (1/m); 0 for a fixed wheel.
#[must_use]
pub fn steering_angle(robot: &Description, wheel: usize, curvature: f64) -> f64 {
    let at = &robot.wheels[wheel];
    if at.steered {
        (curvature * at.x).atan2(1.0 - curvature * at.y)
    } else {
        0.0
    }
}

/// Rate of one wheel beside rolling without slip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RateModel {
    /// Ratio to the rate of rolling without slip.
    pub ratio: f64,
    /// How far the rate stays behind that at any speed, rad/s, as a polynomial of the curvature,
    /// κ^0 to κ^2: a motor under proportional control yields by its load over its gain.
    pub droop_rad_s: [f64; 3],
    /// Standard deviation of the rate, rad/s.
    pub rate_sd_rad_s: f64,
}

impl RateModel {
    /// Changes nothing.
    pub const NONE: Self = Self {
        ratio: 0.0,
        droop_rad_s: [0.0; 3],
        rate_sd_rad_s: 0.0,
    };

    /// Expected rate and its variance for a wheel that would roll at `rolling` rad/s.
    #[must_use]
    pub fn rate(&self, rolling: f64, curvature: f64) -> (f64, f64) {
        let [constant, linear, square] = self.droop_rad_s;
        let droop = constant + curvature * (linear + curvature * square);
        let against = (rolling / CREEPING_RAD_S).clamp(-1.0, 1.0);
        (
            self.ratio * rolling - against * droop,
            self.rate_sd_rad_s * self.rate_sd_rad_s + RATE_FLOOR_RAD_S * RATE_FLOOR_RAD_S,
        )
    }
}

/// Below this rate a wheel carries less than its load at speed, rad/s: four fifths of that of a
/// wheel of the rover at the speed at which it counts as standing.
pub const CREEPING_RAD_S: f64 = 0.2;

/// Deviation of a healthy wheel that no model explains, rad/s: a fifth of an encoder's noise. It
/// comes on top of the learned one, which the learner bounds below by 0.008 rad/s.
const RATE_FLOOR_RAD_S: f64 = 0.01;

/// What encoders do in health and when broken.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EncoderModel {
    /// Probability that a healthy sample equals its predecessor bit for bit.
    pub repeat_rate: f64,
    /// Resolution by which a density becomes the probability of one value, rad/s.
    pub resolution_rad_s: f64,
    /// Mean of a broken encoder's noise, rad/s.
    pub broken_mean_rad_s: f64,
    /// Standard deviation of a broken encoder's noise, rad/s.
    pub broken_sd_rad_s: f64,
}

/// A rate at which a wheel is expected to turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExpectedRate {
    /// Its mean, rad/s.
    pub mean_rad_s: f64,
    /// Its variance, (rad/s)².
    pub variance: f64,
    /// Share of deviations up to [`EncoderState::TAIL_SD_RAD_S`].
    pub tail: f64,
}

/// What a wheel and its encoder may be doing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EncoderState {
    /// Turns at about this rate.
    Turning(ExpectedRate),
    /// The encoder reports exactly zero.
    Zero,
    /// The encoder repeats its last value.
    Frozen,
    /// The encoder reports noise.
    Noise,
    /// The encoder reports zero plus the sensor's noise: its wheel stands, or it is dead.
    Standing,
    /// A smooth rate of its own: that of the observation before, or nearly so. A wheel that slips
    /// or is driven, a scaled or late encoder. With the variance, (rad/s)², by which a change of
    /// the command may have changed it.
    OwnRate(f64),
    /// Anything.
    Any,
}

impl EncoderState {
    /// Standard deviation of the tail of a turning wheel's rate, rad/s: four times an encoder's
    /// noise.
    pub const TAIL_SD_RAD_S: f64 = 0.2;
}

/// Share of readings that nothing explains (a fault in the middle of an observation). One
/// observation in 50 s holds a fault's very moment: 6.9 nats.
const OUTLIER: f64 = 1e-3;
/// Deviation of a standing wheel's rate from zero, rad/s: chosen, below half of an encoder's noise.
pub const STANDING_SD_RAD_S: f64 = 0.02;
/// Deviation of a rate of its own from one observation to the next, rad/s: an encoder's noise.
const OWN_RATE_SD_RAD_S: f64 = 0.05;

impl EncoderModel {
    /// Natural log-probability of `reading` in `state`, for samples whose noise has the standard
    /// deviation `sample_sd`. Comparable between states only. 0 for no samples.
    #[must_use]
    pub fn log_likelihood(&self, state: EncoderState, reading: &Reading, sample_sd: f64) -> f64 {
        let (plain, repeats) = (f64::from(reading.plain), f64::from(reading.repeats));
        let (zeros, count) = (f64::from(reading.zeros), f64::from(reading.count()));
        let noise = self.independent(reading, self.broken_mean_rad_s, self.broken_sd_rad_s);
        let hit = (1.0 - FAILS).ln();
        // A value drawn evenly over two deviations either way of a broken encoder's.
        let miss = (FAILS * self.resolution_rad_s / (4.0 * self.broken_sd_rad_s)).ln();
        match state {
            EncoderState::Turning(expected) => {
                let ExpectedRate {
                    mean_rad_s: rate,
                    variance,
                    tail,
                } = expected;
                let sharp = self.common(reading, rate, variance, sample_sd);
                let blunt = variance + EncoderState::TAIL_SD_RAD_S * EncoderState::TAIL_SD_RAD_S;
                let blunt = self.common(reading, rate, blunt, sample_sd);
                let body = log_add((1.0 - tail).ln() + sharp, tail.ln() + blunt);
                log_add(body, OUTLIER.ln() + noise)
            }
            EncoderState::Zero => zeros * hit + (count - zeros) * miss,
            EncoderState::Frozen => repeats * hit + plain * miss,
            EncoderState::Noise => noise,
            EncoderState::Standing => {
                let variance = STANDING_SD_RAD_S * STANDING_SD_RAD_S;
                let standing = self.common(reading, 0.0, variance, sample_sd);
                log_add(standing, OUTLIER.ln() + noise)
            }
            EncoderState::OwnRate(changed) => match reading.before {
                Some((before, count)) => {
                    let sample = sample_sd * sample_sd / f64::from(count);
                    let variance = OWN_RATE_SD_RAD_S * OWN_RATE_SD_RAD_S + changed + sample;
                    let smooth = self.common(reading, before, variance, sample_sd);
                    log_add(smooth, OUTLIER.ln() + noise)
                }
                None => noise,
            },
            EncoderState::Any => {
                // About zero, deviation 0.1 rad/s. Chosen: twice the rover's encoder noise.
                let standing = self.common(reading, 0.0, 0.01, sample_sd);
                log_add(log_add(standing, noise), repeats * hit + plain * miss) - 3.0_f64.ln()
            }
        }
    }

    /// Samples around one rate that is common to them.
    fn common(&self, reading: &Reading, rate: f64, variance: f64, sample_sd: f64) -> f64 {
        let repeats = f64::from(reading.repeats) * self.repeat_rate.ln();
        if reading.plain == 0 {
            return repeats;
        }
        let plain = f64::from(reading.plain);
        let sample = sample_sd * sample_sd;
        let mean = log_normal(reading.mean - rate, variance + sample / plain);
        let within = -0.5 * (plain - 1.0) * (std::f64::consts::TAU * sample).ln()
            - 0.5 * plain.ln()
            - 0.5 * reading.squares / sample;
        mean + within + plain * self.resolution_rad_s.ln() + repeats
    }

    /// Samples drawn one by one.
    fn independent(&self, reading: &Reading, mean: f64, sd: f64) -> f64 {
        let (plain, apart) = (f64::from(reading.plain), reading.mean - mean);
        let squares = reading.squares + plain * apart * apart;
        let density = -0.5 * (squares / (sd * sd) + plain * (std::f64::consts::TAU * sd * sd).ln());
        density
            + plain * self.resolution_rad_s.ln()
            + f64::from(reading.repeats) * self.repeat_rate.ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> EncoderModel {
        EncoderModel {
            repeat_rate: 1e-3,
            resolution_rad_s: 1e-3,
            broken_mean_rad_s: 2.0,
            broken_sd_rad_s: 3.5,
        }
    }

    fn turning(mean_rad_s: f64) -> EncoderState {
        EncoderState::Turning(ExpectedRate {
            mean_rad_s,
            variance: 4e-4,
            tail: 0.02,
        })
    }

    fn reading(values: &[f64]) -> Reading {
        let (mut reading, mut before) = (Reading::default(), None);
        for &value in values {
            reading.push(value, before);
            before = Some(value);
        }
        reading
    }

    #[test]
    fn each_pattern_is_explained_best_by_its_own_state() {
        let states = [
            turning(2.0),
            turning(0.0),
            EncoderState::Zero,
            EncoderState::Frozen,
            EncoderState::Noise,
        ];
        let patterns: [&[f64]; 5] = [
            &[2.03, 1.94, 2.01, 1.99, 2.06],
            &[0.03, -0.04, 0.01, -0.02, 0.05],
            &[0.0; 5],
            &[1.97, 1.97, 1.97, 1.97, 1.97],
            &[5.1, -2.0, 3.3, 0.2, 7.7],
        ];
        for (i, pattern) in patterns.iter().enumerate() {
            let reading = reading(pattern);
            let score = |j: usize| model().log_likelihood(states[j], &reading, 0.05);
            for j in (0..states.len()).filter(|&j| j != i) {
                assert!(score(i) > score(j) + 2.0, "pattern {i}, state {j}");
            }
        }
    }

    #[test]
    fn a_smooth_rate_of_its_own_is_neither_noise_nor_turning_as_commanded() {
        let states = [
            EncoderState::OwnRate(0.0),
            turning(2.0),
            EncoderState::Noise,
            EncoderState::Standing,
        ];
        let mut sums = [0.0; 4];
        let mut last = reading(&[1.61]);
        for value in [1.63, 1.58, 1.57, 1.62, 1.6, 1.66] {
            let mut next = last.next();
            next.push(value, None);
            for (sum, state) in sums.iter_mut().zip(states) {
                *sum += model().log_likelihood(state, &next, 0.05);
            }
            last = next;
        }
        assert!(sums[1..].iter().all(|sum| sums[0] > sum + 5.0), "{sums:?}");
        // Without an observation before there is nothing to be near to.
        let first = reading(&[1.6]);
        let of = |state| model().log_likelihood(state, &first, 0.05);
        assert_eq!(of(EncoderState::OwnRate(0.0)), of(EncoderState::Noise));
    }

    #[test]
    fn one_plain_sample_has_the_normal_density() {
        let reading = reading(&[2.1]);
        let found = model().common(&reading, 2.0, 0.03, 0.1);
        let expected = log_normal(0.1, 0.04) + 1e-3_f64.ln();
        assert!((found - expected).abs() < 1e-12);
    }

    #[test]
    fn no_samples_say_nothing() {
        let nothing = Reading::default();
        for state in [
            EncoderState::Zero,
            EncoderState::Frozen,
            EncoderState::Noise,
        ] {
            assert_eq!(model().log_likelihood(state, &nothing, 0.05), 0.0);
        }
        assert!(model().common(&nothing, 2.0, 0.1, 0.05).abs() < 1e-12);
    }
}
