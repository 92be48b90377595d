//! The pose sensor, healthy and disturbed.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_robot::{Disturbance, DisturbanceKind};

use crate::active_disturbances::ActiveDisturbances;
use crate::delay_line::DelayLine;

/// Measures the true pose. Disturbances scale it, let it drift, jump, come late, repeat or drop
/// out.
#[derive(Debug, Clone)]
pub(crate) struct PoseSensor {
    /// Position from which distances are scaled, m.
    anchor_m: [f64; 2],
    /// Direction of the drift, rad, and its length so far, m.
    drift_heading_rad: f64,
    drift_m: f64,
    yaw_drift_rad: f64,
    /// Direction of the jump, rad.
    jump_heading_rad: f64,
    /// The pose that is repeated.
    held: Option<HeldPose>,
    past: DelayLine<3>,
    rng: Pcg64Mcg,
}

/// A pose that is repeated.
#[derive(Debug, Clone, Copy)]
struct HeldPose {
    since_s: f64,
    pose: [f64; 3],
}

impl PoseSensor {
    pub(crate) fn new(rate_hz: f64, seed: u64) -> Self {
        Self {
            anchor_m: [0.0; 2],
            drift_heading_rad: 0.0,
            drift_m: 0.0,
            yaw_drift_rad: 0.0,
            jump_heading_rad: 0.0,
            held: None,
            past: DelayLine::new(rate_hz),
            rng: Pcg64Mcg::seed_from_u64(seed),
        }
    }

    /// A disturbance begins while the rover is at `pose`.
    pub(crate) fn begin(&mut self, disturbance: &Disturbance, pose: [f64; 3]) {
        match disturbance.kind {
            DisturbanceKind::PoseScale => self.anchor_m = [pose[0], pose[1]],
            DisturbanceKind::PoseDrift => {
                self.drift_heading_rad = pose[2] + std::f64::consts::FRAC_PI_2;
                self.drift_m = 0.0;
            }
            DisturbanceKind::YawRateBias => self.yaw_drift_rad = 0.0,
            DisturbanceKind::PoseJump => {
                self.jump_heading_rad = pose[2] + std::f64::consts::FRAC_PI_2;
            }
            DisturbanceKind::PoseHeld => self.held = None,
            _ => {}
        }
    }

    /// Advances the drifts by `dt_s`.
    pub(crate) fn advance(&mut self, dt_s: f64, active: &ActiveDisturbances) {
        self.drift_m += dt_s * active.at(DisturbanceKind::PoseDrift, 0).unwrap_or(0.0);
        self.yaw_drift_rad += dt_s * active.at(DisturbanceKind::YawRateBias, 0).unwrap_or(0.0);
    }

    /// The measurement of the true `pose` without noise and delay.
    pub(crate) fn distort(&self, pose: [f64; 3], active: &ActiveDisturbances) -> [f64; 3] {
        let [mut x, mut y, mut yaw] = pose;
        if let Some(scale) = active.at(DisturbanceKind::PoseScale, 0) {
            x = self.anchor_m[0] + scale * (x - self.anchor_m[0]);
            y = self.anchor_m[1] + scale * (y - self.anchor_m[1]);
        }
        if active.at(DisturbanceKind::PoseDrift, 0).is_some() {
            let (sin, cos) = self.drift_heading_rad.sin_cos();
            x += self.drift_m * cos;
            y += self.drift_m * sin;
        }
        if let Some(jump_m) = active.at(DisturbanceKind::PoseJump, 0) {
            let (sin, cos) = self.jump_heading_rad.sin_cos();
            x += jump_m * cos;
            y += jump_m * sin;
        }
        if active.at(DisturbanceKind::YawRateBias, 0).is_some() {
            yaw += self.yaw_drift_rad;
        }
        [x, y, yaw]
    }

    /// The measurement at `t_s` where a sensor without delay would report `reading`; `None` if it
    /// drops out.
    pub(crate) fn report(
        &mut self,
        t_s: f64,
        reading: [f64; 3],
        active: &ActiveDisturbances,
    ) -> Option<[f64; 3]> {
        self.past.push(t_s, reading);
        let share = active.at(DisturbanceKind::PoseDrop, 0).unwrap_or(0.0);
        if share > 0.0 && self.rng.random::<f64>() < share {
            return None;
        }
        let pose = match active.at(DisturbanceKind::PoseDelay, 0) {
            Some(delay_s) => self.past.delayed(t_s, delay_s),
            None => reading,
        };
        let Some(hold_s) = active.at(DisturbanceKind::PoseHeld, 0) else {
            return Some(pose);
        };
        let held = self.held.filter(|held| t_s - held.since_s < hold_s);
        let fresh = HeldPose { since_s: t_s, pose };
        Some(self.held.insert(held.unwrap_or(fresh)).pose)
    }
}
