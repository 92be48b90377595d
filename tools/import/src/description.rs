//! What a log's files mean, as read from `config/logs/*.toml`.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ImportError;

/// Unit of a column, brought to SI.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// As it is.
    #[default]
    Si,
    /// Degrees.
    Deg,
    /// Millimetres.
    Mm,
    /// Revolutions per minute.
    Rpm,
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

impl Unit {
    /// One such unit in SI.
    #[must_use]
    pub fn factor(self) -> f64 {
        match self {
            Self::Si | Self::S => 1.0,
            Self::Deg => PI / 180.0,
            Self::Mm | Self::Ms => 1e-3,
            Self::Rpm => PI / 30.0,
            Self::Us => 1e-6,
            Self::Ns => 1e-9,
        }
    }
}

/// A column that holds time.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Clock {
    /// Column.
    pub column: String,
    /// Unit: `s`, `ms`, `us` or `ns`.
    pub unit: Unit,
    /// Value at which the counter wraps around to 0, in its unit.
    #[serde(default)]
    pub modulus: Option<f64>,
}

/// One kind of file.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Name, by which channels refer to it.
    pub name: String,
    /// File within a run's folder, or beside a run's file; `*` stands for what the first `*` of the
    /// run's pattern does: `imu_*.csv` beside `pro_*.csv`. Left out: the run is the file.
    #[serde(default)]
    pub file: Option<String>,
    /// Topic of ROS 2 messages in a recording (MCAP or SQLite, a file or rosbag2's folder), whose
    /// fields are the columns (`pose.yaw`, `velocity[left_front_wheel]`; `vigil import --look`
    /// lists their names); left out: a CSV file.
    #[serde(default)]
    pub topic: Option<String>,
    /// Separator of columns.
    #[serde(default = "comma")]
    pub delimiter: char,
    /// Rows before the one that names the columns.
    #[serde(default)]
    pub skip_rows: usize,
    /// When a row was measured.
    pub time: Clock,
    /// The time column is on another clock than that of the other sources: `[source, column]` names
    /// a source that has both; the median difference, a constant of the run, is added.
    #[serde(default)]
    pub time_as: Option<[String; 2]>,
    /// Clock of the device, against which counters are differentiated; left out: `time`. Rows are
    /// placed by it, too: `time` gives its offset and its rate, constants of a run.
    #[serde(default)]
    pub device_clock: Option<Clock>,
}

/// How a channel gets its value at the time of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Mean of the samples since the last frame; the last one where there is none. Between samples
    /// further apart than 2.5 of their usual periods nothing was measured.
    #[default]
    Mean,
    /// The last sample, up to `hold_max_s` old; `initial` before the first. For commands.
    Hold,
    /// On the line between the samples before and after.
    Interpolate,
}

/// How late a channel is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Delay {
    /// By so much, s.
    Given(f64),
    /// To be found where it correlates most with `delay_against`, in the first run.
    Estimate,
}

impl Delay {
    /// The delay, s; `estimated` if it was not given.
    #[must_use]
    pub fn given_s(self, estimated: Option<f64>) -> f64 {
        match self {
            Self::Given(delay_s) => delay_s,
            Self::Estimate => estimated.unwrap_or(0.0),
        }
    }
}

impl Default for Delay {
    fn default() -> Self {
        Self::Given(0.0)
    }
}

impl<'de> Deserialize<'de> for Delay {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Setting {
            Number(f64),
            Word(String),
        }
        match Setting::deserialize(from)? {
            Setting::Number(delay_s) if (-1.0..=1.0).contains(&delay_s) => Ok(Self::Given(delay_s)),
            Setting::Word(word) if word == "estimate" => Ok(Self::Estimate),
            Setting::Number(delay_s) => Err(serde::de::Error::custom(format!(
                "delay_s is {delay_s}: allowed is -1 to 1 s, or \"estimate\""
            ))),
            Setting::Word(word) => Err(serde::de::Error::custom(format!(
                "delay_s is '{word}': allowed is -1 to 1 s, or \"estimate\""
            ))),
        }
    }
}

/// Where a channel of the frames comes from.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChannelSource {
    /// Column of Vigil's frames (`enc_L`, `yaw_rate`, the name of a command's axis).
    pub name: String,
    /// Name of the source that it comes from.
    pub source: String,
    /// Column of the source; left out: `columns`.
    #[serde(default)]
    pub column: String,
    /// Several columns of the source, each with a factor, of which the channel is the sum: the mean
    /// of two wheels is `{ left = 0.5, right = 0.5 }`. Counters are unwrapped one by one.
    #[serde(default)]
    pub columns: BTreeMap<String, f64>,
    /// Unit of the column: `si`, `deg`, `mm`, `rpm`.
    #[serde(default)]
    pub unit: Unit,
    /// Value at which a counter wraps around, in the column's unit.
    #[serde(default)]
    pub modulus: Option<f64>,
    /// True for a counter or position of which the rate of change is wanted.
    #[serde(default)]
    pub differentiate: bool,
    /// Factor, its sign included, after unit and differentiation.
    #[serde(default = "one")]
    pub scale: f64,
    /// Added at the end.
    #[serde(default)]
    pub offset: f64,
    /// True for an angle: unwrapped before resampling, wrapped to ±pi after.
    #[serde(default)]
    pub angle: bool,
    /// How it gets its value at the time of a frame: `mean`, `hold`, `interpolate`.
    #[serde(default)]
    pub method: Method,
    /// Value before the first sample; for `hold`.
    #[serde(default)]
    pub initial: f64,
    /// By how much the channel is late, s, or "estimate". It is moved forward by so much: a live
    /// publisher must hold the other channels back by the same time.
    #[serde(default)]
    #[schemars(with = "f64", range(min = -1, max = 1), extend("default" = 0))]
    pub delay_s: Delay,
    /// Channels, each with a factor, whose sum it is compared with for "estimate".
    #[serde(default)]
    pub delay_against: BTreeMap<String, f64>,
}

/// A log.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogDescription {
    /// The robot's description, relative to this file.
    pub robot: String,
    /// Rate of the frames, Hz.
    #[schemars(range(min = 1, max = 1000))]
    pub rate_hz: f64,
    /// Runs: folders or files below the log's folder, in this order; `*` stands for any part of a
    /// name. Each match is one run.
    pub runs: Vec<String>,
    /// Column of CSV files that hold several runs: rows with the same value are one run. Left out:
    /// each match of `runs` is one.
    #[serde(default)]
    pub run_column: Option<String>,
    /// Longest time for which a value is held, s, 30 if left out: beyond it a command is no longer
    /// known. A robot that gets only changed commands may need more.
    #[serde(default = "thirty")]
    pub hold_max_s: f64,
    /// Beginning of the first run from which delays are estimated, s.
    #[serde(default = "forty")]
    pub estimate_s: f64,
    /// Files.
    pub source: Vec<Source>,
    /// Channels.
    pub channel: Vec<ChannelSource>,
}

fn comma() -> char {
    ','
}

fn one() -> f64 {
    1.0
}

fn thirty() -> f64 {
    30.0
}

fn forty() -> f64 {
    40.0
}

impl ChannelSource {
    /// Its columns, each with its factor.
    pub(super) fn terms(&self) -> impl Iterator<Item = (&String, f64)> {
        let one = Some((&self.column, 1.0)).filter(|(column, _)| !column.is_empty());
        one.into_iter().chain(
            self.columns
                .iter()
                .map(|(column, factor)| (column, *factor)),
        )
    }

    /// Its columns as messages name them.
    pub(super) fn column_names(&self) -> String {
        let names: Vec<&str> = self.terms().map(|(column, _)| column.as_str()).collect();
        names.join(", ")
    }
}

impl LogDescription {
    /// Reads a description.
    ///
    /// # Errors
    /// [`ImportError::Io`], or [`ImportError::Description`] with file, line and reason.
    pub fn load(path: &Path) -> Result<Self, ImportError> {
        let text = fs::read_to_string(path).map_err(|error| ImportError::Io {
            path: path.to_path_buf(),
            error,
        })?;
        toml::from_str(&text).map_err(|error: toml::de::Error| {
            let start = error.span().map_or(0, |span| span.start);
            let line = 1 + text
                .bytes()
                .take(start)
                .filter(|&byte| byte == b'\n')
                .count();
            let message = error.message().replace('\n', " ");
            ImportError::description(format!("{}:{line}", path.display()), message)
        })
    }

    /// Path of the robot's description; `own` is the path of this file.
    #[must_use]
    pub fn robot_path(&self, own: &Path) -> PathBuf {
        own.parent()
            .unwrap_or_else(|| Path::new("."))
            .join(&self.robot)
    }

    /// The channels in the order of `columns`, which [`Self::check`] has found complete.
    pub(super) fn in_order<'a>(
        &'a self,
        columns: &'a [String],
    ) -> impl Iterator<Item = &'a ChannelSource> {
        columns
            .iter()
            .filter_map(|column| self.channel.iter().find(|c| c.name == *column))
    }
}
