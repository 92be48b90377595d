//! What the wheels of one observation say, for everything that each may be doing.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;
use vigil_inference::logspace::log_add;

use super::steer_reading::{ANYTHING, SteerReading};
use super::wheel_context::RateResidual;
use super::wheels::{ExpectedRate, rolling_rate};
use super::{
    EncoderState, Model, MotionMode, Mover, NoiseScales, Observation, RateModel, WheelContext,
};
use crate::description::Description;

/// Ways in which an encoder breaks: zero, frozen, noise, dead (zero plus the sensor's noise).
pub const BREAKAGES: [EncoderState; 4] = [
    EncoderState::Zero,
    EncoderState::Frozen,
    EncoderState::Noise,
    EncoderState::Standing,
];
/// Index among [`BREAKAGES`] of what reads as a standing wheel's encoder does. Whole is none of
/// these: an identifier that counts it as state 0 has each breakage one further on.
const DEAD: usize = 3;
/// Index of noise among them, and the share of its observations that read right, as with a loose
/// contact. Chosen: so two or three that chance puts there are no end of the fault; six are, in
/// 0.3 s.
const NOISE: usize = 2;
const READS_RIGHT: f64 = 0.1;
/// Prior shares of [`BREAKAGES`]. Chosen: three alike, as nothing is known; dead is rarer, or a
/// stuck wheel would wait 2 nats for its name.
pub const BREAKAGE_SHARES: [f64; BREAKAGES.len()] = [0.32, 0.32, 0.32, 0.04];

/// Share of healthy wheels' rates in the tail: while all is well, and while another wheel drags.
/// Chosen: a lone jolt, one observation in fifty, costs 3.9 nats; five times as often while one
/// drags.
const TAIL: f64 = 0.02;
const TAIL_DRAGGED: f64 = 0.1;
/// What dragging wheels change of the others' rates: its deviation from what is expected, relative
/// to it. One drags otherwise on another ground; of several together nothing was learned. Chosen:
/// what the equilibrium leaves out; the rest is learned on the way.
pub const DRAG_SD: f64 = 0.4;
/// An offset that is learned on the way is this much smaller where one wheel drags: what it does
/// was learned. Chosen: as wide as of several, a dead encoder explains a second stuck wheel too
/// well; none at all, and a second stuck wheel explains a dead encoder.
const ALONE: f64 = 0.5;
/// What a wheel that stands askew may change of its own rate, relative to it: with [`DRAG_SD`]
/// a tenth is one deviation. Chosen: askew by 0.3 rad, rolling alone loses a twentieth.
const ASKEW: f64 = 0.25;
/// Share of the observations at an onset that hold the very moment. Of three to four within the
/// onset's 0.15 s, one does (a quarter, and some).
const MOMENT: f64 = 0.2;

/// Natural log-likelihoods of one observation's wheel readings; comparable within a wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelEvidence {
    /// The wheel turns as in nominal motion.
    pub healthy: [f64; WHEELS],
    /// Its encoder is broken in each of [`BREAKAGES`].
    pub broken: [[f64; BREAKAGES.len()]; WHEELS],
    /// It turns, or is said to turn, at a rate of its own.
    pub own_rate: [f64; WHEELS],
    /// It does anything.
    pub any: [f64; WHEELS],
    /// Steering angles, where they are read.
    pub steer: [Option<SteerReading>; WHEELS],
    /// Rate by rolling, and its variance by the lag of the body.
    rolling: [(f64, f64); WHEELS],
    /// What the context adds to the model's rate, and its variance.
    shift: [(f64, f64); WHEELS],
    /// Rate of a healthy wheel in nominal motion, rad/s, and its variance.
    nominal: [(f64, f64); WHEELS],
    sample_sd: [f64; WHEELS],
}

/// How a wheel turns while others drag.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct WheelDrag {
    /// Expected rate, rad/s.
    pub rate_rad_s: f64,
    /// What the drag changes of it, rad/s.
    pub change_rad_s: f64,
    /// What an offset of 1 adds to it, where that is learned on the way.
    pub unit_rad_s: f64,
    /// Variance about it from one observation to the next, (rad/s)².
    pub variance: f64,
}

impl WheelDrag {
    /// Variance of the rate where nothing of the change was learned on the way, (rad/s)².
    fn variance_unlearned(&self) -> f64 {
        let sd = DRAG_SD * self.change_rad_s;
        self.variance + sd * sd
    }
}

impl WheelEvidence {
    /// The evidence of an observation whose sensors are so noisy, in a context of the wheels.
    #[must_use]
    pub fn new(
        model: &Model,
        robot: &Description,
        observation: &Observation,
        noise: NoiseScales,
        context: &WheelContext,
    ) -> Self {
        let learned = model.noise.wheel_rate_rad_s;
        let samples = observation.sample_variances(model, learned, noise.wheels);
        let sample_sd = samples.map(f64::sqrt);
        let steer = SteerReading::all(model, robot, observation, &noise);
        let mut evidence = Self {
            healthy: [0.0; WHEELS],
            broken: [[0.0; BREAKAGES.len()]; WHEELS],
            own_rate: [0.0; WHEELS],
            any: [0.0; WHEELS],
            steer,
            rolling: [(0.0, 0.0); WHEELS],
            shift: [(0.0, 0.0); WHEELS],
            nominal: [(0.0, 0.0); WHEELS],
            sample_sd,
        };
        let command = observation.command;
        for i in 0..robot.wheels.len().min(WHEELS) {
            let read = |state| {
                let reading = &observation.wheels[i];
                model
                    .encoder
                    .log_likelihood(state, reading, evidence.sample_sd[i])
            };
            let rate = rolling_rate(robot, i, command[0], command[1]);
            let lagged = rolling_rate(robot, i, observation.curvature, observation.speed);
            let behind = (rate - lagged) * (rate - lagged);
            evidence.rolling[i] = (rate, behind);
            let (shift, uncertain) = context.shift(i, rate);
            evidence.shift[i] = (shift, uncertain);
            let (mean, variance) = model.nominal.rates[i].rate(rate, command[0]);
            let variance = variance + behind + uncertain;
            evidence.nominal[i] = (mean + shift, variance);
            evidence.healthy[i] = read(EncoderState::Turning(ExpectedRate {
                mean_rad_s: mean + shift,
                variance,
                tail: TAIL,
            }));
            // As uncertain by a change of the command as a wheel that follows it.
            evidence.own_rate[i] = read(EncoderState::OwnRate(behind));
            evidence.any[i] = read(EncoderState::Any);
            evidence.broken[i] = BREAKAGES.map(read);
            let right = READS_RIGHT.ln() + evidence.healthy[i];
            let noise = &mut evidence.broken[i][NOISE];
            *noise = log_add((1.0 - READS_RIGHT).ln() + *noise, right);
        }
        evidence
    }

    /// Wheel `i` with a whole encoder while the robot is moved so. At the onset (`is_new`) a stuck
    /// wheel may read anything, as an observation may hold the very moment, and the others may
    /// still turn as before: the robot slows down within a few tenths of a second.
    #[must_use]
    pub fn whole(
        &self,
        model: &Model,
        observation: &Observation,
        mode: &MotionMode,
        is_new: bool,
        i: usize,
    ) -> f64 {
        let either = |a: f64, b: f64| match is_new {
            true => log_add(a, b) - std::f64::consts::LN_2,
            false => a,
        };
        match mode.moved {
            moved if moved.is_stuck(i) && is_new => log_add(
                (1.0 - MOMENT).ln() + self.standing(i),
                MOMENT.ln() + self.any[i],
            ),
            moved if moved.is_stuck(i) => self.standing(i),
            Mover::Stuck(_) => {
                let dragged = self.dragged(model, observation, mode, i);
                let variance = dragged.variance_unlearned();
                let dragged = self.turning(model, observation, i, dragged.rate_rad_s, variance);
                either(dragged, self.healthy[i])
            }
            Mover::UnknownAny => self.unsure(i),
            // A wheel that stands askew rolls as it can.
            Mover::Steer(askew) if askew == i => self.unsure(i),
            Mover::Nominal | Mover::Unknown | Mover::Steer(_) | Mover::Pose => self.healthy[i],
        }
    }

    /// How wheel `i`, which is not stuck, turns while others drag.
    #[must_use]
    pub fn dragged(
        &self,
        model: &Model,
        observation: &Observation,
        mode: &MotionMode,
        i: usize,
    ) -> WheelDrag {
        let (rolling, behind) = self.rolling[i];
        let curvature = observation.command[0];
        let rate = |rates: &[RateModel]| rates[i].rate(rolling, curvature);
        let (nominal, nominal_variance) = rate(&model.nominal.rates);
        let (shift, uncertain) = self.shift[i];
        let (mut change, mut variance) = (rate(&mode.beyond).0, 0.0_f64);
        let dragging = (0..WHEELS).filter(|&wheel| mode.moved.is_stuck(wheel));
        for stuck in dragging.filter_map(|wheel| model.stuck(wheel)) {
            let (with, its) = rate(&stuck.rates);
            // What a wheel does alone, while the robot moves, says nothing of one that stands.
            change += if mode.moved.is_immobile() {
                0.0
            } else {
                with - nominal
            };
            // Not the sum: more stuck wheels must not always be the less likely ones.
            variance = variance.max(its);
        }
        if mode.moved.stuck() == 0 {
            variance = nominal_variance;
        }
        let share = match mode.moved.stuck().count_ones() {
            1 => ALONE,
            _ => 1.0,
        };
        // A wheel that stands askew is turned by the ground, too.
        let askew = if mode.moved == Mover::Steer(i) {
            ASKEW * nominal
        } else {
            0.0
        };
        WheelDrag {
            rate_rad_s: nominal + shift + change,
            change_rad_s: change + askew,
            unit_rad_s: share * change + askew,
            variance: variance + behind + uncertain,
        }
    }

    /// What wheel `i` reads beside the model's rate in a mode, if it was read.
    #[must_use]
    pub fn beside(
        &self,
        model: &Model,
        observation: &Observation,
        mode: &MotionMode,
        i: usize,
    ) -> Option<RateResidual> {
        let reading = &observation.wheels[i];
        let (shift, uncertain) = self.shift[i];
        let dragged = self.dragged(model, observation, mode, i);
        (reading.plain > 0).then(|| RateResidual {
            residual_rad_s: reading.mean - (dragged.rate_rad_s - shift),
            rolling_rad_s: self.rolling[i].0,
            variance: dragged.variance_unlearned() - uncertain
                + self.sample_variance(i, reading.plain),
        })
    }

    /// Rate of wheel `i` as a mode has it turn, also where the wheel is stuck in that mode.
    #[must_use]
    pub fn rate(
        &self,
        model: &Model,
        observation: &Observation,
        mode: &MotionMode,
        i: usize,
    ) -> ExpectedRate {
        if mode.moved.stuck() == 0 || mode.moved.is_stuck(i) {
            let (mean_rad_s, variance) = self.nominal[i];
            return ExpectedRate {
                mean_rad_s,
                variance,
                tail: TAIL,
            };
        }
        let dragged = self.dragged(model, observation, mode, i);
        ExpectedRate {
            mean_rad_s: dragged.rate_rad_s,
            variance: dragged.variance_unlearned(),
            tail: TAIL_DRAGGED,
        }
    }

    /// Encoder `i` reads about this rate.
    #[must_use]
    pub fn reads(
        &self,
        model: &Model,
        observation: &Observation,
        i: usize,
        expected: ExpectedRate,
    ) -> f64 {
        let state = EncoderState::Turning(expected);
        let reading = &observation.wheels[i];
        model
            .encoder
            .log_likelihood(state, reading, self.sample_sd[i])
    }

    /// Wheel `i` turns at about this rate, rad/s, with this variance, while others drag.
    #[must_use]
    pub fn turning(
        &self,
        model: &Model,
        observation: &Observation,
        i: usize,
        mean_rad_s: f64,
        variance: f64,
    ) -> f64 {
        let expected = ExpectedRate {
            mean_rad_s,
            variance,
            tail: TAIL_DRAGGED,
        };
        self.reads(model, observation, i, expected)
    }

    /// Wheel `i` stands and its encoder is whole. The very number that a dead encoder has: what
    /// reads alike is told apart by the motion alone.
    #[must_use]
    pub const fn standing(&self, i: usize) -> f64 {
        self.broken[i][DEAD]
    }

    /// Variance of the mean of `plain` samples of a wheel's rate by the sensor's noise, (rad/s)².
    #[must_use]
    pub fn sample_variance(&self, wheel: usize, plain: u32) -> f64 {
        let sample_sd = self.sample_sd[wheel];
        sample_sd * sample_sd / f64::from(plain.max(1))
    }

    /// Steering angles that may be anything, relative to angles as commanded.
    #[must_use]
    pub fn steering(&self) -> f64 {
        let read = self.steer.iter().flatten();
        read.map(SteerReading::log_ratio_unsure).sum()
    }

    /// Wheel `i` may do anything or turn as it should, as in the unknown.
    fn unsure(&self, i: usize) -> f64 {
        log_add(
            (1.0 - ANYTHING).ln() + self.healthy[i],
            ANYTHING.ln() + self.any[i],
        )
    }

    /// Any of the ways to break, by their shares.
    #[must_use]
    pub fn broken_anyhow(&self, i: usize) -> f64 {
        let parts = self.broken[i].iter().zip(BREAKAGE_SHARES);
        parts.fold(f64::NEG_INFINITY, |sum, (log_p, share)| {
            log_add(sum, share.ln() + log_p)
        })
    }
}
