//! One channel of a model: from what it is predicted, and how well.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::AXES;
use super::component::Drive;
use super::coverage::product;
use super::observation::{DEPTH, History, SMOOTHING_S};

/// Part of a drive's largest commanded speed at which its sense of turning counts as half decided:
/// friction changes its sign with it.
const SENSE: f64 = 0.05;
/// A residual that is so many deviations beyond the one before says no more: it may be a glitch.
pub const CLIP: f64 = 6.0;

/// How far back the command matters to what a robot does, s, and in how many observations at least.
const MEMORY_S: f64 = 0.8;
const LAGS_MIN: usize = 2;

/// Observations that a prediction looks back.
#[must_use]
pub fn lags(interval_s: f64) -> usize {
    ((MEMORY_S / interval_s).round() as usize).clamp(LAGS_MIN, DEPTH - 1)
}

/// What a term is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Regressor {
    /// 1.
    Constant,
    /// Product of powers of the command's axes, each divided by its learned size.
    Command,
    /// One axis of the command, some observations ago, divided by its learned size.
    Lagged,
    /// One axis of the command, smoothed with a time constant and divided by its learned size,
    /// times the product of powers of the axes as they are.
    Smoothed,
    /// Sense of a drive's commanded speed, -1 to 1.
    Sense,
}

/// One term of a prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Term {
    /// What it is.
    pub of: Regressor,
    /// Axis of the command, or drive.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub index: usize,
    /// Observations ago; of a smoothed axis the place of its time constant.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub lag: usize,
    /// Powers, one per axis of the block's command vector; for `command` and `smoothed`.
    #[serde(default, skip_serializing_if = "are_zero")]
    pub powers: [u8; AXES],
}

fn is_zero(value: &usize) -> bool {
    *value == 0
}

fn are_zero(powers: &[u8; AXES]) -> bool {
    powers.iter().all(|&power| power == 0)
}

/// What the terms of a robot's channels are made of.
#[derive(Debug, Clone)]
pub struct Scales {
    /// Learned size of each axis of the command; 1 for axes that do not exist.
    pub axes: [f64; AXES],
    /// Largest commanded speed of each drive.
    pub speeds: Vec<f64>,
    /// The drives.
    pub drives: Vec<Drive>,
    /// Observations that a prediction looks back.
    pub lags: usize,
}

impl Scales {
    /// Of so large commands, and observations of this length.
    #[must_use]
    pub fn new(axes: [f64; AXES], drives: Vec<Drive>, interval_s: f64) -> Self {
        let reach = |drive: &Drive| {
            let parts = drive.speed.iter().zip(&axes);
            parts.map(|(a, b)| (a * b).abs()).sum::<f64>().max(1e-9)
        };
        Self {
            axes,
            speeds: drives.iter().map(reach).collect(),
            drives,
            lags: lags(interval_s),
        }
    }

    /// Commands with what terms are made of.
    #[must_use]
    pub fn scaled(&self, commands: &Commands) -> ScaledCommands {
        ScaledCommands {
            plain: *commands,
            scaled: commands
                .map(|command| std::array::from_fn(|axis| command[axis] / self.axes[axis])),
        }
    }
}

/// The newest commands.
#[derive(Debug, Clone)]
pub struct ScaledCommands {
    plain: Commands,
    /// Each axis divided by its learned size.
    scaled: Commands,
}

impl Term {
    /// A term of one axis or drive.
    #[must_use]
    pub const fn new(of: Regressor, index: usize, lag: usize) -> Self {
        Self {
            of,
            index,
            lag,
            powers: [0; AXES],
        }
    }

    /// A product of powers of the command's axes; without any, the constant.
    #[must_use]
    pub fn command(powers: [u8; AXES]) -> Self {
        let of = if are_zero(&powers) {
            Regressor::Constant
        } else {
            Regressor::Command
        };
        Self {
            of,
            index: 0,
            lag: 0,
            powers,
        }
    }

    /// Its value under commands.
    #[must_use]
    pub fn value(&self, commands: &ScaledCommands, scales: &Scales) -> f64 {
        let place = match self.of {
            Regressor::Smoothed => DEPTH + self.lag,
            _ => self.lag,
        };
        let place = place.min(commands.plain.len() - 1);
        let axis = self.index.min(AXES - 1);
        match self.of {
            Regressor::Constant => 1.0,
            Regressor::Command => product(&self.powers, &commands.scaled[place]),
            Regressor::Lagged => commands.scaled[place][axis],
            Regressor::Smoothed if are_zero(&self.powers) => commands.scaled[place][axis],
            Regressor::Smoothed => {
                commands.scaled[place][axis] * product(&self.powers, &commands.scaled[0])
            }
            Regressor::Sense => {
                let drive = scales.drives.get(self.index);
                let speed = drive.map_or(0.0, |drive| drive.commanded(&commands.plain[place]));
                let largest = scales.speeds.get(self.index).copied().unwrap_or(1.0);
                (speed / (SENSE * largest)).tanh()
            }
        }
    }
}

/// What a variance is made of: a constant, the square of the command (each axis divided by its
/// learned size), and the square of what the prediction has changed by since the last observation
/// (no two channels keep the same time).
pub type VarianceBasis = [f64; 3];

/// A channel's prediction and what is known of its error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// Its name.
    pub name: String,
    /// What it comes back to the same after, in its unit, if it is an angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period: Option<f64>,
    /// Terms of the prediction.
    pub terms: Vec<Term>,
    /// Weight of each term.
    pub weights: Vec<f64>,
    /// Variance of the residual of one observation: constant, by the square of the command, by the
    /// square of what the prediction has changed by.
    pub variance: VarianceBasis,
    /// Whether its level wanders without a fault: the prediction is of what departs from that.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub drifts: bool,
    /// Standard deviations of a run's own offset, in the channel's unit, and of its own gain.
    pub context_sd: [f64; 2],
    /// Root mean square of the channel's value in motion.
    pub usual: f64,
    /// Longest silence of a healthy one, s.
    pub silence_s: f64,
    /// Root mean square of the residual on the parts left out, over that on parts learned from.
    pub held_out_ratio: f64,
}

/// The commands that a prediction looks back on, newest first, then the smoothed ones.
pub type Commands = [[f64; AXES]; DEPTH + SMOOTHING_S.len()];

/// The newest commands of a record; before its beginning the first one.
#[must_use]
pub fn commands(history: &History) -> Commands {
    let newest = history.ago(0).copied().unwrap_or_default();
    std::array::from_fn(|place| match place.checked_sub(DEPTH) {
        Some(smoothed) => newest.smoothed[smoothed],
        None => *history.command(place),
    })
}

impl Channel {
    /// What [`Self::variance`] is multiplied by, with the prediction and the one before.
    #[must_use]
    pub fn basis(
        command: &[f64; AXES],
        scales: &Scales,
        predicted: f64,
        before: f64,
    ) -> VarianceBasis {
        let parts = command.iter().zip(&scales.axes);
        let size: f64 = parts
            .map(|(value, size)| (value / size) * (value / size))
            .sum();
        let change = predicted - before;
        [1.0, size, change * change]
    }

    /// Variance of a residual.
    #[must_use]
    pub fn variance_at(&self, basis: VarianceBasis) -> f64 {
        let parts = self.variance.iter().zip(basis);
        parts.map(|(part, basis)| part * basis).sum()
    }
}
