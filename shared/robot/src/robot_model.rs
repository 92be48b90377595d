//! A learned model: of the rover's kind, or of channels.

use crate::alarm::AlarmError;
use crate::channel_model;
use crate::description::Description;
use crate::learned::channels::Channels;
use crate::learned::model::Provenance;
use crate::learned::{self, Calibration, Form, ModelError};

/// The learned model of a robot.
#[derive(Debug, Clone, PartialEq)]
pub enum RobotModel {
    /// Its nominal behaviour and its faults.
    Faults(Box<learned::Model>),
    /// Its channels, and what faults of its sensors and drives would change of them.
    Channels(Box<channel_model::Model>),
}

impl RobotModel {
    /// Reads and checks a model; one of channels says so by its first key, `kind = "channels"`.
    ///
    /// # Errors
    /// [`ModelError`] naming the key, what was found and what is allowed.
    pub fn from_toml(text: &str) -> Result<Self, ModelError> {
        let is_kind = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with('#');
        let first = text.lines().find(is_kind).unwrap_or("");
        if first.trim_start().starts_with("kind") {
            return Ok(Self::Channels(Box::new(channel_model::Model::from_toml(
                text,
            )?)));
        }
        Ok(Self::Faults(Box::new(learned::Model::from_toml(text)?)))
    }

    /// The model with faults, if it is one.
    #[must_use]
    pub fn with_faults(self) -> Option<learned::Model> {
        match self {
            Self::Faults(model) => Some(*model),
            Self::Channels(_) => None,
        }
    }

    /// Hash over the content; equal for equal models.
    #[must_use]
    pub fn hash(&self) -> u64 {
        match self {
            Self::Faults(model) => model.hash(),
            Self::Channels(model) => model.hash(),
        }
    }

    /// Checks that the model is of this robot.
    ///
    /// # Errors
    /// [`ModelError::Robot`].
    pub fn check_robot(&self, robot: &Description) -> Result<(), ModelError> {
        match self {
            Self::Faults(model) => model.check_robot(robot),
            Self::Channels(model) => model.check_robot(robot),
        }
    }

    /// Where it comes from.
    #[must_use]
    pub fn provenance(&self) -> &Provenance {
        match self {
            Self::Faults(model) => &model.provenance,
            Self::Channels(model) => &model.provenance,
        }
    }

    /// The calibration for a set of channels and a form of detection.
    ///
    /// # Errors
    /// [`ModelError::Calibration`].
    pub fn calibration(&self, channels: Channels, form: Form) -> Result<&Calibration, ModelError> {
        match self {
            Self::Faults(model) => model.calibration(channels, form),
            Self::Channels(model) => model.calibration(channels, form),
        }
    }

    /// Log-odds at which to alarm, so that `interval_h` pass on average between false alarms at a
    /// prior fault rate of `fault_rate_1_h`.
    ///
    /// # Errors
    /// [`AlarmError`].
    pub fn alarm_log_odds(
        &self,
        of: (Channels, Form),
        interval_h: f64,
        fault_rate_1_h: f64,
    ) -> Result<f64, AlarmError> {
        match self {
            Self::Faults(model) => model.alarm_log_odds(of, interval_h, fault_rate_1_h),
            Self::Channels(model) => model.alarm_log_odds(of, interval_h, fault_rate_1_h),
        }
    }

    /// Counter-steering for a stuck wheel, see [`learned::Model::compensation`]; none (1, 0) for a
    /// model of channels.
    #[must_use]
    pub fn compensation(&self, wheel: usize) -> (f64, f64) {
        match self {
            Self::Faults(model) => model.compensation(wheel),
            Self::Channels(_) => (1.0, 0.0),
        }
    }
}
