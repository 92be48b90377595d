//! The rover's mechanics as its description gives them: motors, linkage, ground.
//!
//! The equilibrium of forces (module `slip`) computes with them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Drive motors: torque = `gain` (commanded rate - rate), limited; bearing friction against it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Motor {
    /// Gain of the rate controller, N m s/rad.
    pub gain_n_m_s: f64,
    /// Largest torque, N m. Traction alone cannot reach it on soils up to a friction of about 1.
    pub torque_max_n_m: f64,
    /// Dry friction of the bearing, N m.
    pub dry_friction_n_m: f64,
    /// Viscous friction of the bearing, N m s/rad.
    pub viscous_friction_n_m_s: f64,
}

/// Pivots of the linkage, m, in `base_link` (z up from the ground); the same on both sides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RockerBogie {
    /// Rocker pivot, forward.
    pub rocker_x_m: f64,
    /// Rocker pivot, height.
    pub rocker_z_m: f64,
    /// Bogie pivot, forward.
    pub bogie_x_m: f64,
    /// Bogie pivot, height.
    pub bogie_z_m: f64,
}

/// The ground on which a robot's equilibria are solved: that of the runs which its model learned
/// from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ground {
    /// Friction coefficient.
    pub friction: f64,
    /// Shear modulus: relative slip at which 63 % of the friction is reached.
    pub shear_modulus: f64,
}
