//! Channels that detection and identification may use.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vigil_robot::learned::channels::Channels;

/// Channels that the filters may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub enum Sensors {
    /// Pose and command.
    #[serde(rename = "pose")]
    Pose,
    /// Pose, command, wheel rates and steering angles.
    #[default]
    #[serde(rename = "pose+encoders")]
    PoseEncoders,
    /// Everything that the frames hold and the model knows: yaw rate and motor currents too.
    #[serde(rename = "all")]
    All,
}

impl From<Sensors> for Channels {
    fn from(sensors: Sensors) -> Self {
        match sensors {
            Sensors::Pose => Self::Pose,
            Sensors::PoseEncoders => Self::PoseEncoders,
            Sensors::All => Self::All,
        }
    }
}
