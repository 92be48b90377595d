//! What the detector obeys: `[detector]` and `[monitors]` of a graph file.

use std::fmt;

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use vigil_robot::declared::Null;
use vigil_robot::learned;

use crate::sensors::Sensors;

/// The detection filter.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Mean time between false alarms to which the alarm threshold is set. The model holds the
    /// calibration from nominal runs.
    #[default(24.0)]
    #[schemars(range(min = 0.01, max = 1e4))]
    pub false_alarm_interval_h: f64,
    /// Prior rate of faults.
    #[default(1.0)]
    #[schemars(range(min = 1e-9, max = 3600.0))]
    pub fault_rate_1_h: f64,
    /// Channels that detector and identifier use.
    pub sensors: Sensors,
    /// What a fault is taken for. The model holds a calibration for each but `e-detector`.
    pub form: Form,
    /// What the form `e-detector` takes for healthy, beside the robot's tolerances.
    pub null: NullSettings,
}

/// The noise under which the form `e-detector` keeps its promise: the largest that is healthy.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NullSettings {
    /// Largest deviation of a sensor's noise over the learned one.
    #[default(1.25)]
    #[schemars(range(min = 1.0, max = 10.0))]
    pub noise_ratio: f64,
    /// Largest magnitude of the correlation of noise from one observation to the next.
    #[default(0.1)]
    #[schemars(range(min = 0.0, max = 0.9))]
    pub correlation: f64,
}

impl From<&NullSettings> for Null {
    fn from(settings: &NullSettings) -> Self {
        Self {
            noise_ratio: settings.noise_ratio,
            correlation: settings.correlation,
        }
    }
}

/// What the detection filter takes a fault for.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema, ValueEnum,
)]
#[serde(rename_all = "kebab-case")]
pub enum Form {
    /// An unknown constant bias of the residual, learned; no fault is too small to be seen.
    #[default]
    LearnedBias,
    /// A constant likelihood (Verma, Fernandez, Simmons 2002), for comparison: it never sees faults
    /// below a size.
    Constant,
    /// A constant likelihood over windows of ten observations: that size is ten times smaller.
    Windowed,
    /// What no healthy robot does, by declared tolerances and noise. The mean time between false
    /// alarms has a proof (Shin, Ramdas, Rinaldo 2024) and needs no calibration; alarms come later.
    EDetector,
}

impl Form {
    /// The form whose threshold is calibrated; None for `e-detector`, which has a proof instead.
    #[must_use]
    pub const fn calibrated(self) -> Option<learned::Form> {
        match self {
            Self::LearnedBias => Some(learned::Form::LearnedBias),
            Self::Constant => Some(learned::Form::Constant),
            Self::Windowed => Some(learned::Form::Windowed),
            Self::EDetector => None,
        }
    }
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.to_possible_value();
        f.write_str(value.as_ref().map_or("", |value| value.get_name()))
    }
}

/// Monitors of the pose against the planned pose (Verma, Fernandez, Simmons 2002, section 3).
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MonitorSettings {
    /// Distance of pose and planned pose above which there is an error in position; it ends below
    /// half of it.
    #[default(0.5)]
    #[schemars(range(min = 0.05, max = 10.0))]
    pub position_error_m: f64,
    /// A robot that stays within 0.1 m for this long counts as stopped: its position error is then
    /// EPS, otherwise EPM.
    #[default(2.0)]
    #[schemars(range(min = 0.1, max = 60.0))]
    pub stopped_after_s: f64,
    /// LD: the robot is this near to where it was before, though its plan is not.
    #[default(0.3)]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub loop_radius_m: f64,
    /// LD: travel between the two, at least twice `loop_radius_m`.
    #[default(3.0)]
    #[schemars(range(min = 0.1, max = 30.0))]
    pub loop_travel_m: f64,
    /// SD: turn beyond the planned one.
    #[default(6.3)]
    #[schemars(range(min = 1.0, max = 100.0))]
    pub spin_turn_rad: f64,
    /// SD: radius within which the robot turns.
    #[default(0.5)]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub spin_radius_m: f64,
}
