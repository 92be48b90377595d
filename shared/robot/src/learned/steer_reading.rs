//! What a steering angle of one observation says of its servo.

use vigil_blocks::WHEELS;
use vigil_inference::ages::WhitenedResidual;
use vigil_inference::logspace::{log_add, log_normal};
use vigil_inference::outlier::tempered;

use super::wheels::steering_angle;
use super::{Model, NoiseScales, Observation};
use crate::description::Description;

/// Standard deviation of a steering angle of which nothing is known, rad: half of what a servo
/// turns.
pub const ANY_ANGLE_SD_RAD: f64 = 0.3;
/// An angle that does anything is at most so much more likely than one as commanded (natural
/// logarithm): three times what an alarm needs, so that later readings can take it back.
const RATIO_MAX: f64 = 30.0;
/// Share of wheels and servos that do anything, in the unknown. Chosen: one that departs costs the
/// unknown 1.6 nats, one that does not 0.2.
pub const ANYTHING: f64 = 0.2;

/// A steering angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteerReading {
    /// As read, rad.
    pub read_rad: f64,
    /// As commanded, rad.
    pub commanded_rad: f64,
    /// Variance of what is read about the servo's angle, by noise and lag, rad².
    pub variance: f64,
    /// Beyond the tolerance of the commanded angle, rad.
    pub beyond_rad: f64,
    /// Part of the variance that is there while the servo turns, rad².
    passing: f64,
    outlier_rate: f64,
}

impl SteerReading {
    /// Those of an observation whose sensors are so noisy; None of a wheel that is not steered or
    /// was not read.
    #[must_use]
    pub fn all(
        model: &Model,
        robot: &Description,
        observation: &Observation,
        noise: &NoiseScales,
    ) -> [Option<Self>; WHEELS] {
        let extra = model.nominal.steer_sd_rad;
        std::array::from_fn(|wheel| {
            let is_steered = robot.wheels.get(wheel).is_some_and(|wheel| wheel.steered);
            let reading = &observation.steer[wheel];
            if !is_steered || reading.plain == 0 {
                return None;
            }
            let commanded_rad = steering_angle(robot, wheel, observation.command[0]);
            let behind = commanded_rad - steering_angle(robot, wheel, observation.curvature);
            let sd = model.noise.steer_rad * noise.steer[wheel];
            let sample = model.sample_variance(sd, observation.frame_s);
            let noise_variance = observation.mean_variance(sample, reading.plain);
            Some(Self {
                read_rad: reading.mean,
                commanded_rad,
                variance: noise_variance + extra * extra + behind * behind,
                passing: behind * behind,
                beyond_rad: robot.beyond_steer(reading.mean - commanded_rad),
                outlier_rate: noise.outliers.steer[wheel],
            })
        })
    }

    /// What it is off by, as evidence of a bias.
    #[must_use]
    pub fn whitened(&self) -> WhitenedResidual<1> {
        WhitenedResidual::new(
            self.beyond_rad,
            self.variance,
            self.passing,
            self.outlier_rate,
        )
    }

    /// Log-density of the reading if the servo stands at `angle_rad`, known up to a variance, over
    /// that if it stands as commanded.
    #[must_use]
    pub fn log_ratio(&self, angle_rad: f64, variance: f64) -> f64 {
        let density = |apart_rad: f64, variance: f64| {
            let sd = variance.sqrt();
            log_normal(tempered(apart_rad / sd, self.outlier_rate) * sd, variance)
        };
        let off = density(self.read_rad - angle_rad, self.variance + variance);
        off - density(self.beyond_rad, self.variance)
    }

    /// The same if it may be anything; finite.
    #[must_use]
    pub fn log_ratio_any(&self) -> f64 {
        let sd = self.variance.sqrt();
        let apart = tempered(self.beyond_rad / sd, self.outlier_rate) * sd;
        let wide = self.variance + ANY_ANGLE_SD_RAD * ANY_ANGLE_SD_RAD;
        let ratio = log_normal(apart, wide) - log_normal(apart, self.variance);
        ratio.min(RATIO_MAX)
    }

    /// The same if it may be anything or as commanded, whatever it was before.
    #[must_use]
    pub(crate) fn log_ratio_unsure(&self) -> f64 {
        log_add((1.0 - ANYTHING).ln(), ANYTHING.ln() + self.log_ratio_any())
    }
}
