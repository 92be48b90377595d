//! What was learned, and how well it holds.

use std::fmt;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_robot::channel_model::{Channel, Model, Term};

use super::LONG_ENOUGH_S;
use super::contexts::ContextFit;
use super::isolability::Isolability;
use super::labelled::FaultFit;
use super::terms::word;
use crate::bounds::Bounds;
use crate::learning::RESIDUAL_BAR;

/// Part of an angle's readings beyond a quarter of its period that is told. Chosen.
const ASTRAY: f64 = 0.05;

/// One channel.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ChannelFit {
    /// Name of the channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Standard deviation of one observation's residual while nothing is commanded, the stopping
    /// included, in that unit.
    pub residual_sd: f64,
    /// Root mean square of its value in motion, in that unit.
    pub usual: f64,
    /// Size of the residuals on parts left out, over that on parts learned from: 1 is the floor.
    pub held_out_ratio: f64,
}

/// Report of learning.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Report {
    /// Number of runs learned from.
    pub runs_learned: usize,
    /// Number of runs left out.
    pub runs_held_out: usize,
    /// Time in motion, s.
    pub exposure_s: f64,
    /// Channels.
    pub channels: Vec<ChannelFit>,
    /// What labelled runs show of each declared fault.
    pub faults: Vec<FaultFit>,
    /// What labelled runs show of each declared context.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contexts: Vec<ContextFit>,
    /// What the user must know.
    pub warnings: Vec<String>,
    /// Numbers of the model that stand on a bound set by hand.
    pub bounds: Bounds,
    /// Which faults are detected and told apart; null if no window of the log tells.
    pub isolability: Option<Isolability>,
}

impl Report {
    pub(super) fn new(model: &Model, runs_learned: usize, runs_held_out: usize) -> Self {
        let mut warnings = Vec::new();
        if model.widened > 1.0 {
            warnings.push(format!(
                "the log shows {:.0} s of motion, less than {LONG_ENOUGH_S:.0} s: its noise is \
                 known to about {:.0} % only, all deviations are widened by a factor {:.2}",
                model.exposure_s,
                100.0 * (model.widened - 1.0),
                model.widened
            ));
        }
        for range in &model.command {
            if range.min >= 0.0 || range.max <= 0.0 {
                warnings.push(format!(
                    "{} was only driven from {:.3} to {:.3} {}: other commands widen the \
                     deviations",
                    range.name, range.min, range.max, range.unit
                ));
            }
            let between = |[from, to]: &[f64; 2]| format!("{from:.3} and {to:.3}");
            let gaps: Vec<String> = range.gaps.iter().map(between).collect();
            if !gaps.is_empty() {
                warnings.push(format!(
                    "{} was not driven between {} {}: commands there widen the deviations",
                    range.name,
                    gaps.join(", "),
                    range.unit
                ));
            }
        }
        Self {
            runs_learned,
            runs_held_out,
            exposure_s: model.exposure_s,
            channels: Vec::new(),
            faults: Vec::new(),
            contexts: Vec::new(),
            warnings,
            bounds: Bounds::default(),
            isolability: None,
        }
    }

    /// Tells which products of powers of the command are left out.
    pub(super) fn untold(&mut self, terms: &[Term], model: &Model) {
        let words: Vec<String> = terms.iter().map(|term| word(term, model)).collect();
        if !words.is_empty() {
            self.warnings.push(format!(
                "predicted without {}: the commands driven do not tell it from lower powers; an \
                 order needs one more value of an axis than it counts, spread over its range",
                words.join(", ")
            ));
        }
    }

    /// Warns of an angle of which such a part lies far from 0.
    pub(super) fn astray(&mut self, channel: &str, part: f64) {
        if part > ASTRAY {
            self.warnings.push(format!(
                "{channel}: {:.0} % of its readings lie beyond a quarter of its period: a period \
                 suits an error, which stays around 0",
                100.0 * part
            ));
        }
    }

    pub(super) fn add(&mut self, channel: &Channel, unit: &str) {
        if channel.held_out_ratio > RESIDUAL_BAR {
            self.warnings.push(format!(
                "{}: the residual on parts left out is {:.2} times that on parts learned from: \
                 more driving would tell more",
                channel.name, channel.held_out_ratio
            ));
        }
        self.channels.push(ChannelFit {
            channel: channel.name.clone(),
            unit: unit.to_owned(),
            residual_sd: channel.variance[0].sqrt(),
            usual: channel.usual,
            held_out_ratio: channel.held_out_ratio,
        });
    }

    pub(super) fn finish(&mut self, model: &Model) {
        if !model.knows_rest() {
            self.warnings.push(format!(
                "the log shows {:.0} s at rest: a robot that stands is not watched; record some \
                 seconds with no motion commanded",
                model.rest_s
            ));
        }
        let short = model
            .calibration
            .iter()
            .any(|c| c.exposure_h * 3600.0 < LONG_ENOUGH_S);
        if short {
            self.warnings.push(
                "alarm thresholds extrapolate far beyond this log: expect rarer, later alarms \
                 than from a longer one"
                    .to_owned(),
            );
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "learned from {} runs ({:.0} s of motion), {} left out\n",
            self.runs_learned, self.exposure_s, self.runs_held_out
        )?;
        writeln!(
            f,
            "{:<16} {:<8} {:>12} {:>12} {:>10}",
            "channel", "unit", "deviation", "usual size", "left out"
        )?;
        for channel in &self.channels {
            writeln!(
                f,
                "{:<16} {:<8} {:>12.5} {:>12.5} {:>10.2}",
                channel.channel,
                channel.unit,
                channel.residual_sd,
                channel.usual,
                channel.held_out_ratio
            )?;
        }
        if !(self.faults.is_empty() && self.contexts.is_empty()) {
            writeln!(f)?;
        }
        for fault in &self.faults {
            writeln!(f, "{fault}")?;
        }
        for context in &self.contexts {
            writeln!(f, "{context}")?;
        }
        let lines = self.bounds.lines();
        if !lines.is_empty() {
            writeln!(f)?;
        }
        lines.iter().try_for_each(|line| writeln!(f, "{line}"))?;
        let mut isolability = self.isolability.iter();
        isolability.try_for_each(|found| write!(f, "\n{found}"))
    }
}
