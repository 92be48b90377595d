//! Settings of the diagnosis: `[detector]`, `[monitors]` and `[identifier]` of a graph file.

use std::fmt;

use clap::ValueEnum;
use serde::Deserialize;
use vigil_robot::learned;
use vigil_robot::learned::monitor::Channels;

/// The detection filter.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Detector {
    /// Mean time between false alarms to which the alarm threshold is set, h, 0.01 to 10000. The
    /// model holds the calibration from nominal runs.
    pub false_alarm_interval_h: f64,
    /// Prior rate of faults, 1/h, above 0.
    pub fault_rate_1_h: f64,
    /// Channels used: `pose`, `pose+encoders`, or `all`, which the frames hold and the model knows.
    pub sensors: Sensors,
    /// What a fault is taken for: `learned-bias`, `constant` or `windowed`. The model holds a
    /// calibration for each.
    pub form: Form,
}

impl Default for Detector {
    fn default() -> Self {
        Self {
            false_alarm_interval_h: 24.0,
            fault_rate_1_h: 1.0,
            sensors: Sensors::PoseEncoders,
            form: Form::LearnedBias,
        }
    }
}

/// Channels that the filters may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
pub enum Sensors {
    /// Pose and command.
    #[serde(rename = "pose")]
    Pose,
    /// Pose, command, wheel rates and steering angles.
    #[default]
    #[serde(rename = "pose+encoders")]
    PoseEncoders,
    /// Everything that the frames hold: yaw rate and motor currents too.
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

/// What the detection filter takes a fault for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, ValueEnum)]
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
}

impl From<Form> for learned::Form {
    fn from(form: Form) -> Self {
        match form {
            Form::LearnedBias => Self::LearnedBias,
            Form::Constant => Self::Constant,
            Form::Windowed => Self::Windowed,
        }
    }
}

/// Particles of a sampled identification filter, if the configuration does not say.
pub const PARTICLES: usize = 256;

/// The identification filter.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Identifier {
    /// Filter: `multiple-hypothesis` (sets of faults), or one of those over single faults:
    /// `bootstrap`, `raised`, `adaptive`, `risk-sensitive`, `hierarchical`, `look-ahead`, `imm`.
    pub filter: IdentifierFilter,
    /// Particles of a sampled filter, 32 to 1024, default 256; `look-ahead` has an eighth of them,
    /// `imm` none. Of `multiple-hypothesis`: the most hypotheses kept from one observation to the
    /// next, the most probable ones; default as many as its tables hold, which drops none.
    pub particles: Option<usize>,
    /// Kept frames from which an identification starts, s, 0.5 to 30.
    pub ring_s: f64,
    /// Prior probability that a fault is one that no model describes, 0 to 0.5.
    pub p_unknown: f64,
}

/// An identification filter, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum IdentifierFilter {
    /// Sets of faults and their onsets; `exact` in earlier configurations.
    #[default]
    #[serde(alias = "exact")]
    #[value(alias = "exact")]
    MultipleHypothesis,
    /// The classical particle filter: the model's own transitions.
    Bootstrap,
    /// Faults are tried more often than they occur, and weights pay for it.
    Raised,
    /// The same with a number of particles that follows the belief's spread.
    Adaptive,
    /// As `raised`, and particles stay where a lost track is expensive, by the decision model.
    RiskSensitive,
    /// Faults are tracked together along the fault tree until the data tell them apart.
    Hierarchical,
    /// Every mode is tried on every particle before any is drawn.
    LookAhead,
    /// One Kalman filter per mode, merged.
    Imm,
}

impl fmt::Display for IdentifierFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_name(self, f)
    }
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_name(self, f)
    }
}

/// Writes the name that files and options use.
fn write_name(value: &impl ValueEnum, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let value = value.to_possible_value();
    f.write_str(value.as_ref().map_or("", |value| value.get_name()))
}

impl Default for Identifier {
    fn default() -> Self {
        Self {
            filter: IdentifierFilter::MultipleHypothesis,
            particles: None,
            ring_s: 3.0,
            p_unknown: 0.01,
        }
    }
}

/// Monitors of the pose against the planned pose (Verma, Fernandez, Simmons 2002, section 3).
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Monitors {
    /// Distance of pose and planned pose above which there is an error in position, m, 0.05 to 10;
    /// it ends below half of it.
    pub position_error_m: f64,
    /// A robot that stays within 0.1 m for so long is stopped, s, 0.1 to 60: the error is EPS, else
    /// EPM.
    pub stopped_after_s: f64,
    /// LD: the robot is this near to where it was before, though its plan is not, m, 0.05 to 5.
    pub loop_radius_m: f64,
    /// LD: travel between the two, m, above twice `loop_radius_m`, to 30.
    pub loop_travel_m: f64,
    /// SD: turn beyond the planned one, rad, 1 to 100.
    pub spin_turn_rad: f64,
    /// SD: within this radius, m, 0.05 to 5.
    pub spin_radius_m: f64,
}

impl Default for Monitors {
    fn default() -> Self {
        Self {
            position_error_m: 0.5,
            stopped_after_s: 2.0,
            loop_radius_m: 0.3,
            loop_travel_m: 3.0,
            spin_turn_rad: 6.3,
            spin_radius_m: 0.5,
        }
    }
}
