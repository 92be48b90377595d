//! The file of a nominal model.

use serde::{Deserialize, Serialize};
use vigil_blocks::WHEELS;

use super::AXES;
use super::channel::{CHANNELS_MAX, Channel, FAULT_RATE_1_H, Regressor, Tail, Term};
use super::joint::Joint;
use super::observation::DEPTH;
use crate::alarm::AlarmError;
use crate::description::{Description, INTERVAL_MAX_S, INTERVAL_MIN_S};
use crate::learned::calibration::find;
use crate::learned::channels::Channels;
use crate::learned::model::{EDITED, ModelError, Provenance, check_calibration};
use crate::learned::{Calibration, Form};
use crate::model_file::{self, ModelFile, check_range, refuse};

/// Version of the file's layout.
pub const VERSION: u32 = 2;
/// The word by which the file is told from a model with faults.
pub const KIND: &str = "nominal";
/// Terms of a channel. Chosen: of four axes to the fourth order learning makes 87 for a current at
/// most. Smaller refuses such a model; larger only lets a file cost more time.
const TERMS_MAX: usize = 128;
/// Largest lag of a term: a prediction is also made for the observation before the newest.
const LAG_MAX: usize = DEPTH - 2;
/// Gaps of a range. Learning takes one for a gap if it is wider than 0.15 of the range (`GAP` in
/// `learning_nominal::excitation`): six at most, one fewer than this.
const GAPS_MAX: usize = 7;
/// Largest order of a polynomial.
const ORDER_MAX: u32 = 4;
// `Model::check` names these in its messages as numbers.
const _: () = assert!(WHEELS == 8 && AXES == 4 && CHANNELS_MAX == 20);
const _: () = assert!(TERMS_MAX == 128 && LAG_MAX == 3 && ORDER_MAX == 4);

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
    /// Stretches within these bounds in which nothing was learned from, each from the last value
    /// below to the first above.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gaps: Vec<[f64; 2]>,
}

impl Range {
    /// Size by which the axis is divided in polynomials.
    #[must_use]
    pub fn size(&self) -> f64 {
        self.min.abs().max(self.max.abs()).max(1e-9)
    }

    /// How far a command lies outside the range, or from the ends of the gap that it lies in, in
    /// units of the range's width.
    #[must_use]
    pub fn beyond(&self, value: f64) -> f64 {
        let outside = (self.min - value).max(value - self.max).max(0.0);
        let within = self
            .gaps
            .iter()
            .map(|[from, to]| (value - from).min(to - value));
        within.fold(outside, f64::max) / (self.max - self.min).max(1e-9)
    }

    /// True if its numbers make sense.
    fn is_sane(&self) -> bool {
        let inside = |[from, to]: &[f64; 2]| self.min <= *from && from < to && *to <= self.max;
        let bounds = self.min.is_finite() && self.max.is_finite() && self.max >= self.min;
        bounds && self.gaps.len() <= GAPS_MAX && self.gaps.iter().all(inside)
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
    /// Hash over everything else in the file, as that of a model with faults: `fnv1a64:` and 16
    /// digits, or [`EDITED`].
    pub hash: String,
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
    /// Tails of all channels of a set together; without one they are not taken together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint: Vec<Joint>,
    /// Alarm thresholds, one per set of channels and form of the detection filter.
    pub calibration: Vec<Calibration>,
}

impl Model {
    /// Reads and checks a model.
    ///
    /// # Errors
    /// [`ModelError`] naming the key, what was found and what is allowed.
    pub fn from_toml(text: &str) -> Result<Self, ModelError> {
        model_file::read(text)
    }

    /// The file's text.
    ///
    /// # Errors
    /// [`ModelError::Parse`] if the model cannot be written.
    pub fn to_toml(&self) -> Result<String, ModelError> {
        model_file::text(self)
    }

    /// Hash over the content; equal for equal models.
    #[must_use]
    pub fn hash(&self) -> u64 {
        model_file::hash(self)
    }

    /// The same with the hash that its content has, as [`Self::from_toml`] expects it.
    #[must_use]
    pub fn sealed(self) -> Self {
        model_file::sealed(self)
    }

    /// True if the file says that a person has changed it.
    #[must_use]
    pub fn is_edited(&self) -> bool {
        self.hash == EDITED
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
        find(&self.calibration, channels, form)
    }

    /// The tail of all channels of a set together, if the form has one.
    #[must_use]
    pub fn joint(&self, channels: Channels, form: Form) -> Option<&Tail> {
        let mut joint = self.joint.iter();
        let of = |j: &&Joint| j.sensors == channels.name() && j.tail.form == form.name();
        joint.find(of).map(|joint| &joint.tail)
    }

    /// The highest log-odds that a lasting fault keeps some channel at, tempered as the monitor
    /// does, at a prior fault rate of `fault_rate_1_h`.
    #[must_use]
    pub fn log_odds_max(&self, channels: Channels, form: Form, fault_rate_1_h: f64) -> f64 {
        let used = self.channel.iter().filter(|c| c.is_among(channels));
        let highest = used.map(|channel| channel.tempered(form, form.log_odds_max()));
        let joint = self.joint(channels, form).into_iter();
        let joint = joint.map(|tail| tail.tempered(form.log_odds_max()));
        highest.chain(joint).fold(f64::NEG_INFINITY, f64::max)
            + (fault_rate_1_h / FAULT_RATE_1_H).ln()
    }

    /// Log-odds at which to alarm, so that `interval_h` pass on average between false alarms at a
    /// prior fault rate of `fault_rate_1_h`.
    ///
    /// # Errors
    /// [`AlarmError`] if there is no calibration, or the log-odds cannot reach the alarm.
    pub fn alarm_log_odds(
        &self,
        (channels, form): (Channels, Form),
        interval_h: f64,
        fault_rate_1_h: f64,
    ) -> Result<f64, AlarmError> {
        let calibration = self.calibration(channels, form)?;
        let reachable = self.log_odds_max(channels, form, fault_rate_1_h);
        calibration.alarm_below(reachable, form, interval_h, fault_rate_1_h)
    }

    /// Size of each axis of the command; 1 for axes that do not exist.
    #[must_use]
    pub fn sizes(&self) -> [f64; AXES] {
        let mut sizes = [1.0; AXES];
        for (size, range) in sizes.iter_mut().zip(&self.command) {
            *size = range.size();
        }
        sizes
    }
}

impl ModelFile for Model {
    const VERSION: u32 = VERSION;

    fn stored(&self) -> &str {
        &self.hash
    }

    fn stored_mut(&mut self) -> &mut String {
        &mut self.hash
    }

    fn check(&self) -> Result<(), ModelError> {
        if self.kind != KIND {
            return refuse("kind", &self.kind, "nominal");
        }
        let count = self.wheels.len();
        if count == 0 || count > WHEELS {
            return refuse("wheels", count, "1 to 8 names");
        }
        check_range(
            "interval_s",
            self.interval_s,
            INTERVAL_MIN_S,
            INTERVAL_MAX_S,
        )?;
        let ranges = self.command.iter().all(Range::is_sane);
        if self.command.is_empty() || self.command.len() > AXES || !ranges {
            let found = format!("{} axes", self.command.len());
            return refuse("command", found, "1 to 4 axes, min up to max, gaps inside");
        }
        if self.channel.is_empty() || self.channel.len() > CHANNELS_MAX {
            let found = format!("{} channels", self.channel.len());
            return refuse("channel", found, "1 to 20 channels");
        }
        for (i, channel) in self.channel.iter().enumerate() {
            check_channel(&format!("channel.{i}"), channel, count, self.command.len())?;
        }
        let mut tails = self.joint.iter().map(|joint| &joint.tail);
        tails.try_for_each(|tail| check_tail("joint", tail))?;
        self.calibration.iter().try_for_each(check_calibration)
    }
}

/// Checks the numbers of a channel; `wheels` and `axes`: how many there are.
fn check_channel(
    key: &str,
    channel: &Channel,
    wheels: usize,
    axes: usize,
) -> Result<(), ModelError> {
    let (terms, weights) = (channel.terms.len(), channel.weights.len());
    if terms != weights || terms > TERMS_MAX {
        let found = format!("{terms} terms and {weights} weights");
        return refuse(key, found, "as many weights as terms, at most 128");
    }
    if channel.target.wheel >= wheels {
        let (key, found) = (format!("{key}.target.wheel"), channel.target.wheel);
        return refuse(key, found, "the index of a wheel, from 0");
    }
    for (i, term) in channel.terms.iter().enumerate() {
        check_term(&format!("{key}.terms.{i}"), term, wheels, axes)?;
    }
    let sane = |name: &str, value: f64, from: f64| {
        let key = format!("{key}.{name}");
        match value.is_finite() && value >= from {
            true => Ok(()),
            false if from > 0.0 => refuse(key, value, "a finite number from 1"),
            false => refuse(key, value, "a finite number from 0"),
        }
    };
    if let Some(weight) = channel.weights.iter().find(|weight| !weight.is_finite()) {
        return refuse(format!("{key}.weights"), weight, "finite numbers");
    }
    if !channel.variance[0].is_normal() {
        let found = channel.variance[0];
        return refuse(format!("{key}.variance"), found, "above 0 at first");
    }
    for value in channel.variance {
        sane("variance", value, 0.0)?;
    }
    if !(channel.correlation > -0.5 && channel.correlation < 1.0) {
        let (key, found) = (format!("{key}.correlation"), channel.correlation);
        return refuse(key, found, "above -0.5 and below 1");
    }
    sane("offset_sd", channel.offset_sd, 0.0)?;
    sane("drift_sd", channel.drift_sd, 0.0)?;
    sane("rest_sd", channel.rest_sd, 0.0)?;
    sane("scatter", channel.scatter, 1.0)?;
    let mut tails = channel.tails.iter();
    tails.try_for_each(|tail| check_tail(&format!("{key}.tails"), tail))
}

/// Checks the numbers of a tail.
fn check_tail(key: &str, tail: &Tail) -> Result<(), ModelError> {
    let positive = tail.slope > 0.0 && tail.interval_h > 0.0 && tail.interval_h.is_finite();
    if positive && tail.slope.is_finite() && tail.level_log_odds.is_finite() {
        return Ok(());
    }
    let (key, found) = (format!("{key}.{}", tail.form), format!("{tail:?}"));
    refuse(key, found, "finite numbers, interval and slope above 0")
}

/// Checks that a term points at what exists.
fn check_term(key: &str, term: &Term, wheels: usize, axes: usize) -> Result<(), ModelError> {
    if term.lag > LAG_MAX {
        return refuse(format!("{key}.lag"), term.lag, "0 to 3");
    }
    let key_index = || format!("{key}.index");
    let is_axis = term.of == Regressor::Lagged;
    if is_axis && term.index >= axes {
        return refuse(key_index(), term.index, "the index of an axis, from 0");
    }
    if !is_axis && term.index >= wheels {
        return refuse(key_index(), term.index, "the index of a wheel, from 0");
    }
    let beyond = term.powers.iter().skip(axes).any(|&power| power > 0);
    let order: u32 = term.powers.iter().map(|&power| u32::from(power)).sum();
    if beyond || order > ORDER_MAX {
        let (key, found) = (format!("{key}.powers"), format!("{:?}", term.powers));
        return refuse(key, found, "of the command's axes, at most 4 in all");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_beyond_a_range_by_its_distance_from_what_was_driven() {
        let range = Range {
            name: "v".into(),
            unit: "m/s".into(),
            min: -0.5,
            max: 1.5,
            gaps: vec![[0.2, 0.8]],
        };
        for (value, beyond) in [
            (-0.5, 0.0),
            (0.2, 0.0),
            (0.3, 0.05),
            (0.7, 0.05),
            (2.5, 0.5),
        ] {
            assert!((range.beyond(value) - beyond).abs() < 1e-12, "{value}");
        }
    }
}
