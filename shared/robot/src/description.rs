//! Description of a robot, as read from `config/robots/*.toml`.

use serde::{Deserialize, Serialize};

/// What kind of motion the command vector means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kinematics {
    /// Six wheels on rocker-bogies, corner wheels steered about a common centre; the command is
    /// (signed curvature 1/m, speed m/s).
    Ackermann6,
}

/// One wheel. Lengths in m from `base_link` (ground projection of the centre; x forward, y left).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wheel {
    /// Name, as used in faults and reports (`LF`).
    pub name: String,
    /// Contact point, forward, m.
    pub x: f64,
    /// Contact point, left, m.
    pub y: f64,
    /// True if the wheel has a steering servo.
    pub steered: bool,
}

/// Standard deviations of the sensors' white noise per sample at `reference_rate_hz`. At another
/// rate they scale so that the information per second is the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorNoise {
    /// Rate for which the deviations hold, Hz.
    pub reference_rate_hz: f64,
    /// Position, m.
    pub position_m: f64,
    /// Yaw, rad.
    pub yaw_rad: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Wheel rate, rad/s.
    pub wheel_rate_rad_s: f64,
    /// Steering angle, rad.
    pub steer_rad: f64,
    /// Motor current, A.
    pub current_a: f64,
}

/// Limits beyond which a command or a measurement is impossible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Largest magnitude of commanded curvature, 1/m.
    pub curvature_1_m: f64,
    /// Largest speed, m/s.
    pub speed_m_s: f64,
    /// Largest yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Largest wheel rate that an encoder can report, rad/s.
    pub wheel_rate_rad_s: f64,
}

/// A robot. Wheel order here is the order of every per-wheel array in the blocks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Name of the robot.
    pub name: String,
    /// Kind of motion.
    pub kinematics: Kinematics,
    /// Radius of the wheels, m.
    pub wheel_radius_m: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Wheels, at most [`vigil_blocks::WHEELS`].
    pub wheels: Vec<Wheel>,
    /// Sensor noise.
    pub noise: SensorNoise,
    /// Limits.
    pub limits: Limits,
}

impl Description {
    /// Index of the wheel called `name`.
    #[must_use]
    pub fn wheel_index(&self, name: &str) -> Option<usize> {
        self.wheels.iter().position(|wheel| wheel.name == name)
    }
}
