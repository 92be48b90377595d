//! How a robot's body follows its command.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The body's response, which no log of steady driving shows. `vigil learn` copies it into the
/// model, where the lag is the centre of the range that the detector estimates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Body {
    /// Time constant with which the body follows its command, s.
    #[schemars(range(min = 0.0))]
    pub lag_s: f64,
    /// Factor by which that may be wrong, either way.
    #[schemars(range(min = 1.0))]
    pub lag_uncertainty: f64,
    /// Commanded or driven speed below which the robot stands, m/s.
    #[schemars(range(min = 0.0))]
    pub standing_m_s: f64,
}

impl Default for Body {
    /// A small robot with geared motors. Chosen: a lag of a tenth of a second, to a factor of two
    /// as the load changes it; standing below a tenth of the rover's usual speed.
    fn default() -> Self {
        Self {
            lag_s: 0.1,
            lag_uncertainty: 2.0,
            standing_m_s: 0.02,
        }
    }
}
