//! What is not as built: bent steering, weak motors, shrunken wheels, soil that resists rolling,
//! and forces from outside.

use super::shear::{HubVelocity, RESISTANCE_SMOOTHING_M_S};
use crate::chassis::RockerBogie;
use crate::kinematics::{Ackermann6, ROVER_WHEELS};

/// One wheel. The default is as built.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelCondition {
    /// Angle at which the servo stands whatever it is told, rad.
    pub steer_held_rad: Option<f64>,
    /// Angle beyond that or the commanded steering, rad.
    pub steer_offset_rad: f64,
    /// Share of the motor's gain and torque limit that is left, 0..1.
    pub torque_share: f64,
    /// Share of the radius that is left, above 0.
    pub radius_share: f64,
    /// Rolling resistance beyond the bearing's: force along the wheel per unit of load. It acts on
    /// the hub, from the soil in front of the wheel, and does not load the motor directly.
    pub resistance: f64,
    /// Force on the body above the wheel, against its motion there, N.
    pub drag_n: f64,
}

impl Default for WheelCondition {
    fn default() -> Self {
        Self {
            steer_held_rad: None,
            steer_offset_rad: 0.0,
            torque_share: 1.0,
            radius_share: 1.0,
            resistance: 0.0,
            drag_n: 0.0,
        }
    }
}

/// The whole rover. The default is as built, on level ground.
///
/// Forces from outside act at the height of the rocker's pivot, where the rover's mass is taken to
/// lie: there they shift no load along a side, and between the sides by their moment about the
/// direction of travel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Condition {
    /// The wheels.
    pub wheels: [WheelCondition; ROVER_WHEELS],
    /// Force on the body's centre: forward N, left N, without gravity's.
    pub force_n: [f64; 2],
    /// Rise of the ground ahead, rad.
    pub slope_rad: f64,
    /// Rise of the ground to the left, rad.
    pub side_slope_rad: f64,
    /// Centre of mass off the body's centre: forward m, left m.
    pub mass_offset_m: [f64; 2],
}

impl Condition {
    /// True if every number is finite and every share possible.
    pub(super) fn is_possible(&self) -> bool {
        let whole = [
            self.force_n[0],
            self.force_n[1],
            self.slope_rad,
            self.side_slope_rad,
            self.mass_offset_m[0],
            self.mass_offset_m[1],
        ];
        whole.iter().all(|value| value.is_finite())
            && self.wheels.iter().all(|wheel| {
                wheel.steer_held_rad.is_none_or(f64::is_finite)
                    && wheel.steer_offset_rad.is_finite()
                    && (0.0..=1.0).contains(&wheel.torque_share)
                    && wheel.radius_share.is_finite()
                    && wheel.radius_share > 0.0
                    && wheel.resistance.is_finite()
                    && wheel.drag_n.is_finite()
            })
    }

    /// Components of gravity for a weight: forward, left, and onto the ground, N.
    fn gravity_n(&self, weight_n: f64) -> [f64; 3] {
        let (ahead, left) = (self.slope_rad.sin(), self.side_slope_rad.sin());
        let normal = (1.0 - ahead * ahead - left * left).max(0.0).sqrt();
        [-weight_n * ahead, -weight_n * left, weight_n * normal]
    }

    /// Forces and moment about the body's centre from outside but for drag: N, N, N m.
    pub(super) fn wrench(&self, weight_n: f64) -> [f64; 3] {
        let [ahead, left, _] = self.gravity_n(weight_n);
        let [x, y] = self.mass_offset_m;
        [
            ahead + self.force_n[0],
            left + self.force_n[1],
            x * left - y * ahead,
        ]
    }

    /// Load on the left and on the right side, N: moments about the direction of travel.
    pub(super) fn sides_n(
        &self,
        weight_n: f64,
        linkage: &RockerBogie,
        kinematics: &Ackermann6,
        sides: &[[usize; 3]; 2],
    ) -> [f64; 2] {
        let [_, left, normal] = self.gravity_n(weight_n);
        let middle = |side: &[usize; 3]| side.iter().map(|&i| kinematics.y_m[i]).sum::<f64>() / 3.0;
        let [left_m, right_m] = [middle(&sides[0]), middle(&sides[1])];
        let tilting = (left + self.force_n[1]) * linkage.rocker_z_m;
        let moment = normal * (self.mass_offset_m[1] - right_m) + tilting;
        let on_left = (moment / (left_m - right_m)).clamp(0.0, normal);
        [on_left, normal - on_left]
    }
}

impl WheelCondition {
    /// Drag on the body for the velocity of the body above the wheel: forward N, left N.
    pub(super) fn drag(&self, hub: HubVelocity) -> [f64; 2] {
        if self.drag_n == 0.0 {
            return [0.0; 2];
        }
        let (forward, left) = (hub.forward_m_s, hub.left_m_s);
        let floor = RESISTANCE_SMOOTHING_M_S;
        let speed = (forward * forward + left * left + floor * floor).sqrt();
        [-self.drag_n * forward / speed, -self.drag_n * left / speed]
    }
}
