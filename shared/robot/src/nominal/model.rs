//! The file of a nominal model.

use serde::{Deserialize, Serialize};
use vigil_blocks::{COMMANDS, WHEELS, fnv1a};

use super::channel::{Channel, Tail};
use crate::Description;
use crate::learned::model::{ModelError, Provenance, check_calibration};
use crate::learned::monitor::Channels;
use crate::learned::{Calibration, Form};

/// Version of the file's layout.
pub const VERSION: u32 = 1;
/// The word by which the file is told from a model with faults.
pub const KIND: &str = "nominal";
/// Limits of a file's size.
const CHANNELS_MAX: usize = 2 * WHEELS + 4;
const TERMS_MAX: usize = 128;

/// What was learned of one axis of the command.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Name of the axis.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Smallest value learned from.
    pub min: f64,
    /// Largest value learned from.
    pub max: f64,
}

impl Range {
    /// Size by which the axis is divided in polynomials.
    #[must_use]
    pub fn size(&self) -> f64 {
        self.min.abs().max(self.max.abs()).max(1e-9)
    }

    /// How far a command lies outside the range, in units of its width.
    #[must_use]
    pub fn beyond(&self, value: f64) -> f64 {
        let outside = (self.min - value).max(value - self.max).max(0.0);
        outside / (self.max - self.min).max(1e-9)
    }
}

/// Everything learned about one robot without a fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// `nominal`.
    pub kind: String,
    /// Layout of the file.
    pub version: u32,
    /// Name of the robot.
    pub robot: String,
    /// Names of its wheels, in the order of every per-wheel array.
    pub wheels: Vec<String>,
    /// Interval over which frames are averaged into one observation, s.
    pub interval_s: f64,
    /// Time in motion that was learned from, s.
    pub exposure_s: f64,
    /// Factor by which all deviations were widened because the log is short.
    pub widened: f64,
    /// Where the model comes from.
    pub provenance: Provenance,
    /// Axes of the command, and the ranges learned from.
    pub command: Vec<Range>,
    /// Channels.
    pub channel: Vec<Channel>,
    /// Alarm thresholds, one per set of channels and form of the detection filter.
    pub calibration: Vec<Calibration>,
}

impl Model {
    /// Reads and checks a model.
    ///
    /// # Errors
    /// [`ModelError`] naming the key, what was found and what is allowed.
    pub fn from_toml(text: &str) -> Result<Self, ModelError> {
        let model: Self = toml::from_str(text)
            .map_err(|error| ModelError::Parse(error.message().replace('\n', " ")))?;
        model.check()?;
        Ok(model)
    }

    /// The file's text.
    ///
    /// # Errors
    /// [`ModelError::Parse`] if the model cannot be written.
    pub fn to_toml(&self) -> Result<String, ModelError> {
        toml::to_string(self).map_err(|error| ModelError::Parse(error.to_string()))
    }

    /// Hash over the file's text; equal for equal models.
    #[must_use]
    pub fn hash(&self) -> u64 {
        let text = self.to_toml().unwrap_or_default();
        fnv1a::hash(fnv1a::BASIS, text.as_bytes())
    }

    /// Checks that the model is of this robot.
    ///
    /// # Errors
    /// [`ModelError::Robot`].
    pub fn check_robot(&self, robot: &Description) -> Result<(), ModelError> {
        let names: Vec<&str> = robot.wheels.iter().map(|w| w.name.as_str()).collect();
        let axes = robot.command.iter().map(|axis| &axis.name);
        let same_axes = axes.eq(self.command.iter().map(|range| &range.name));
        let same_interval = (robot.interval_s - self.interval_s).abs() < 1e-9;
        if self.robot == robot.name && self.wheels == names && same_axes && same_interval {
            return Ok(());
        }
        let shown = |wheels: String, axes: Vec<&str>, interval_s: f64| {
            format!(
                "wheels {wheels}; command {}; {interval_s} s",
                axes.join(" ")
            )
        };
        let model_axes = self.command.iter().map(|range| range.name.as_str());
        let robot_axes = robot.command.iter().map(|axis| axis.name.as_str());
        Err(ModelError::Robot {
            model: self.robot.clone(),
            model_wheels: shown(self.wheels.join(" "), model_axes.collect(), self.interval_s),
            robot: robot.name.clone(),
            robot_wheels: shown(names.join(" "), robot_axes.collect(), robot.interval_s),
        })
    }

    /// The calibration for a set of channels and a form of detection.
    ///
    /// # Errors
    /// [`ModelError::Calibration`].
    pub fn calibration(&self, channels: Channels, form: Form) -> Result<&Calibration, ModelError> {
        let (sensors, form) = (channels.name(), form.name());
        self.calibration
            .iter()
            .find(|calibration| calibration.sensors == sensors && calibration.form == form)
            .ok_or(ModelError::Calibration { sensors, form })
    }

    /// Size of each axis of the command; 1 for axes that do not exist.
    #[must_use]
    pub fn sizes(&self) -> [f64; COMMANDS] {
        let mut sizes = [1.0; COMMANDS];
        for (size, range) in sizes.iter_mut().zip(&self.command) {
            *size = range.size();
        }
        sizes
    }

    fn check(&self) -> Result<(), ModelError> {
        if self.version != VERSION {
            return Err(ModelError::Version(self.version));
        }
        let refuse = |key: String, value: String, allowed| {
            Err(ModelError::Value {
                key,
                value,
                allowed,
            })
        };
        if self.kind != KIND {
            return refuse("kind".into(), self.kind.clone(), "nominal");
        }
        if !(0.02..=1.0).contains(&self.interval_s) {
            return refuse(
                "interval_s".into(),
                self.interval_s.to_string(),
                "0.02 to 1",
            );
        }
        let ranges = self
            .command
            .iter()
            .all(|r| r.min.is_finite() && r.max >= r.min);
        if self.command.is_empty() || self.command.len() > COMMANDS || !ranges {
            let found = format!("{} axes", self.command.len());
            return refuse("command".into(), found, "1 to 4 axes, min up to max");
        }
        if self.channel.is_empty() || self.channel.len() > CHANNELS_MAX {
            let found = format!("{} channels", self.channel.len());
            return refuse("channel".into(), found, "1 to 20 channels");
        }
        for (i, channel) in self.channel.iter().enumerate() {
            if let Some(message) = unusable(channel) {
                return refuse(format!("channel.{i}"), message, "see the model's layout");
            }
        }
        self.calibration.iter().try_for_each(check_calibration)
    }
}

/// What makes a channel unusable.
fn unusable(channel: &Channel) -> Option<String> {
    let (terms, weights) = (channel.terms.len(), channel.weights.len());
    if terms != weights || terms > TERMS_MAX {
        return Some(format!("{terms} terms and {weights} weights"));
    }
    if channel.target.wheel >= WHEELS {
        return Some(format!("wheel {}", channel.target.wheel));
    }
    if channel.weights.iter().any(|weight| !weight.is_finite()) {
        return Some("a weight that is not finite".into());
    }
    let variance = channel.variance;
    if !(variance[0] > 0.0 && variance.iter().all(|v| v.is_finite() && *v >= 0.0)) {
        return Some(format!("variance {variance:?}"));
    }
    if !(channel.correlation > -0.5 && channel.correlation < 1.0) {
        return Some(format!("correlation {}", channel.correlation));
    }
    if !(channel.offset_sd.is_finite() && channel.offset_sd >= 0.0) {
        return Some(format!("offset_sd {}", channel.offset_sd));
    }
    if !(channel.scatter.is_finite() && channel.scatter >= 1.0) {
        return Some(format!("scatter {}", channel.scatter));
    }
    let is_sane = |tail: &Tail| {
        let positive = tail.slope > 0.0 && tail.interval_h > 0.0 && tail.interval_h.is_finite();
        positive && tail.slope.is_finite() && tail.level_log_odds.is_finite()
    };
    if !channel.tails.iter().all(is_sane) {
        return Some(format!("tails {:?}", channel.tails));
    }
    if !(channel.drift_sd.is_finite() && channel.drift_sd >= 0.0) {
        return Some(format!("drift_sd {}", channel.drift_sd));
    }
    None
}
