//! One channel of a nominal model: what it measures, from what it is predicted, and how well.

use serde::{Deserialize, Serialize};
use vigil_blocks::WHEELS;

use super::AXES;
use super::observation::{History, Observation};
use crate::learned::Form;
use crate::learned::channels::Channels;

/// Rate at which a wheel's sense of turning counts as half decided, rad/s: friction changes its
/// sign with it. A few deviations of a coarse encoder.
const SENSE_RAD_S: f64 = 0.5;
/// Rest after which a robot has stopped, s: motion then was not commanded. Chosen: as long as a
/// robot may take to stop.
pub const REST_S: f64 = 1.0;
/// Prior fault rate at which log-odds are collected and tempered, 1/h.
pub const FAULT_RATE_1_H: f64 = 1.0;

/// Channels of a model at most.
pub(super) const CHANNELS_MAX: usize = 2 * WHEELS + 4;

/// What a channel measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Displacement along the commanded direction per commanded metre of path.
    Forward,
    /// Displacement to the left of the commanded direction per commanded metre of path.
    Lateral,
    /// Turn per commanded metre of path, rad/m.
    Turn,
    /// Yaw rate of the gyro, rad/s.
    YawRate,
    /// Rate of a wheel, rad/s.
    WheelRate,
    /// Current of a motor, A.
    Current,
}

impl Quantity {
    /// True for what is taken from the pose.
    #[must_use]
    pub const fn is_pose(self) -> bool {
        matches!(self, Self::Forward | Self::Lateral | Self::Turn)
    }

    /// The quantity in a velocity of the pose: forward, left, turn; none for what is no pose's.
    #[must_use]
    pub fn of_pose(self, velocity: [f64; 3]) -> Option<f64> {
        match self {
            Self::Forward => Some(velocity[0]),
            Self::Lateral => Some(velocity[1]),
            Self::Turn => Some(velocity[2]),
            Self::YawRate | Self::WheelRate | Self::Current => None,
        }
    }
}

/// A measured channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// What it measures.
    pub quantity: Quantity,
    /// Index of its wheel; 0 where it has none.
    #[serde(default)]
    pub wheel: usize,
}

impl Target {
    /// The channel's value in the newest observation; none if it was not measured, or says nothing
    /// there (a pose while no motion is commanded).
    #[must_use]
    pub fn value(&self, now: &Observation) -> Option<f64> {
        match self.quantity {
            Quantity::Forward => now.per_metre.map(|moved| moved[0]),
            Quantity::Lateral => now.per_metre.map(|moved| moved[1]),
            Quantity::Turn => now.per_metre.map(|moved| moved[2]),
            Quantity::YawRate => now.yaw_rate,
            Quantity::WheelRate => *now.wheels.get(self.wheel)?,
            Quantity::Current => *now.currents.get(self.wheel)?,
        }
    }

    /// True if the newest observation has it, whether it says anything there or not.
    #[must_use]
    pub(crate) fn is_measured(&self, now: &Observation) -> bool {
        match self.quantity {
            Quantity::Forward | Quantity::Lateral | Quantity::Turn => now.has_pose,
            Quantity::YawRate | Quantity::WheelRate | Quantity::Current => {
                self.value(now).is_some()
            }
        }
    }
}

/// What a term is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Regressor {
    /// 1.
    Constant,
    /// Product of powers of the command's axes, each divided by its learned size.
    Command,
    /// One axis of the command, some observations ago, divided by its learned size.
    Lagged,
    /// Rate of a wheel some observations ago, rad/s.
    Wheel,
    /// Magnitude of a wheel's rate, rad/s.
    WheelSpeed,
    /// Sense of a wheel's turning, -1 to 1.
    WheelSense,
}

/// One term of a prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Term {
    /// What it is.
    pub of: Regressor,
    /// Axis of the command, or wheel.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub index: usize,
    /// Observations ago.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub lag: usize,
    /// Powers, one per axis of the block's command vector; for `command`.
    #[serde(default, skip_serializing_if = "are_zero")]
    pub powers: [u8; AXES],
}

fn is_zero(value: &usize) -> bool {
    *value == 0
}

fn is_unknown(deviation: &f64) -> bool {
    *deviation == 0.0
}

fn are_zero(powers: &[u8; AXES]) -> bool {
    powers.iter().all(|&power| power == 0)
}

impl Term {
    /// A term of one axis or wheel.
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

    /// Its value `ago` observations before the newest; `size` holds the learned size of each axis.
    /// None if it was not measured.
    #[must_use]
    pub fn value(&self, history: &History, ago: usize, size: &[f64; AXES]) -> Option<f64> {
        let then = history.ago(ago + self.lag)?;
        let axis = |i: usize| Some(then.command.get(i)? / size.get(i)?);
        let wheel = || *then.wheels.get(self.index)?;
        match self.of {
            Regressor::Constant => Some(1.0),
            Regressor::Command => {
                let mut product = 1.0;
                for (i, power) in self.powers.into_iter().enumerate().filter(|&(_, p)| p > 0) {
                    product *= axis(i)?.powi(i32::from(power));
                }
                Some(product)
            }
            Regressor::Lagged => axis(self.index),
            Regressor::Wheel => wheel(),
            Regressor::WheelSpeed => Some(wheel()?.abs()),
            Regressor::WheelSense => Some((wheel()? / SENSE_RAD_S).tanh()),
        }
    }
}

/// A channel's prediction and what is known of its error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// What is measured.
    pub target: Target,
    /// Terms of the prediction.
    pub terms: Vec<Term>,
    /// Weight of each term.
    pub weights: Vec<f64>,
    /// Variance of the residual of one observation: the first value, plus the second times the
    /// square of the commanded path speed in m/s, plus the third times the square of what the
    /// prediction has changed by since the last observation (no two channels keep the same time).
    pub variance: [f64; 3],
    /// Correlation of successive residuals. Negative: each carries an error that the next takes
    /// back (increments of a noisy pose), above -0.5. Positive: it decays, below 1.
    pub correlation: f64,
    /// Standard deviation of a run's own constant offset (its ground, its battery).
    pub offset_sd: f64,
    /// Standard deviation of the offset's change from one observation to the next (a ground that
    /// is not even).
    pub drift_sd: f64,
    /// Of a pose: standard deviation of its velocity over one observation while no motion is
    /// commanded, m/s or rad/s; 0: not known, motion at rest is not looked for.
    #[serde(default, skip_serializing_if = "is_unknown")]
    pub rest_sd: f64,
    /// Mean square of the whitened residual in the noisiest usual run, at least 1: more than that
    /// counts as scatter.
    pub scatter: f64,
    /// Root mean square of the whitened residual on the part left out, over that expected: about 1.
    pub held_out_ratio: f64,
    /// How its log-odds behave without a fault, one per form of the detection filter.
    #[serde(default)]
    pub tails: Vec<Tail>,
}

/// How often the log-odds of one channel exceed a level without a fault: more rarely by
/// `exp(-slope)` per unit. No channel is as regular as its model: what the less regular ones claim
/// counts less.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tail {
    /// Form of the detection filter.
    pub form: String,
    /// Level, natural log-odds at [`FAULT_RATE_1_H`].
    pub level_log_odds: f64,
    /// Mean time between exceedances of it, h.
    pub interval_h: f64,
    /// Slope.
    pub slope: f64,
}

impl Tail {
    /// The log-odds that a channel without flaw would give for an event as rare. For such a one
    /// they grow as the logarithm of the time between exceedances, at a prior rate of 1/h.
    ///
    /// `log_odds` are those at this rate, [`FAULT_RATE_1_H`]. A prior rate of `r` times as much
    /// raises the odds of a flawless channel by the factor `r` and makes nothing healthy rarer, so
    /// that the tempered log-odds grow by `ln r`: not by `slope · ln r`, as they would if the raw
    /// ones grew first.
    #[must_use]
    pub fn tempered(&self, log_odds: f64) -> f64 {
        self.interval_h.ln() + self.slope * (log_odds - self.level_log_odds)
    }
}

impl Channel {
    /// True if it belongs to a set of channels.
    #[must_use]
    pub(crate) fn is_among(&self, channels: Channels) -> bool {
        channels.use_wheels() || self.target.quantity.is_pose()
    }

    /// Its tail for a form of the detection filter.
    #[must_use]
    pub fn tail(&self, form: Form) -> Option<&Tail> {
        self.tails.iter().find(|tail| tail.form == form.name())
    }

    /// Log-odds at [`FAULT_RATE_1_H`], tempered if a tail is known.
    #[must_use]
    pub fn tempered(&self, form: Form, log_odds: f64) -> f64 {
        self.tail(form)
            .map_or(log_odds, |tail| tail.tempered(log_odds))
    }

    /// Measured less predicted value, and how much the prediction has changed since the last
    /// observation; none if one of them is not known.
    #[must_use]
    pub fn residual(&self, history: &History, size: &[f64; AXES]) -> Option<Residual> {
        let now = history.ago(0)?;
        let predicted = self.predict(history, 0, size)?;
        let change = predicted - self.predict(history, 1, size)?;
        let [base, by_speed, by_change] = self.variance;
        let speed = now.path_speed_m_s;
        Some(Residual {
            apart: self.target.value(now)? - predicted,
            basis: [1.0, speed * speed, change * change],
            variance: base + by_speed * speed * speed + by_change * change * change,
        })
    }

    fn predict(&self, history: &History, ago: usize, size: &[f64; AXES]) -> Option<f64> {
        let mut predicted = 0.0;
        for (term, weight) in self.terms.iter().zip(&self.weights) {
            predicted += weight * term.value(history, ago, size)?;
        }
        Some(predicted)
    }
}

/// What is left of a measured value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Measured less predicted value.
    pub apart: f64,
    /// What [`Channel::variance`] is multiplied by.
    pub basis: [f64; 3],
    /// Its variance.
    pub variance: f64,
}
