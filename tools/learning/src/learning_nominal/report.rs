//! What was learned, and how well it holds.

use std::fmt;

use serde::Serialize;
use vigil_robot::Description;
use vigil_robot::nominal::{Channel, Model, Quantity, Target, Term};

use super::LONG_ENOUGH_S;
use super::terms::word;
use crate::bounds::Bounds;
use crate::learning::RESIDUAL_BAR;

/// Deviation of a pose's velocity at rest from which it is told, m/s or rad/s.
const RESTLESS_M_S: f64 = 0.1;

/// One channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelError {
    /// Channel.
    pub channel: String,
    /// Deviation of one observation's residual at rest, in the channel's unit.
    pub residual_sd: f64,
    /// Correlation of successive residuals.
    pub correlation: f64,
    /// Scatter of the mean from run to run.
    pub offset_sd: f64,
    /// Change of that mean from one observation to the next.
    pub drift_sd: f64,
    /// Mean square of the whitened residual in the noisiest usual run.
    pub scatter: f64,
    /// Root mean square of the whitened residual on the part left out: 1 is the floor.
    pub held_out_ratio: f64,
    /// Factor by which the deviations were widened.
    pub widened: f64,
}

/// Report of learning.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Runs learned from.
    pub runs_learned: usize,
    /// Runs left out.
    pub runs_held_out: usize,
    /// Time in motion, s.
    pub exposure_s: f64,
    /// Channels.
    pub channels: Vec<ChannelError>,
    /// What the user must know.
    pub warnings: Vec<String>,
    /// Numbers of the model that stand on a bound set by hand.
    pub bounds: Bounds,
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
            warnings,
            bounds: Bounds::default(),
        }
    }

    /// Tells which products of powers of the command are left out: of all channels, and of those of
    /// the pose.
    pub(super) fn untold(
        &mut self,
        [all, pose]: &[Vec<Term>; 2],
        model: &Model,
        robot: &Description,
    ) {
        let measured = &robot.measured;
        let others = measured.wheel_rates || measured.yaw_rate || measured.currents;
        let mut tell = |of: &str, terms: &[Term]| {
            let words: Vec<String> = terms.iter().map(|term| word(term, model)).collect();
            if !words.is_empty() {
                self.warnings.push(format!(
                    "{of}predicted without {}: the commands driven do not tell it from lower \
                     powers; an order needs one more value of an axis than it counts, spread over \
                     its range",
                    words.join(", ")
                ));
            }
        };
        if others {
            tell("", all);
        }
        if measured.pose && !(others && all == pose) {
            tell("pose: ", pose);
        }
    }

    pub(super) fn add(&mut self, name: &str, channel: &Channel, widened: f64) {
        if channel.held_out_ratio > RESIDUAL_BAR {
            self.warnings.push(format!(
                "{name}: the residual on the part left out is {:.2} times the floor: the \
                 deviations are widened by that",
                channel.held_out_ratio
            ));
        }
        if channel.rest_sd > RESTLESS_M_S {
            self.warnings.push(format!(
                "{name}: the log has motion of this kind without a command: a robot that runs away \
                 is noticed from about {:.2} m/s or rad/s only",
                3.0 * channel.rest_sd
            ));
        }
        self.channels.push(ChannelError {
            channel: name.to_owned(),
            residual_sd: channel.variance[0].sqrt(),
            correlation: channel.correlation,
            offset_sd: channel.offset_sd,
            drift_sd: channel.drift_sd,
            scatter: channel.scatter,
            held_out_ratio: channel.held_out_ratio,
            widened,
        });
    }

    pub(super) fn finish(&mut self, model: &Model) {
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

/// A channel's name in messages; `wheels`: their names.
pub(super) fn name(target: Target, wheels: &[String]) -> String {
    let wheel = wheels.get(target.wheel).map_or("?", String::as_str);
    match target.quantity {
        Quantity::Forward => "pose, forward".to_owned(),
        Quantity::Lateral => "pose, lateral".to_owned(),
        Quantity::Turn => "pose, turn".to_owned(),
        Quantity::YawRate => "yaw rate".to_owned(),
        Quantity::WheelRate => format!("wheel rate {wheel}"),
        Quantity::Current => format!("current {wheel}"),
    }
}

/// Unit of a quantity.
pub(super) const fn unit(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Forward | Quantity::Lateral => "m per commanded m",
        Quantity::Turn => "rad per commanded m",
        Quantity::YawRate | Quantity::WheelRate => "rad/s",
        Quantity::Current => "A",
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
            "{:<16} {:>12} {:>12} {:>12} {:>10} {:>8} {:>10} {:>8}",
            "channel",
            "deviation",
            "correlation",
            "run offset",
            "drift",
            "scatter",
            "left out",
            "widened"
        )?;
        for channel in &self.channels {
            writeln!(
                f,
                "{:<16} {:>12.5} {:>12.2} {:>12.5} {:>10.5} {:>8.2} {:>10.2} {:>8.2}",
                channel.channel,
                channel.residual_sd,
                channel.correlation,
                channel.offset_sd,
                channel.drift_sd,
                channel.scatter,
                channel.held_out_ratio,
                channel.widened
            )?;
        }
        let lines = self.bounds.lines();
        if !lines.is_empty() {
            writeln!(f)?;
        }
        lines.iter().try_for_each(|line| writeln!(f, "{line}"))
    }
}
