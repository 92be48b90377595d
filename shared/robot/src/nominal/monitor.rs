//! The detection filter of a nominal model: is this still the robot that was learned?
//!
//! Each channel's residual is whitened by its [`ResidualWhitener`]. Two fault states stand against
//! the nominal one, per channel: an unknown constant bias, which is learned
//! ([`Form::LearnedBias`]), and the constant likelihood of any large residual, for faults that show
//! as scatter (a taped wheel jolts the robot once a turn and has no mean). The channels' odds, each
//! tempered by its [`Tail`], add up: a fault enters by one of them, or by all of them at once
//! ([`super::joint`]).
//!
//! Two more states speak for a fault of a channel: it is not measured while the robot moves
//! (`ABSENT_S`), as what is not looked at cannot be healthy; and the pose moves though no motion is
//! commanded ([`REST_S`]), a robot that runs away.
//!
//! All this is done at the prior fault rate at which the tails were found
//! ([`super::channel::FAULT_RATE_1_H`]). Births enter the odds as a factor, so that another rate
//! adds its logarithm to the log-odds of every channel, after they were tempered. Alarms do not
//! depend on it, as their threshold moves by as much.
//!
//! The noise is that of this very robot, measured on its own log; a rise beyond what its runs have
//! shown is a symptom and is not explained away.

use nalgebra::SVector;
use vigil_blocks::WHEELS;
use vigil_inference::ages::WhitenedResidual;
use vigil_inference::constant::Constant;
use vigil_inference::logspace::{log_add, log_normal, log_sum_exp};

use super::channel::{Channel, FAULT_RATE_1_H, Quantity, REST_S, Tail};
use super::joint::Together;
use super::model::Model;
use super::observation::{History, Observation};
use super::track::ResidualWhitener;
use crate::channel_odds::ChannelOdds;
use crate::learned::Form;
use crate::learned::channels::Channels;
use crate::learned::form::{Evidence, TAU_SQUARED_PER_DIMENSION};
use crate::learned::monitor::DetectionOutput;
use crate::slot::{SLOTS, Slot};

/// Standard deviation of a fault's bias in units of the whitened residual. Chosen: it enters the
/// delay by its logarithm only.
const BIAS: f64 = 3.0;
/// Whitened residuals are clipped here: one reading may be a glitch, several in a row are not. One
/// says 17 nats at most: (36 - 1.6) / 2.
const CLIP: f64 = 6.0;
/// A robot that has just begun to move is taken up to speed first, s. Chosen: five observations of
/// 0.1 s.
const START_S: f64 = 0.5;
/// A pose says nothing on the model until the command has been steady for so long, s. Twice
/// [`START_S`]: its velocity is a difference of two poses.
const SETTLE_S: f64 = 1.0;
/// Observed motion after which evidence counts, s. Ten observations: the offset's first estimate.
const READY_S: f64 = 1.0;
/// A channel not measured for longer than this in motion is a fault of it, s. As long as the
/// detector may be blind.
const ABSENT_S: f64 = 1.0;
/// Growth of the deviation per width of the learned range by which a command lies outside it.
/// Chosen: a quarter of the range outside doubles it.
const EXTRAPOLATION: f64 = 4.0;
/// Log-odds below this are reported as this: no evidence for a fault at all.
const LOG_ODDS_MIN: f64 = -700.0;

/// One channel at work.
#[derive(Debug, Clone)]
struct ActiveChannel {
    channel: Channel,
    track: ResidualWhitener,
    bias: Evidence<1>,
    scatter: Constant,
    /// How long it has not been measured in motion, s, and what that says.
    absent_s: f64,
    absent: Evidence<1>,
    /// Motion of the pose while none is commanded.
    rest: Evidence<1>,
    /// What the last observation said for a fault in the values, by silence and at rest.
    gains: [f64; 3],
    /// Its tail for the form in use; none while it is being learned.
    tail: Option<Tail>,
}

impl ActiveChannel {
    /// Whether the channel is there, in motion.
    fn present(&mut self, now: &Observation, form: Form, birth: f64) {
        if self.channel.target.is_measured(now) {
            if self.absent_s > 0.0 {
                (self.absent_s, self.absent) = (0.0, Evidence::new(form, BIAS));
            }
            return;
        }
        self.absent_s += now.dt_s;
        if self.absent_s > ABSENT_S {
            self.absent
                .step(&WhitenedResidual::usual(SVector::from([CLIP])), birth);
            self.gains[1] = self.absent.gain();
        }
    }

    /// Whether the pose rests where no motion is commanded; the next command to move ends it.
    fn rest(&mut self, now: &Observation, form: Form, birth: f64) {
        if now.rest_s <= 0.0 {
            self.rest = Evidence::new(form, BIAS);
            return;
        }
        let velocity = now.drift.filter(|_| now.rest_s >= REST_S);
        let velocity = velocity.and_then(|drift| self.channel.target.quantity.of_pose(drift));
        if let Some(velocity) = velocity.filter(|_| self.channel.rest_sd > 0.0) {
            let whitened = (velocity / self.channel.rest_sd).clamp(-CLIP, CLIP);
            self.rest
                .step(&WhitenedResidual::usual(SVector::from([whitened])), birth);
            self.gains[2] = self.rest.gain();
        }
    }

    /// Log-odds at [`FAULT_RATE_1_H`], and before the last observation. Those of its values are
    /// tempered if a tail is known: how irregular they are says nothing on silence and on rest.
    fn log_odds(&self) -> [f64; 2] {
        let values = log_add(self.bias.log_odds(), self.scatter.log_odds());
        let others = [self.absent.log_odds(), self.rest.log_odds()];
        let at = |[values_gain, absent_gain, rest_gain]: [f64; 3]| {
            let values = values - values_gain;
            let tail = self.tail.as_ref();
            let values = tail.map_or(values, |tail| tail.tempered(values));
            let others = log_add(others[0] - absent_gain, others[1] - rest_gain);
            log_add(values, others)
        };
        [at([0.0; 3]), at(self.gains)]
    }

    /// Takes a whitened residual of its values.
    fn take(&mut self, whitened: f64, birth: f64) {
        let before = log_add(
            log_add(self.bias.log_odds(), birth.ln()),
            log_add(self.scatter.log_odds(), birth.ln()),
        );
        self.bias
            .step(&WhitenedResidual::usual(SVector::from([whitened])), birth);
        let square = whitened * whitened / self.channel.scatter;
        self.scatter
            .step(square, TAU_SQUARED_PER_DIMENSION, birth, birth);
        let after = log_add(self.bias.log_odds(), self.scatter.log_odds());
        // At their bounds the log-odds say less than the readings.
        let bound = self.bias.gain().min(self.scatter.gain());
        self.gains[0] = (after - before).max(bound);
    }
}

/// The detection filter.
#[derive(Debug, Clone)]
pub struct Monitor {
    model: Model,
    sizes: [f64; super::AXES],
    form: Form,
    /// What the prior fault rate adds to the log-odds.
    prior_log_odds: f64,
    watched: Vec<ActiveChannel>,
    together: Option<Together>,
    /// The tail of all channels together; none while it is being learned.
    joint: Option<Tail>,
    run_s: f64,
    report: DetectionOutput,
}

impl Monitor {
    /// A monitor of the channels of `model` that are among `channels`, with a prior fault rate.
    #[must_use]
    pub fn new(model: &Model, channels: Channels, form: Form, fault_rate_1_h: f64) -> Self {
        let used = model.channel.iter();
        let used = used.filter(|channel| channel.is_among(channels));
        let watched = used.map(|channel| ActiveChannel {
            channel: channel.clone(),
            track: ResidualWhitener::new(channel),
            bias: Evidence::new(form, BIAS),
            scatter: Constant::default(),
            absent_s: 0.0,
            absent: Evidence::new(form, BIAS),
            rest: Evidence::new(form, BIAS),
            gains: [0.0; 3],
            tail: channel.tail(form).cloned(),
        });
        let watched: Vec<ActiveChannel> = watched.collect();
        let mut monitor = Self {
            sizes: model.sizes(),
            form,
            prior_log_odds: (fault_rate_1_h / FAULT_RATE_1_H).ln(),
            together: Together::new(form, watched.len(), BIAS),
            joint: model.joint(channels, form).cloned(),
            watched,
            run_s: 0.0,
            report: DetectionOutput {
                log_odds: f64::NEG_INFINITY,
                channels: [f64::NEG_INFINITY; SLOTS],
                gains: [0.0; SLOTS],
                evidence: 0.0,
                degenerate_count: 0,
            },
            model: model.clone(),
        };
        monitor.reset();
        monitor
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        for watched in &mut self.watched {
            watched.track = ResidualWhitener::new(&watched.channel);
            watched.absent_s = 0.0;
        }
        self.run_s = 0.0;
        self.report.evidence = 0.0;
        self.forget_evidence();
    }

    /// Forgets what speaks for a fault, and keeps what is known of the run. Motion at rest is kept
    /// until the robot has moved as told: it is what makes the evidence of such a run count.
    pub fn forget_evidence(&mut self) {
        let has_moved = self.run_s >= READY_S;
        for watched in &mut self.watched {
            watched.bias = Evidence::new(self.form, BIAS);
            watched.scatter = Constant::default();
            watched.absent = Evidence::new(self.form, BIAS);
            if has_moved {
                watched.rest = Evidence::new(self.form, BIAS);
            }
            watched.gains = [0.0; 3];
        }
        if let Some(together) = &mut self.together {
            together.forget();
        }
        self.sum_up();
    }

    /// Log-odds of all channels together at [`FAULT_RATE_1_H`], not tempered; none for a single
    /// channel, and for forms without.
    #[must_use]
    pub fn joint_log_odds(&self) -> Option<f64> {
        self.together.as_ref().map(Together::log_odds)
    }

    /// What the last observation did.
    #[must_use]
    pub const fn report(&self) -> &DetectionOutput {
        &self.report
    }

    /// True once evidence counts: the robot has moved for a while, or does so though it should
    /// rest.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        let mut watched = self.watched.iter();
        self.run_s >= READY_S || watched.any(|watched| watched.rest.log_odds() > 0.0)
    }

    /// Takes the newest observation of `history`. While a fault is `suspected`, nothing is learned
    /// of the run's own offsets.
    pub fn step(&mut self, history: &History, suspected: bool) {
        self.report.evidence = 0.0;
        for watched in &mut self.watched {
            watched.gains = [0.0; 3];
        }
        if let Some(together) = &mut self.together {
            together.begin();
        }
        let Some(now) = history.ago(0) else { return };
        let widening = self.widening(now);
        let share = 1.0 / self.watched.len().max(1) as f64;
        let birth = FAULT_RATE_1_H / 3600.0 * now.dt_s * share;
        let rests = !now.moving || now.moving_s < START_S;
        for watched in &mut self.watched {
            watched.rest(now, self.form, birth);
            if rests {
                watched.track.interrupt();
            }
        }
        if rests {
            self.sum_up();
            return;
        }
        self.run_s += now.dt_s;
        for watched in &mut self.watched {
            watched.present(now, self.form, birth);
            let ActiveChannel { channel, track, .. } = watched;
            let settled = now.steady_s >= SETTLE_S || !channel.target.quantity.is_pose();
            let residual = channel.residual(history, &self.sizes);
            let Some(residual) = residual.filter(|_| settled) else {
                track.interrupt();
                continue;
            };
            let variance = widening * residual.variance;
            let (apart, spread) = track.step(channel, residual.apart, variance, suspected);
            let whitened = (apart / spread.sqrt()).clamp(-CLIP, CLIP);
            watched.take(whitened, birth);
            if let Some(together) = &mut self.together {
                together.add(whitened);
            }
            self.report.evidence += log_normal(apart, spread);
        }
        if let Some(together) = &mut self.together {
            together.step(birth);
        }
        self.sum_up();
    }

    /// Factor on all variances for a command outside the learned range.
    fn widening(&self, now: &Observation) -> f64 {
        let axes = self.model.command.iter().zip(&now.command);
        let beyond = axes.map(|(range, value)| range.beyond(*value));
        let beyond = beyond.fold(0.0, f64::max);
        let factor = 1.0 + EXTRAPOLATION * beyond;
        factor * factor
    }

    fn sum_up(&mut self) {
        let mut odds = ChannelOdds::none();
        let mut enter = |slot: usize, [now, before]: [f64; 2]| {
            odds.enter(
                slot,
                now + self.prior_log_odds,
                before + self.prior_log_odds,
            );
        };
        for watched in &self.watched {
            let target = watched.channel.target;
            let wheel = target.wheel.min(WHEELS - 1);
            let slot = match target.quantity {
                Quantity::YawRate => Slot::YAW_RATE,
                Quantity::WheelRate => Slot::wheel_rate(wheel),
                Quantity::Current => Slot::current(wheel),
                _ => Slot::POSE,
            };
            enter(slot, watched.log_odds());
        }
        let each = odds.gain();
        if let (Some(together), Some(tail)) = (&self.together, &self.joint) {
            let all = together.log_odds();
            let [now, before] = [all, all - together.gain()].map(|all| tail.tempered(all));
            let prior = self.prior_log_odds;
            odds.enter(Slot::ANY, now + prior, before + prior);
        }
        let channels = odds.by_channel();
        self.report.gains = odds.gains();
        if !self.together.as_ref().is_some_and(Together::is_complete) {
            // Where not all were read, an end shows in those that were.
            self.report.gains[Slot::ANY] = each;
        }
        self.report.log_odds = log_sum_exp(&channels).max(LOG_ODDS_MIN);
        self.report.channels = channels.map(|value| value.max(LOG_ODDS_MIN));
    }
}
