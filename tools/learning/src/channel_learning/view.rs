//! A model of channels for people to read: text, or the same as one document.

use std::fmt;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_robot::channel_model::model::Tail;
use vigil_robot::channel_model::{self, Model, Range};

use super::terms::word;
use crate::model_view::{Alarm, Source};

/// A model of channels, readable. `Display` prints it as text.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct View {
    /// What it is of, and where it comes from.
    #[serde(flatten)]
    pub source: Source,
    /// Interval over which frames are averaged into one observation, s.
    pub interval_s: f64,
    /// Time in motion that was learned from, s.
    pub exposure_s: f64,
    /// Factor by which all deviations were widened because the log is short.
    pub widened: f64,
    /// Axes of the command, and the ranges learned from.
    pub command: Vec<Range>,
    /// The channels, each with its prediction.
    pub channels: Vec<Channel>,
    /// Declared faults that are recognized by labelled runs.
    pub signatures: Vec<RecognizedFault>,
    /// How often log-odds exceed a level without a fault, by class of faults.
    pub tails: Vec<Tail>,
    /// Alarm thresholds.
    pub alarms: Vec<Alarm>,
}

/// One channel.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Channel {
    /// The prediction in words.
    pub prediction: String,
    /// Everything as the file has it.
    #[serde(flatten)]
    pub learned: channel_model::Channel,
}

/// A declared fault that is recognized by labelled runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct RecognizedFault {
    /// Name of the fault.
    pub fault: String,
    /// Number of runs that it was learned from.
    pub runs: usize,
}

impl View {
    /// A view of a model; thresholds for this prior rate of faults.
    #[must_use]
    pub fn new(model: &Model, fault_rate_1_h: f64) -> Self {
        let source = Source {
            robot: model.robot.clone(),
            wheels: Vec::new(),
            layout_version: model.version,
            model_hash: format!("{:016x}", model.hash()),
            edited: model.is_edited(),
            provenance: model.provenance.clone(),
        };
        let channel = |channel: &channel_model::Channel| Channel {
            prediction: prediction(channel, model),
            learned: channel.clone(),
        };
        let signatures = model.signatures.fault.iter();
        let signatures = signatures.map(|one| (&one.fault, one.runs));
        let turning = model.turning.fault.iter().map(|one| (&one.fault, one.runs));
        let signatures = signatures
            .chain(turning)
            .map(|(fault, runs)| RecognizedFault {
                fault: fault.clone(),
                runs,
            });
        Self {
            source,
            interval_s: model.interval_s,
            exposure_s: model.exposure_s,
            widened: model.widened,
            command: model.command.clone(),
            channels: model.channel.iter().map(channel).collect(),
            signatures: signatures.collect(),
            tails: model.tail.clone(),
            alarms: Alarm::all(&model.calibration, fault_rate_1_h),
        }
    }
}

/// Weights and terms of a channel.
fn prediction(channel: &channel_model::Channel, model: &Model) -> String {
    let terms = channel.terms.iter().zip(&channel.weights);
    let terms = terms.map(|(term, weight)| match word(term, model) {
        word if word.is_empty() => format!("{weight:+.4}"),
        word => format!("{weight:+.4} {word}"),
    });
    terms.collect::<Vec<_>>().join(" ")
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.source.write(f, "of the runs, of at least six")?;
        writeln!(
            f,
            "\nlearned from   {:.0} s of motion, deviations widened by {:.2}",
            self.exposure_s, self.widened
        )?;
        for Range {
            name,
            unit,
            min,
            max,
            gaps,
            ..
        } in &self.command
        {
            write!(f, "learned range  {name} {min:.3} to {max:.3} {unit}")?;
            for (i, [from, to]) in gaps.iter().enumerate() {
                let but = [", and", ", but not"][usize::from(i == 0)];
                write!(f, "{but} between {from:.3} and {to:.3}")?;
            }
            writeln!(f)?;
        }
        writeln!(
            f,
            "\nchannels, each a mean over {} s and predicted by weights of the command (each axis \
             divided by the\nlargest value learned from); [-k]: k observations earlier; \
             [~T]: smoothed over T",
            self.interval_s
        )?;
        for Channel {
            prediction,
            learned,
        } in &self.channels
        {
            writeln!(
                f,
                "\n{}\n  = {prediction}\n  sd {:.5} without a command; usual size {:.5}; on parts \
                 left out {:.2} times as much",
                learned.name,
                learned.variance[0].sqrt(),
                learned.usual,
                learned.held_out_ratio
            )?;
        }
        if !self.signatures.is_empty() {
            writeln!(f)?;
        }
        for RecognizedFault { fault, runs } in &self.signatures {
            writeln!(
                f,
                "{fault} is recognized by what {runs} labelled runs showed"
            )?;
        }
        writeln!(f, "\nlog-odds without a fault, by class of faults")?;
        for tail in &self.tails {
            writeln!(
                f,
                "  {:<14} {:<8} above {:6.2} every {:.3} h, \
                 and more rarely by exp(-{:.2}) per unit",
                tail.sensors,
                format!("{:?}", tail.class).to_lowercase(),
                tail.level_log_odds,
                tail.interval_h,
                tail.slope
            )?;
        }
        Alarm::write(&self.alarms, f)
    }
}
