//! Wheel encoders, healthy, disturbed and broken.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_robot::kinematics::ROVER_WHEELS;
use vigil_robot::{DisturbanceKind, FaultKind};

use crate::active_disturbances::ActiveDisturbances;
use crate::delay_line::DelayLine;

/// Smallest rate that a noisy encoder reports, rad/s.
pub const NOISE_MIN_RAD_S: f64 = -4.0;
/// Rate that a noisy encoder stays below, rad/s.
pub const NOISE_MAX_RAD_S: f64 = 8.0;

/// The wheel encoders, healthy, disturbed and broken.
#[derive(Debug, Clone)]
pub(crate) struct Encoders {
    fault: [Option<FaultKind>; ROVER_WHEELS],
    last_rad_s: [Option<f64>; ROVER_WHEELS],
    /// Sum of the drifts so far.
    drifted_rad_s: [f64; ROVER_WHEELS],
    past: DelayLine<ROVER_WHEELS>,
    rng: Pcg64Mcg,
}

impl Encoders {
    pub(crate) fn new(rate_hz: f64, seed: u64) -> Self {
        Self {
            past: DelayLine::new(rate_hz),
            fault: [None; ROVER_WHEELS],
            last_rad_s: [None; ROVER_WHEELS],
            drifted_rad_s: [0.0; ROVER_WHEELS],
            rng: Pcg64Mcg::seed_from_u64(seed),
        }
    }

    /// Starts an encoder's fault (`Some`), or ends it.
    pub(crate) fn set(&mut self, wheel: usize, fault: Option<FaultKind>) {
        self.fault[wheel] = fault;
    }

    /// True while one is broken.
    pub(crate) fn is_broken(&self) -> bool {
        self.fault.iter().any(Option::is_some)
    }

    /// Advances the drifts by `dt_s`.
    pub(crate) fn advance(&mut self, dt_s: f64, active: &ActiveDisturbances) {
        for (wheel, drifted) in self.drifted_rad_s.iter_mut().enumerate() {
            *drifted = match active.at(DisturbanceKind::EncoderDrift, wheel) {
                Some(rad_s2) => *drifted + rad_s2 * dt_s,
                None => 0.0,
            };
        }
    }

    /// The rate measured, before noise, of a wheel that turns at `rate_rad_s`.
    pub(crate) fn scaled(&self, wheel: usize, rate_rad_s: f64, active: &ActiveDisturbances) -> f64 {
        let of = |kind, otherwise| active.at(kind, wheel).unwrap_or(otherwise);
        let bias_rad_s = of(DisturbanceKind::EncoderBias, 0.0);
        let scaled = of(DisturbanceKind::EncoderScale, 1.0) * rate_rad_s;
        let is_drifting = active.at(DisturbanceKind::EncoderDrift, wheel).is_some();
        let drifted_rad_s = if is_drifting {
            self.drifted_rad_s[wheel]
        } else {
            0.0
        };
        scaled + bias_rad_s + drifted_rad_s
    }

    /// Measurements at `t_s` where encoders without delay and fault would measure `healthy_rad_s`.
    pub(crate) fn report(
        &mut self,
        t_s: f64,
        healthy_rad_s: [f64; ROVER_WHEELS],
        active: &ActiveDisturbances,
    ) -> [f64; ROVER_WHEELS] {
        self.past.push(t_s, healthy_rad_s);
        std::array::from_fn(|wheel| {
            let delayed = match active.at(DisturbanceKind::EncoderDelay, wheel) {
                Some(delay_s) => self.past.delayed(t_s, delay_s)[wheel],
                None => healthy_rad_s[wheel],
            };
            self.one(wheel, delayed)
        })
    }

    /// Measurement of encoder `wheel` where one without fault would measure `healthy_rad_s`.
    fn one(&mut self, wheel: usize, healthy_rad_s: f64) -> f64 {
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
