//! The source of poses, healthy and disturbed.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_robot::{Disturbance, DisturbanceKind};

use crate::active_disturbances::ActiveDisturbances;
use crate::delay_line::DelayLine;

/// What the pose sensor makes of the true pose: it scales, drifts, jumps, is late, repeats itself,
/// and misses.
#[derive(Debug, Clone)]
pub(crate) struct PoseSensor {
    /// Position from which distances are scaled, m.
    anchor_m: [f64; 2],
    /// Direction of the drift, rad, and how far it has come, m.
    drift_heading_rad: f64,
    drift_m: f64,
    yaw_drift_rad: f64,
    /// Direction of the jump, rad.
    jump_heading_rad: f64,
    /// Since when it repeats a pose, s, and which.
    held: Option<(f64, [f64; 3])>,
    past: DelayLine<3>,
    rng: Pcg64Mcg,
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

    /// `dt_s` pass.
    pub(crate) fn advance(&mut self, dt_s: f64, on: &ActiveDisturbances) {
        self.drift_m += dt_s * on.at(DisturbanceKind::PoseDrift, 0).unwrap_or(0.0);
        self.yaw_drift_rad += dt_s * on.at(DisturbanceKind::YawRateBias, 0).unwrap_or(0.0);
    }

    /// The reading at `t_s` without noise, for the true `pose`, which is not late.
    pub(crate) fn distort(&self, pose: [f64; 3], on: &ActiveDisturbances) -> [f64; 3] {
        let [mut x, mut y, mut yaw] = pose;
        if let Some(scale) = on.at(DisturbanceKind::PoseScale, 0) {
            x = self.anchor_m[0] + scale * (x - self.anchor_m[0]);
            y = self.anchor_m[1] + scale * (y - self.anchor_m[1]);
        }
        if on.at(DisturbanceKind::PoseDrift, 0).is_some() {
            let (sin, cos) = self.drift_heading_rad.sin_cos();
            x += self.drift_m * cos;
            y += self.drift_m * sin;
        }
        if let Some(jump_m) = on.at(DisturbanceKind::PoseJump, 0) {
            let (sin, cos) = self.jump_heading_rad.sin_cos();
            x += jump_m * cos;
            y += jump_m * sin;
        }
        if on.at(DisturbanceKind::YawRateBias, 0).is_some() {
            yaw += self.yaw_drift_rad;
        }
        [x, y, yaw]
    }

    /// What is reported at `t_s` where an undelayed sensor reports `reading`; `None` if the pose is
    /// missing.
    pub(crate) fn report(
        &mut self,
        t_s: f64,
        reading: [f64; 3],
        on: &ActiveDisturbances,
    ) -> Option<[f64; 3]> {
        self.past.push(t_s, reading);
        let share = on.at(DisturbanceKind::PoseDrop, 0).unwrap_or(0.0);
        if share > 0.0 && self.rng.random::<f64>() < share {
            return None;
        }
        let pose = match on.at(DisturbanceKind::PoseDelay, 0) {
            Some(delay_s) => self.past.delayed(t_s, delay_s),
            None => reading,
        };
        let Some(hold_s) = on.at(DisturbanceKind::PoseHeld, 0) else {
            return Some(pose);
        };
        let held = self.held.filter(|(since_s, _)| t_s - since_s < hold_s);
        let (_, pose) = *self.held.insert(held.unwrap_or((t_s, pose)));
        Some(pose)
    }
}
