//! The file of a model of channels.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::channel::Channel;
use super::context_change::ContextChanges;
use super::coverage::{Combinations, Range, widening};
use super::fault_kind::FaultKind;
use super::identity::{ChannelIdentity, Identity, without_groups};
use super::law::{Direction, Law};
use super::model_check::{check_channel, check_scatter};
use super::observation::History;
use super::scatter::Scatter;
use super::signature::Signatures;
use super::turning::TurningSignatures;
use super::{AXES, CHANNELS_MAX, DRIVES_MAX};
use crate::alarm::AlarmError;
use crate::context_table::DeclaredContext;
use crate::description::{Description, INTERVAL_MAX_S, INTERVAL_MIN_S};
use crate::fault_table::DeclaredFault;
use crate::learned::channels::Channels;
use crate::learned::model::{EDITED, ModelError, Provenance, check_calibration};
use crate::learned::{Calibration, Form};
use crate::model_file::{self, ModelFile, check_range, refuse};

/// Version of the file's layout.
pub const VERSION: u32 = 6;
/// The word by which the file is told from a model of the rover's kind.
pub const KIND: &str = "channels";
/// Prior fault rate at which log-odds are collected and tempered, 1/h.
pub const FAULT_RATE_1_H: f64 = 1.0;
/// Time at rest from which on a robot at rest is known, s.
const REST_MIN_S: f64 = 3.0;
// `Model::check` names these in its messages as numbers.
const _: () = assert!(AXES == 4 && CHANNELS_MAX == 28 && DRIVES_MAX == 8);

/// Faults whose log-odds behave alike without a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// A sensor's readings are changed in a steady way.
    Steady,
    /// A sensor repeats a value, or reads zero.
    Still,
    /// A sensor is late.
    Late,
    /// A sensor reads anything.
    Erratic,
    /// A drive does not do as it is told.
    Drive,
    /// More noise.
    Noise,
    /// A declared fault, by the channels in which it shows.
    Shift,
    /// A declared fault, by its labelled runs.
    Signature,
    /// A declared fault, by the turns of its wheel. Its law has no tail: the variances are measured
    /// in the same turns, and few turns of a log are independent.
    Turning,
    /// Two faults at once, of which one is that of a sensor that reads anything.
    Pair,
    /// What no single fault explains.
    Unknown,
}

impl Class {
    /// What declared faults show.
    pub const DECLARED: [Self; 3] = [Self::Shift, Self::Signature, Self::Turning];
    /// Every class.
    pub const ALL: [Self; 11] = [
        Self::Steady,
        Self::Still,
        Self::Late,
        Self::Erratic,
        Self::Drive,
        Self::Noise,
        Self::Shift,
        Self::Signature,
        Self::Turning,
        Self::Pair,
        Self::Unknown,
    ];

    /// The class of a kind of fault; none for what no healthy robot ever shows.
    #[must_use]
    pub const fn from_kind(kind: FaultKind) -> Option<Self> {
        match kind {
            FaultKind::Missing => None,
            FaultKind::Bias | FaultKind::Gain | FaultKind::Drift => Some(Self::Steady),
            FaultKind::Frozen | FaultKind::Zero => Some(Self::Still),
            FaultKind::Delay => Some(Self::Late),
            FaultKind::Erratic => Some(Self::Erratic),
            FaultKind::Stuck | FaultKind::Loss | FaultKind::Slip | FaultKind::Offset => {
                Some(Self::Drive)
            }
            FaultKind::Noise | FaultKind::Rough => Some(Self::Noise),
            FaultKind::Shift => Some(Self::Shift),
            FaultKind::Signature => Some(Self::Signature),
            FaultKind::Turning => Some(Self::Turning),
        }
    }
}

/// How often the log-odds of a class exceed a level without a fault: more rarely by `exp(-slope)`
/// per unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tail {
    /// Set of channels: `pose` or `pose+encoders`.
    pub sensors: String,
    /// Class of the faults.
    pub class: Class,
    /// Level, natural log-odds at a prior fault rate of 1/h.
    pub level_log_odds: f64,
    /// Mean time between exceedances of it, h.
    pub interval_h: f64,
    /// Exponent by which exceedances grow rarer, per unit of log-odds above the level.
    pub slope: f64,
}

impl Tail {
    /// The log-odds that a law without flaw would give for an event as rare. For such a one they
    /// grow as the logarithm of the time between exceedances, at a prior rate of 1/h.
    #[must_use]
    pub fn tempered(&self, log_odds: f64) -> f64 {
        self.interval_h.ln() + self.slope * (log_odds - self.level_log_odds)
    }
}

/// Everything learned about one robot without a fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// `channels`.
    pub kind: String,
    /// Layout of the file.
    pub version: u32,
    /// Hash over everything else in the file, as that of the rover's model: `fnv1a64:` and 16
    /// digits, or [`EDITED`].
    pub hash: String,
    /// Name of the robot.
    pub robot: String,
    /// Interval over which frames are averaged into one observation, s.
    pub interval_s: f64,
    /// First seconds of a run that are left out, s.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub warm_up_s: f64,
    /// Time in motion that was learned from, s.
    pub exposure_s: f64,
    /// Time at rest that was learned from, s.
    pub rest_s: f64,
    /// Factor by which all deviations were widened because the log is short.
    pub widened: f64,
    /// Where the model comes from.
    pub provenance: Provenance,
    /// Axes of the command, and the ranges learned from.
    pub command: Vec<Range>,
    /// Combinations of the axes learned from.
    pub combinations: Combinations,
    /// Channels, in the order of [`targets`].
    pub channel: Vec<Channel>,
    /// The joint law of their residuals.
    pub direction: Vec<Direction>,
    /// The law of their roughness.
    pub scatter: Scatter,
    /// Faults that the robot declares.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub declared: Vec<DeclaredFault>,
    /// How they showed in labelled runs.
    #[serde(default, skip_serializing_if = "Signatures::is_empty")]
    pub signatures: Signatures,
    /// How they came back in them with the turns of a wheel.
    #[serde(default, skip_serializing_if = "TurningSignatures::is_empty")]
    pub turning: TurningSignatures,
    /// Changes that are no fault, which the robot declares.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub declared_context: Vec<DeclaredContext>,
    /// How they showed in labelled runs.
    #[serde(default, skip_serializing_if = "ContextChanges::is_empty")]
    pub contexts: ContextChanges,
    /// Tails of the classes of faults.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tail: Vec<Tail>,
    /// Alarm thresholds, one per set of channels.
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

    /// Checks that the model is of this robot: by its name, the axes of its command, its channels,
    /// its interval and warm-up, and how its declared faults show.
    ///
    /// # Errors
    /// [`ModelError::Robot`].
    pub fn check_robot(&self, robot: &Description) -> Result<(), ModelError> {
        let channels = self.channel.iter().map(|one| ChannelIdentity {
            name: one.name.clone(),
            period: one.period,
            drifts: one.drifts,
        });
        let of_model = Identity {
            name: self.robot.clone(),
            axes: self.command.iter().map(|axis| axis.name.clone()).collect(),
            channels: channels.collect(),
            interval_s: self.interval_s,
            warm_up_s: self.warm_up_s,
            faults: without_groups(&self.declared),
            contexts: self.declared_context.clone(),
        };
        let of_robot = Identity::of_robot(robot);
        if of_model == of_robot {
            return Ok(());
        }
        Err(ModelError::Robot {
            model: self.robot.clone(),
            model_wheels: of_model.to_string(),
            robot: robot.name.clone(),
            robot_wheels: of_robot.to_string(),
        })
    }

    /// The calibration for a set of channels; a model of channels has one form.
    ///
    /// # Errors
    /// [`ModelError::Calibration`].
    pub fn calibration(&self, channels: Channels, form: Form) -> Result<&Calibration, ModelError> {
        crate::learned::calibration::find(&self.calibration, channels, form)
    }

    /// The tail of a class of faults in a set of channels.
    #[must_use]
    pub fn tail(&self, channels: Channels, class: Class) -> Option<&Tail> {
        let mut tails = self.tail.iter();
        tails.find(|tail| tail.sensors == channels.name() && tail.class == class)
    }

    /// Log-odds at which to alarm, so that `interval_h` pass on average between false alarms at a
    /// prior fault rate of `fault_rate_1_h`.
    ///
    /// # Errors
    /// [`AlarmError`] if there is no calibration.
    pub fn alarm_log_odds(
        &self,
        (channels, form): (Channels, Form),
        interval_h: f64,
        fault_rate_1_h: f64,
    ) -> Result<f64, AlarmError> {
        let calibration = self.calibration(channels, form)?;
        Ok(calibration.alarm_log_odds(interval_h, fault_rate_1_h))
    }

    /// True if the log showed the robot at rest.
    #[must_use]
    pub fn knows_rest(&self) -> bool {
        self.rest_s >= REST_MIN_S
    }

    /// Factor on all deviations for the newest command of `history`.
    #[must_use]
    pub fn widening(&self, history: &History) -> f64 {
        history
            .ago(0)
            .map_or(1.0, |now| widening(&self.command, &self.combinations, now))
    }

    /// Size of each axis of the command; 1 for axes that do not exist.
    #[must_use]
    pub fn sizes(&self) -> [f64; AXES] {
        let mut sizes = [1.0; AXES];
        for (size, range) in sizes.iter_mut().zip(&self.command) {
            *size = range.size;
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
            return refuse("kind", &self.kind, KIND);
        }
        check_range(
            "interval_s",
            self.interval_s,
            INTERVAL_MIN_S,
            INTERVAL_MAX_S,
        )?;
        let ranges = self.command.iter().all(Range::is_sane);
        if self.command.len() > AXES || !ranges {
            let found = format!("{} axes", self.command.len());
            return refuse("command", found, "0 to 4 axes, min up to max, gaps inside");
        }
        if !self.combinations.is_sane() {
            let found = format!("{} products", self.combinations.powers.len());
            let allowed = "at most 15, each with a finite row of the precision";
            return refuse("combinations", found, allowed);
        }
        let count = self.channel.len();
        if count == 0 || count > CHANNELS_MAX {
            return refuse("channel", format!("{count} channels"), "1 to 28 channels");
        }
        for (i, channel) in self.channel.iter().enumerate() {
            check_channel(&format!("channel.{i}"), channel, self.command.len())?;
        }
        for (i, direction) in self.direction.iter().enumerate() {
            let values = direction.vector.iter().chain(&direction.correlation);
            let units = values.chain([&0.0]).all(|value| value.abs() <= 1.0 + 1e-6);
            let varies = (1e-12..=1e12).contains(&direction.variance);
            if !units || direction.vector.len() != count || !varies {
                let found = format!("{direction:?}");
                return refuse(
                    format!("direction.{i}"),
                    found,
                    "a share of -1 to 1 for each channel, correlations of -1 to 1, and a variance \
                     of 1e-12 to 1e12",
                );
            }
        }
        if Law::new(&self.direction, count, 0).is_none() {
            let found = format!("{} directions", self.direction.len());
            return refuse("direction", found, "one for each channel, of a covariance");
        }
        check_scatter(&self.scatter, count)?;
        if !self.signatures.fits(count) {
            let found = format!("{} faults", self.signatures.fault.len());
            let allowed = "at most 8 faults of 1 to 8 phases, each with three numbers up to 1e9 \
                           for each channel and term, and deviations from 1e-3";
            return refuse("signatures", found, allowed);
        }
        if !self.turning.fits(count) {
            let found = format!("{} faults", self.turning.fault.len());
            let allowed = "at most 8 faults and 8 wheels, each with five numbers for each channel: \
                           amplitudes up to 1e6, squares and ripples of 0 to 1e18";
            return refuse("turning", found, allowed);
        }
        if !self.contexts.fits(count) {
            let found = format!("{} changes", self.contexts.change.len());
            let allowed = "at most 4 changes of 4 ages, each with at most 4 directions: a weight \
                           up to 1e6 for each channel, ratios of 1 to 1e9, thresholds of 0 to 1e9";
            return refuse("contexts", found, allowed);
        }
        self.check_names()?;
        self.tail.iter().try_for_each(check_tail)?;
        self.calibration.iter().try_for_each(check_calibration)
    }
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Model {
    /// Checks that what was learned is of declared faults and contexts, each once.
    fn check_names(&self) -> Result<(), ModelError> {
        let faults: Vec<&str> = self.declared.iter().map(|one| one.name.as_str()).collect();
        let contexts = self.declared_context.iter();
        let contexts: Vec<&str> = contexts.map(|one| one.name.as_str()).collect();
        let names = self.signatures.fault.iter().map(|one| one.fault.as_str());
        check_declared("signatures.fault", "fault", names.collect(), &faults)?;
        let names = self.turning.fault.iter().map(|one| one.fault.as_str());
        check_declared("turning.fault", "fault", names.collect(), &faults)?;
        for (i, one) in self.turning.fault.iter().enumerate() {
            let mut declared = self.declared.iter().filter(|fault| fault.name == one.fault);
            let wheel = declared.find_map(|fault| fault.wheel.as_deref());
            if wheel.and_then(|wheel| self.turning.noise(wheel)).is_none() {
                let allowed = "a fault that is declared with a wheel, whose noise stands beside it";
                return refuse(format!("turning.fault.{i}.fault"), &one.fault, allowed);
            }
        }
        let names = self.contexts.change.iter().map(|one| one.context.as_str());
        check_declared("contexts.change", "context", names.collect(), &contexts)
    }
}

/// Checks that each of these names of tables `key` is a declared one; `of`: what they name.
fn check_declared(
    key: &str,
    of: &str,
    names: Vec<&str>,
    declared: &[&str],
) -> Result<(), ModelError> {
    let is_wrong = |&i: &usize| !declared.contains(&names[i]) || names[..i].contains(&names[i]);
    match (0..names.len()).find(is_wrong) {
        None => Ok(()),
        Some(i) => {
            let allowed = format!("each declared {of} once");
            refuse(format!("{key}.{i}.{of}"), names[i], &allowed)
        }
    }
}

/// Checks the numbers of a tail.
fn check_tail(tail: &Tail) -> Result<(), ModelError> {
    let key = |name: &str| format!("tail.{}.{:?}.{name}", tail.sensors, tail.class);
    check_range(&key("level_log_odds"), tail.level_log_odds, -1e4, 1e4)?;
    check_range(&key("interval_h"), tail.interval_h, 1e-9, 1e9)?;
    check_range(&key("slope"), tail.slope, 1e-3, 10.0)
}
