//! Gyro and currents of each observation beside what is expected of a healthy robot.
//!
//! Of a current: what the model says at this command, and what the slopes add. Of the gyro: the
//! turn of the pose's track, and the gyro's bias. Noise and context are learned on the way.

use vigil_blocks::WHEELS;
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_inference::slow_state::{Drift, SlowState};
use vigil_inference::track::Displacement;

use super::current_context::{CurrentBeside, CurrentContext};
use super::further::{Further, FurtherModel};
use super::noise_scale::{NoiseScale, STEADY_COMMAND};
use super::wheels::{rolling_rate, steering_angle};
use super::{Model, Observation, Reading};
use crate::description::Description;
use crate::slot::Slot;
use crate::suspects::Suspects;

/// What the pose's track says of the gyro.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// Yaw rate, rad/s.
    pub rate_rad_s: f64,
    /// Its variance by the lag of the body and by gaps, (rad/s)².
    pub variance: f64,
}

impl Turn {
    /// What a track says that turns by so much, rad, in a displacement; None where it starts anew.
    #[must_use]
    pub fn expected(
        model: &Model,
        observation: &Observation,
        turned_rad: impl FnOnce(&Displacement) -> f64,
    ) -> Option<Self> {
        let over_s = observation.middles_s;
        let is_known = !observation.anchor && over_s > 0.0;
        is_known.then(|| {
            let step = observation.displacement(model, &model.nominal.motion);
            let rate_rad_s = turned_rad(&step) / over_s;
            // After a gap the gyro reads how the robot turns now, not how it did on the average.
            let [curvature, speed] = observation.command;
            let changed = (curvature * speed - rate_rad_s) * (1.0 - observation.covered());
            Self {
                rate_rad_s,
                variance: observation.turn_variance / (over_s * over_s) + changed * changed,
            }
        })
    }
}

/// One channel beside what is expected of it, in its own unit.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Residual {
    /// As read, less what is expected.
    pub apart: f64,
    /// Variance of that.
    pub variance: f64,
    /// What is expected.
    pub expected: f64,
    /// Share of the channel's samples that are outliers.
    pub outlier_rate: f64,
}

/// Of one observation; None where a channel was not read.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub struct Residuals {
    /// Motor currents, A.
    pub currents: [Option<Residual>; WHEELS],
    /// Yaw rate, rad/s.
    pub yaw_rate: Option<Residual>,
}

/// Index of the gyro among these channels, after the currents.
pub(super) const GYRO: usize = WHEELS;

/// Follows gyro and currents.
#[derive(Debug, Clone, Checkpoint)]
pub struct FurtherWatch {
    #[checkpoint(fixed)]
    model: FurtherModel,
    wheels: usize,
    context: CurrentContext,
    bias: SlowState,
    bias_drift: Option<Drift>,
    noise: [NoiseScale; WHEELS + 1],
    last: Option<(Observation, Further)>,
    turn_before: Option<f64>,
}

impl FurtherWatch {
    /// Nothing seen yet; None if the model knows none of these channels.
    #[must_use]
    pub fn new(model: &Model, robot: &Description) -> Option<Self> {
        let tolerance = robot.tolerance;
        let bias_drift = tolerance.and_then(|tolerance| {
            Some(Drift {
                tolerance: tolerance.further?.yaw_rate_rad_s,
                length_m: tolerance.length_m,
            })
        });
        let mut watch = Self {
            model: model.further.clone()?,
            wheels: robot.wheels.len().min(WHEELS),
            context: CurrentContext::default(),
            bias: SlowState::default(),
            bias_drift,
            noise: [NoiseScale::default(); WHEELS + 1],
            last: None,
            turn_before: None,
        };
        watch.reset(robot);
        Some(watch)
    }

    /// Forgets everything.
    pub fn reset(&mut self, robot: &Description) {
        let tolerance = robot.tolerance.and_then(|tolerance| tolerance.further);
        self.context = CurrentContext::new(tolerance);
        let drift = self.bias_drift.as_ref();
        self.bias = drift.map_or_else(SlowState::default, SlowState::new);
        self.noise = [NoiseScale::default(); WHEELS + 1];
        (self.last, self.turn_before) = (None, None);
    }

    /// What was learned of the channels.
    #[must_use]
    pub const fn model(&self) -> &FurtherModel {
        &self.model
    }

    /// Wheels watched.
    #[must_use]
    pub const fn wheels(&self) -> usize {
        self.wheels
    }

    /// True once the noise of these channels is known: that of one of the currents has been seen
    /// often enough, as a broken sensor shows none. A model without currents has none to wait for:
    /// the gyro's noise is not waited for.
    #[must_use]
    pub fn is_known(&self) -> bool {
        let mut currents = self.noise[..self.wheels].iter();
        self.model.currents.is_none() || currents.any(NoiseScale::is_known)
    }

    /// Takes one observation; what `suspects` read teaches it nothing. None at rest.
    pub fn take(
        &mut self,
        model: &Model,
        robot: &Description,
        (observation, further): (&Observation, &Further),
        turn: Option<Turn>,
        suspects: Suspects,
    ) -> Option<Residuals> {
        if let Some((last, before)) = self.last.replace((*observation, *further)) {
            self.measure_noise(model, (&last, &before), (observation, further), suspects);
        }
        if !observation.moving {
            self.turn_before = None;
            return None;
        }
        // What all currents have in common is known only if none is suspected.
        let learns = !suspects.has_current();
        let learns_bias = !suspects.has(Slot::YAW_RATE);
        Some(Residuals {
            currents: self.currents(model, robot, observation, further, learns),
            yaw_rate: self.yaw_rate(model, observation, &further.yaw_rate, turn, learns_bias),
        })
    }

    fn currents(
        &mut self,
        model: &Model,
        robot: &Description,
        observation: &Observation,
        further: &Further,
        learns: bool,
    ) -> [Option<Residual>; WHEELS] {
        let (mut all, mut out) = ([None; WHEELS], [None; WHEELS]);
        // While a fault is suspected the context is held: the slope is still there.
        if learns {
            self.context.fade(observation.travel_m);
        }
        let Some(learned) = &self.model.currents else {
            return out;
        };
        let limit = model.command.curvature_max_1_m;
        let drawn = |wheel: usize, curvature: f64, speed: f64| {
            let rolling = rolling_rate(robot, wheel, curvature, speed);
            learned.wheels[wheel].current_a(rolling, curvature.clamp(-limit, limit))
        };
        let [curvature, speed] = observation.command;
        for wheel in 0..self.wheels {
            let read = &further.currents[wheel];
            if read.plain == 0 {
                continue;
            }
            let expected = drawn(wheel, curvature, speed);
            let behind = expected - drawn(wheel, observation.curvature, observation.speed);
            let sd = learned.wheels[wheel].sd_a;
            let noise = self.noise_variance(wheel, model, observation, read, learned.noise_a);
            let beside = CurrentBeside {
                apart_a: read.mean - expected,
                variance: noise + sd * sd + behind * behind,
                sin_steer: steering_angle(robot, wheel, curvature).sin(),
            };
            let (shift, uncertain) = self.context.shift(wheel, beside.sin_steer);
            all[wheel] = Some(beside);
            out[wheel] = Some(Residual {
                apart: beside.apart_a - shift,
                variance: beside.variance + uncertain,
                expected: expected + shift,
                outlier_rate: self.noise[wheel].outlier_rate(),
            });
        }
        // What a fault does is no context of the nominal mode.
        if learns {
            self.context.learn(&all);
        }
        out
    }

    fn yaw_rate(
        &mut self,
        model: &Model,
        observation: &Observation,
        read: &Reading,
        turn: Option<Turn>,
        learns: bool,
    ) -> Option<Residual> {
        let learned = self.model.yaw_rate?;
        let Some(turn) = turn.filter(|_| read.plain > 0) else {
            self.turn_before = None;
            return None;
        };
        // The gyro tells of the end of the interval, the track of its middle.
        let before = self.turn_before.replace(turn.rate_rad_s);
        let changes = turn.rate_rad_s - before.unwrap_or(turn.rate_rad_s);
        let noise = self.noise_variance(GYRO, model, observation, read, learned.noise_rad_s);
        let variance = noise + turn.variance + changes * changes;
        let apart = read.mean - turn.rate_rad_s;
        let residual = Residual {
            apart: apart - self.bias.mean,
            variance: variance + self.bias.variance,
            expected: turn.rate_rad_s + self.bias.mean,
            outlier_rate: self.noise[GYRO].outlier_rate(),
        };
        if let Some(drift) = self.bias_drift.as_ref().filter(|_| learns) {
            self.bias.fade(observation.travel_m, drift);
            self.bias.learn(apart, 1.0, variance, drift);
        }
        Some(residual)
    }

    /// Variance of the mean of a channel's samples of this learned deviation.
    fn noise_variance(
        &self,
        at: usize,
        model: &Model,
        now: &Observation,
        read: &Reading,
        learned_sd: f64,
    ) -> f64 {
        let sample = model.sample_variance(learned_sd, now.frame_s);
        now.mean_variance(sample * self.noise[at].variance_ratio(), read.plain)
    }

    /// First differences in steady driving: neither a curve nor a fault that persists shows.
    fn measure_noise(
        &mut self,
        model: &Model,
        (last, before): (&Observation, &Further),
        (now, further): (&Observation, &Further),
        suspects: Suspects,
    ) {
        let change = |axis: usize| (now.command[axis] - last.command[axis]).abs();
        let is_same = change(0) < STEADY_COMMAND && change(1) < STEADY_COMMAND;
        if !(now.is_steady() && last.is_steady() && is_same) {
            return;
        }
        let current = self.model.currents.as_ref().map_or(0.0, |all| all.noise_a);
        let gyro = self.model.yaw_rate.map_or(0.0, |gyro| gyro.noise_rad_s);
        for at in (0..self.wheels).chain([GYRO]) {
            let (channel, sd, readings) = match at {
                GYRO => (Slot::YAW_RATE, gyro, [&before.yaw_rate, &further.yaw_rate]),
                wheel => {
                    let readings = [&before.currents[wheel], &further.currents[wheel]];
                    (Slot::current(wheel), current, readings)
                }
            };
            if sd > 0.0 {
                self.noise[at].push_step(model, now, sd, readings, 0.0, suspects.has(channel));
            }
        }
    }
}
