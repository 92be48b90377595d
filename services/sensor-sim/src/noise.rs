//! White sensor noise of equal information per second at any rate.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use vigil_robot::description::SensorNoise;

/// Draws the noise of one robot's sensors.
///
/// The description gives standard deviations per sample at a reference rate. Averaging all samples
/// of a second divides the variance by the rate; it is the same at any rate if the deviation grows
/// with the root of the rate.
#[derive(Debug, Clone)]
pub(crate) struct Noise {
    /// Position, m.
    pub(crate) position_m: f64,
    /// Yaw, rad.
    pub(crate) yaw_rad: f64,
    /// Yaw rate, rad/s.
    pub(crate) yaw_rate_rad_s: f64,
    /// Wheel rate, rad/s.
    pub(crate) wheel_rate_rad_s: f64,
    /// Steering angle, rad.
    pub(crate) steer_rad: f64,
    /// Motor current, A.
    pub(crate) current_a: f64,
    rng: Pcg64Mcg,
}

impl Noise {
    pub(crate) fn new(noise: &SensorNoise, rate_hz: f64, scale: f64, seed: u64) -> Self {
        let factor = scale * (rate_hz / noise.reference_rate_hz).sqrt();
        Self {
            position_m: factor * noise.position_m,
            yaw_rad: factor * noise.yaw_rad,
            yaw_rate_rad_s: factor * noise.yaw_rate_rad_s,
            wheel_rate_rad_s: factor * noise.wheel_rate_rad_s,
            steer_rad: factor * noise.steer_rad,
            current_a: factor * noise.current_a,
            rng: Pcg64Mcg::seed_from_u64(seed),
        }
    }

    /// One sample with the given standard deviation.
    pub(crate) fn draw(&mut self, deviation: f64) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.rng);
        deviation * unit
    }
}
