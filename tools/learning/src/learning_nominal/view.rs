//! A nominal model for people to read: text, or the same as one document.

use std::fmt;

use serde::Serialize;
use vigil_robot::learned::Form;
use vigil_robot::learned::channels::Channels;
use vigil_robot::nominal::{self, Joint, Model, Range, Tail};

use super::report;
use super::terms::word;
use crate::model_view::{Alarm, Source};

/// A nominal model, readable. `Display` prints it as text.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    /// Channels.
    pub channels: Vec<Channel>,
    /// Tails of all channels of a set together.
    pub joint: Vec<Joint>,
    /// Alarm thresholds.
    pub alarms: Vec<Alarm>,
    /// For each form of the detection filter the highest log-odds that a lasting fault reaches: an
    /// alarm above them is refused.
    pub reachable: Vec<Reachable>,
}

/// The highest log-odds of a form.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reachable {
    /// Form of the detection filter.
    pub form: &'static str,
    /// The highest log-odds, by all channels.
    pub log_odds: f64,
}

/// One channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Channel {
    /// Name.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// The prediction in words.
    pub prediction: String,
    /// Everything as the file has it.
    #[serde(flatten)]
    pub learned: nominal::Channel,
}

impl View {
    /// A view of a model; thresholds for this prior rate of faults.
    #[must_use]
    pub fn new(model: &Model, fault_rate_1_h: f64) -> Self {
        let source = Source {
            robot: model.robot.clone(),
            wheels: model.wheels.clone(),
            layout_version: model.version,
            model_hash: format!("{:016x}", model.hash()),
            edited: model.is_edited(),
            provenance: model.provenance.clone(),
        };
        let channel = |channel: &nominal::Channel| Channel {
            name: report::name(channel.target, &model.wheels),
            unit: report::unit(channel.target.quantity),
            prediction: prediction(channel, model),
            learned: channel.clone(),
        };
        let reachable = |form: Form| Reachable {
            form: form.name(),
            log_odds: model.log_odds_max(Channels::PoseEncoders, form, fault_rate_1_h),
        };
        Self {
            source,
            interval_s: model.interval_s,
            exposure_s: model.exposure_s,
            widened: model.widened,
            command: model.command.clone(),
            channels: model.channel.iter().map(channel).collect(),
            joint: model.joint.clone(),
            alarms: Alarm::all(&model.calibration, fault_rate_1_h),
            reachable: Form::ALL.map(reachable).to_vec(),
        }
    }
}

/// Weights and terms of a channel.
fn prediction(channel: &nominal::Channel, model: &Model) -> String {
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
             divided by the\nlargest value learned from) and of wheel rates (rad/s); [-k]: k \
             observations earlier; sd: at rest, of a\nrun's offset, and of its drift from one \
             observation to the next",
            self.interval_s
        )?;
        for channel in &self.channels {
            channel.write(f)?;
        }
        for joint in &self.joint {
            let Tail {
                level_log_odds,
                interval_h,
                slope,
                ..
            } = joint.tail;
            writeln!(
                f,
                "\nall channels of {} together: log-odds above {level_log_odds:.2} every \
                 {interval_h:.3} h without a fault, and more rarely by exp(-{slope:.2}) per unit",
                joint.sensors
            )?;
        }
        Alarm::write(&self.alarms, f)?;
        write!(
            f,
            "\nhighest log-odds of a lasting fault, above which no alarm may lie"
        )?;
        for reachable in &self.reachable {
            let Reachable { form, log_odds } = reachable;
            write!(f, "\n  {form:<13} {log_odds:6.2}")?;
        }
        Ok(())
    }
}

impl Channel {
    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let learned = &self.learned;
        writeln!(f, "\n{}, {}", self.name, self.unit)?;
        writeln!(f, "  = {}", self.prediction)?;
        writeln!(
            f,
            "  sd {:.5}, {:.5}, {:.5}; successive residuals correlated {:+.2}; scatter {:.2}; on \
             the part left out {:.2} times as much",
            learned.variance[0].sqrt(),
            learned.offset_sd,
            learned.drift_sd,
            learned.correlation,
            learned.scatter,
            learned.held_out_ratio
        )
    }
}
