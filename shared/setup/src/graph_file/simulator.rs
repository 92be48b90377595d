//! `[simulator]` and `[[drive]]`: the simulated world, and what the rover drives in it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

/// One piece of the simulated drive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveSegment {
    /// Duration.
    #[schemars(range(min = 0.01, max = 1e6))]
    pub duration_s: f64,
    /// Signed curvature (left positive), within the robot's limits.
    pub curvature_1_m: f64,
    /// Speed, within the robot's limits.
    #[schemars(range(min = 0.0))]
    pub speed_m_s: f64,
}

/// The simulated world.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Simulator {
    /// Friction coefficient of the soil.
    #[default(0.65)]
    #[schemars(range(min = 0.1, max = 2.0))]
    pub friction: f64,
    /// Janosi shear modulus of the soil, as relative slip.
    #[default(0.20)]
    #[schemars(range(min = 0.02, max = 2.0))]
    pub shear_modulus: f64,
    /// Relative standard deviation of friction along the path.
    #[default(0.08)]
    #[schemars(range(min = 0.0, max = 0.5))]
    pub friction_scatter: f64,
    /// Correlation length of that scatter.
    #[default(0.2)]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub scatter_length_m: f64,
    /// Time constant of the body's velocity.
    #[default(0.1)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lag_s: f64,
    /// Factor on the sensor noise of the robot's description.
    #[default(1.0)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub noise_scale: f64,
}
