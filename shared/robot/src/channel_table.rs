//! A channel that a robot's description names in a `[[channel]]` table.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a channel measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Position x in a continuous frame, m.
    PoseX,
    /// Position y, m.
    PoseY,
    /// Yaw, rad, counter-clockwise, wrapped to ±π.
    PoseYaw,
    /// Rate of the body about an axis, such as a gyro's yaw rate, rad/s.
    BodyRate,
    /// Rate of a wheel, rad/s.
    WheelRate,
    /// Angle of a steered wheel, rad.
    SteeringAngle,
    /// Electric current, A.
    Current,
    /// Electric voltage, V.
    Voltage,
    /// Acceleration of the body along an axis, m/s².
    Acceleration,
    /// An attitude angle or a component of a quaternion.
    Attitude,
    /// What a controller wanted less what it got.
    TrackingError,
    /// Anything else.
    #[default]
    Other,
}

/// A channel beside those of pose and wheels: a `[[channel]]` table of a robot's description.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FurtherChannel {
    /// Name: of its column in recorded frames, in messages, and for publishers.
    pub name: String,
    /// What it measures.
    #[serde(default)]
    pub role: Role,
    /// Unit, for messages: `m/s2`, `V`; empty if it has none.
    #[serde(default)]
    pub unit: String,
    /// Largest magnitude that it can measure, in that unit; left out: any finite number. A frame
    /// with ten times as much is refused.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub limit: Option<f64>,
    /// Standard deviation of its white noise per sample, in that unit; left out: learned.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub noise: Option<f64>,
    /// What it comes back to the same after, in that unit: 360 for a heading error in degrees. Its
    /// readings then count within half of that on either side of 0; left out: it is no angle.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub period: Option<f64>,
    /// How far a healthy robot may depart from its model in it, in that unit; left out: learned.
    #[serde(default)]
    #[schemars(range(min = 0))]
    pub tolerance: Option<f64>,
    /// Whether its level wanders without a fault, as that of a battery: then only changes within a
    /// minute count. Left out: true for a voltage.
    #[serde(default)]
    pub drifts: Option<bool>,
}
