//! Wheel encoders, healthy and broken.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_robot::FaultKind;
use vigil_robot::kinematics::ROVER_WHEELS;

/// Smallest rate that a noisy encoder reports, rad/s.
pub const NOISE_MIN_RAD_S: f64 = -4.0;
/// Rate that a noisy encoder stays below, rad/s.
pub const NOISE_MAX_RAD_S: f64 = 8.0;

/// What each encoder makes of a healthy reading.
#[derive(Debug, Clone)]
pub(crate) struct Encoders {
    fault: [Option<FaultKind>; ROVER_WHEELS],
    last_rad_s: [Option<f64>; ROVER_WHEELS],
    rng: Pcg64Mcg,
}

impl Encoders {
    pub(crate) fn new(seed: u64) -> Self {
        Self {
            fault: [None; ROVER_WHEELS],
            last_rad_s: [None; ROVER_WHEELS],
            rng: Pcg64Mcg::seed_from_u64(seed),
        }
    }

    /// Breaks an encoder (`Some`), or mends it.
    pub(crate) fn set(&mut self, wheel: usize, fault: Option<FaultKind>) {
        self.fault[wheel] = fault;
    }

    /// What encoder `wheel` reports when a healthy one would report `healthy_rad_s`.
    pub(crate) fn report(&mut self, wheel: usize, healthy_rad_s: f64) -> f64 {
        let last = &mut self.last_rad_s[wheel];
        let reported = match self.fault[wheel] {
            Some(FaultKind::EncoderZero) => 0.0,
            Some(FaultKind::EncoderFrozen) => last.unwrap_or(healthy_rad_s),
            Some(FaultKind::EncoderNoise) => {
                self.rng.random_range(NOISE_MIN_RAD_S..NOISE_MAX_RAD_S)
            }
            Some(FaultKind::Stuck) | None => healthy_rad_s,
        };
        *last = Some(reported);
        reported
    }
}
