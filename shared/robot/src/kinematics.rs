//! Ideal kinematics: wheel rates and steering angles without slip, and the motion of a pose.
//!
//! Body frame as in REP-103: x forward, y left, yaw counter-clockwise; a left turn has positive
//! curvature.

use std::f64::consts::{PI, TAU};

use crate::description::{Description, Kinematics};

/// Wheels of the six-wheel rover.
pub const ROVER_WHEELS: usize = 6;

/// Why a description is not a six-wheel rover.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GeometryError {
    /// Wrong number of wheels.
    #[error("{robot} has {found} wheels: this model needs exactly {ROVER_WHEELS}")]
    Wheels {
        /// Name of the robot.
        robot: String,
        /// Number of its wheels.
        found: usize,
    },
    /// Three wheels a side are needed, one behind the other.
    #[error(
        "{robot} has {left} wheels with y above 0 and {right} below: this model needs three a \
         side, at three different x"
    )]
    Sides {
        /// Name of the robot.
        robot: String,
        /// Wheels on the left.
        left: usize,
        /// Wheels on the right.
        right: usize,
    },
    /// The bogie's pivot must lie between the wheels that it carries, the rocker's before it and
    /// behind the front wheel.
    #[error(
        "on the {side} of {robot} the wheels at x = {front}, {middle}, {rear} m do not stand \
         around the pivots at x = {rocker} m (rocker) and {bogie} m (bogie)"
    )]
    Pivots {
        /// Name of the robot.
        robot: String,
        /// `left` or `right`.
        side: &'static str,
        /// x of the front wheel, m.
        front: f64,
        /// x of the middle wheel, m.
        middle: f64,
        /// x of the rear wheel, m.
        rear: f64,
        /// x of the rocker's pivot, m.
        rocker: f64,
        /// x of the bogie's pivot, m.
        bogie: f64,
    },
    /// The pivots are so high, or the wheels so close, that traction would tip the linkage over.
    #[error(
        "on the {side} of {robot} the pivots at {rocker} m (rocker) and {bogie} m (bogie) height \
         are not finite, or too high for the wheels' distances: traction would tip the linkage"
    )]
    Tips {
        /// Name of the robot.
        robot: String,
        /// `left` or `right`.
        side: &'static str,
        /// Height of the rocker's pivot, m.
        rocker: f64,
        /// Height of the bogie's pivot, m.
        bogie: f64,
    },
    /// A table is missing.
    #[error("{robot} has no table [{table}]: the equilibrium of its wheels needs it")]
    Table {
        /// Name of the robot.
        robot: String,
        /// Which.
        table: &'static str,
    },
    /// A length or the mass is not a positive, finite number.
    #[error("{robot}: {quantity} is {found}: allowed is any finite number{allowed}")]
    Quantity {
        /// Name of the robot.
        robot: String,
        /// Which quantity.
        quantity: &'static str,
        /// Its value.
        found: f64,
        /// Restriction beyond finiteness.
        allowed: &'static str,
    },
}

/// Commands to servos and motors, in the order of the robot's description.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WheelTargets {
    /// Steering angle, rad; 0 for wheels without a servo.
    pub steer_rad: [f64; ROVER_WHEELS],
    /// Wheel rate, rad/s; positive drives forward.
    pub rate_rad_s: [f64; ROVER_WHEELS],
}

/// Ackermann steering of six wheels about one common centre of turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ackermann6 {
    /// Contact points, forward, m.
    pub x_m: [f64; ROVER_WHEELS],
    /// Contact points, left, m.
    pub y_m: [f64; ROVER_WHEELS],
    /// Which wheels have a servo.
    pub steered: [bool; ROVER_WHEELS],
    /// Radius of the wheels, m.
    pub wheel_radius_m: f64,
}

impl Ackermann6 {
    /// The kinematics of `robot`.
    ///
    /// # Errors
    /// [`GeometryError`] if it has not six wheels or a length is impossible.
    pub fn new(robot: &Description) -> Result<Self, GeometryError> {
        let found = robot.wheels.len();
        if found != ROVER_WHEELS {
            let robot = robot.name.clone();
            return Err(GeometryError::Wheels { robot, found });
        }
        let quantity = |quantity, found, allowed| GeometryError::Quantity {
            robot: robot.name.clone(),
            quantity,
            found,
            allowed,
        };
        let radius = robot.wheel_radius_m;
        if !(radius.is_finite() && radius > 0.0) {
            return Err(quantity("wheel_radius_m", radius, " above 0"));
        }
        let mut this = Self {
            x_m: [0.0; ROVER_WHEELS],
            y_m: [0.0; ROVER_WHEELS],
            steered: [false; ROVER_WHEELS],
            wheel_radius_m: radius,
        };
        for (i, wheel) in robot.wheels.iter().enumerate() {
            for (name, value) in [("x of a wheel", wheel.x), ("y of a wheel", wheel.y)] {
                if !value.is_finite() {
                    return Err(quantity(name, value, ""));
                }
            }
            (this.x_m[i], this.y_m[i], this.steered[i]) = (wheel.x, wheel.y, wheel.steered);
        }
        Ok(this)
    }

    /// Steering angles and wheel rates for a body centre that moves at `speed_m_s` (backward if
    /// negative) along a path of signed curvature `curvature_1_m`.
    ///
    /// With R = 1/curvature outside the wheels this is delta = atan2(X sgn R, (R - Y) sgn R) and
    /// rate = v hypot(X, R - Y) / (|R| r_w), written without a pole at straight ahead. A wheel
    /// without a servo rolls at the forward part of its hub's velocity.
    #[must_use]
    pub fn targets(&self, curvature_1_m: f64, speed_m_s: f64) -> WheelTargets {
        // The pair of the check in `new`: a rate divides by the radius.
        assert!(
            self.wheel_radius_m > 0.0,
            "the radius of a wheel is above 0"
        );
        let mut targets = WheelTargets::default();
        for i in 0..ROVER_WHEELS {
            // Hub velocity over the speed of the centre.
            let forward = 1.0 - curvature_1_m * self.y_m[i];
            let left = curvature_1_m * self.x_m[i];
            let rolling = if self.steered[i] {
                targets.steer_rad[i] = left.atan2(forward);
                left.hypot(forward)
            } else {
                forward
            };
            targets.rate_rad_s[i] = speed_m_s * rolling / self.wheel_radius_m;
        }
        targets
    }
}

/// Moves `pose` (x m, y m, yaw rad) by a constant body velocity (forward m/s, left m/s,
/// yaw rate rad/s) over `dt_s`, along the heading halfway. The yaw is not wrapped.
#[must_use]
pub fn advance(pose: [f64; 3], velocity: [f64; 3], dt_s: f64) -> [f64; 3] {
    let (sin, cos) = (pose[2] + 0.5 * velocity[2] * dt_s).sin_cos();
    [
        pose[0] + (velocity[0] * cos - velocity[1] * sin) * dt_s,
        pose[1] + (velocity[0] * sin + velocity[1] * cos) * dt_s,
        pose[2] + velocity[2] * dt_s,
    ]
}

/// The same angle within [-π, π], rad.
#[must_use]
pub fn wrap_angle(angle_rad: f64) -> f64 {
    if (-PI..=PI).contains(&angle_rad) {
        return angle_rad;
    }
    let turned = (angle_rad + PI).rem_euclid(TAU) - PI;
    turned.clamp(-PI, PI)
}

/// Speed of a wheel's contact along the direction that it is driven in, as factors of the body's
/// velocity forward and left (m/s) and its yaw rate (rad/s); none for a wheel that is steered, or
/// without a geometry.
#[must_use]
pub fn contact_factors(robot: &Description, wheel: usize) -> Option<[f64; 3]> {
    let at = robot.wheels.get(wheel)?;
    match robot.kinematics {
        Kinematics::Differential => Some([1.0, 0.0, -at.y]),
        Kinematics::Omni3 => {
            let reach = at.x.hypot(at.y).max(1e-9);
            Some([-at.y / reach, at.x / reach, reach])
        }
        Kinematics::Ackermann6 | Kinematics::None => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rover() -> Ackermann6 {
        Ackermann6 {
            x_m: [0.35, 0.0, -0.35, 0.35, 0.0, -0.35],
            y_m: [0.30, 0.30, 0.30, -0.30, -0.30, -0.30],
            steered: [true, false, true, true, false, true],
            wheel_radius_m: 0.08,
        }
    }

    #[test]
    fn a_left_turn_of_two_metres_follows_the_ackermann_formula() {
        let targets = rover().targets(0.5, 0.2);
        let (inner, outer) = (f64::atan2(0.35, 1.7), f64::atan2(0.35, 2.3));
        let steer = [inner, 0.0, -inner, outer, 0.0, -outer];
        for (i, steer) in steer.into_iter().enumerate() {
            assert!((targets.steer_rad[i] - steer).abs() < 1e-12);
            let side = if i < 3 { 1.7 } else { 2.3 };
            let from_centre = if i % 3 == 1 {
                side
            } else {
                f64::hypot(0.35, side)
            };
            let rate = 0.2 * 0.5 * from_centre / 0.08;
            assert!((targets.rate_rad_s[i] - rate).abs() < 1e-12);
        }
    }

    #[test]
    #[should_panic(expected = "the radius of a wheel is above 0")]
    fn a_radius_that_was_not_checked_would_end_the_process() {
        let wheel_radius_m = 0.0;
        let rover = Ackermann6 {
            wheel_radius_m,
            ..rover()
        };
        let _ = rover.targets(0.1, 0.2);
    }

    #[test]
    fn straight_ahead_no_wheel_is_steered_and_all_roll_alike() {
        let targets = rover().targets(0.0, 0.2);
        assert_eq!(targets.steer_rad, [0.0; 6]);
        assert_eq!(targets.rate_rad_s, [2.5; 6]);
    }

    #[test]
    fn no_wheel_slips_sideways_or_forward_when_the_body_follows_the_targets() {
        let rover = rover();
        for curvature in [-1.0, -0.3, -1e-6, 0.0, 0.2, 1.1] {
            let (speed, targets) = (0.3, rover.targets(curvature, 0.3));
            for i in 0..6 {
                let omega = speed * curvature;
                let hub = (speed - omega * rover.y_m[i], omega * rover.x_m[i]);
                let (sin, cos) = targets.steer_rad[i].sin_cos();
                let rolling = targets.rate_rad_s[i] * rover.wheel_radius_m;
                assert!((hub.1 * cos - hub.0 * sin).abs() < 1e-12);
                assert!((hub.0 * cos + hub.1 * sin - rolling).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_full_circle_in_small_steps_returns_to_its_start() {
        // 1000 chords of a circle: a regular polygon closes exactly.
        let dt_s = std::f64::consts::TAU / 0.1 / 1000.0;
        let mut pose = [0.0; 3];
        for _ in 0..1000 {
            pose = advance(pose, [0.2, 0.0, 0.1], dt_s);
        }
        assert!(pose[0].abs() < 1e-12 && pose[1].abs() < 1e-12, "{pose:?}");
        assert!(wrap_angle(pose[2]).abs() < 1e-12);
    }

    #[test]
    fn angles_wrap_into_half_a_turn_either_way() {
        for (angle, expected) in [
            (0.5, 0.5),
            (3.5, 3.5 - TAU),
            (-3.5, TAU - 3.5),
            (13.0, 13.0 - 2.0 * TAU),
        ] {
            assert!((wrap_angle(angle) - expected).abs() < 1e-12);
        }
        assert_eq!(wrap_angle(PI), PI);
        assert_eq!(wrap_angle(-PI), -PI);
    }
}
