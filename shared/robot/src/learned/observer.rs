//! Frames averaged into observations of about the learned interval.
//!
//! The filters step once per observation, not once per frame. Averaging n samples of white noise
//! keeps their information (the mean's variance is the sample's over n), so residuals, ages and
//! thresholds mean the same at 20 Hz, 100 Hz and 1 kHz; between observations a belief is its own
//! prediction. Exact repeats of an encoder are counted frame by frame, before averaging.

use vigil_blocks::{SensorFrame, WHEELS};
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_inference::angle::wrap;

use super::further::{Collector, Further};
use super::troubles::{PlausibilityCheck, RestLimits, Troubles};
use super::{BodyLag, Model, Observation, Reading};
use crate::channel_map::ChannelMap;
use crate::description::Description;
use crate::period::FramePeriod;

/// A gap in the frames beyond which the pose starts anew, s: chosen, twenty observations.
const GAP_S: f64 = 1.0;
/// Period assumed of a run's first frame, s: as noisy as at the highest rate.
const FRAME_UNKNOWN_S: f64 = 1e-3;
/// Positions beyond this are no measurement, m. Chosen: ten times the frame guard's bound, for
/// frames that have not passed it.
const POSITION_MAX_M: f64 = 1e7;
/// So many frames in a row that are not newer than the last one taken mean that the clock was set
/// back: the next is taken, as after a gap.
pub(crate) const STALE_MAX: u32 = 10;
/// Part of a frame that may lack to an interval, below half a one: frames are not quite periodic.
const NEARLY: f64 = 0.4;
/// Part of the speed at which a robot counts as standing that is no command to creep: chosen.
const STANDS: f64 = 0.1;

/// Effect of a frame on the observations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameOutcome {
    /// The frame completed an observation.
    pub complete: bool,
    /// The frame, or one of its channels, was refused: not finite, out of range, out of order.
    pub invalid: bool,
    /// The frame begins a new run: forget everything before.
    pub new_run: bool,
}

/// Builds observations from frames.
#[derive(Debug, Clone, Checkpoint)]
pub struct Observer {
    #[checkpoint(fixed)]
    map: ChannelMap,
    wheel_count: usize,
    wheel_rate_max: f64,
    curvature_max: f64,
    speed_max: f64,
    interval_s: f64,
    standing_m_s: f64,
    #[checkpoint(fixed)]
    limits: RestLimits,
    #[checkpoint(fixed)]
    model: Box<Model>,
    is_suspected: bool,
    state: State,
    observation: Observation,
    /// Gyro and currents, where they are asked for.
    further: Option<Box<Collector>>,
}

/// What carries over from frame to frame.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
struct State {
    run_id: u64,
    t_ns: u64,
    /// Middle of the last observation's frames.
    middle_ns: u64,
    started: bool,
    command: [f64; 2],
    body: BodyLag,
    period: FramePeriod,
    /// The last observation's pose.
    pose_before: Option<[f64; 3]>,
    reset_count: u32,
    anchor: bool,
    wheels: [Option<f64>; WHEELS],
    steer: [Option<f64>; WHEELS],
    plausibility: PlausibilityCheck,
    /// Frames in a row that were not newer than the last one taken.
    stale: u32,
    sums: Sums,
}

/// Sums over the frames of the observation under way.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
struct Sums {
    frames: u32,
    elapsed_s: f64,
    t_first_ns: u64,
    /// Times of the frames since the first of them, ns.
    after_first_ns: u64,
    command: [f64; 2],
    first_pose: [f64; 3],
    pose: [f64; 3],
    pose_frames: u32,
    wheels: [Reading; WHEELS],
    steer: [Reading; WHEELS],
}

impl Observer {
    /// An observer for a model and its robot.
    #[must_use]
    pub fn new(model: &Model, robot: &Description) -> Self {
        Self {
            map: ChannelMap::new(robot),
            wheel_count: robot.wheels.len().min(WHEELS),
            wheel_rate_max: robot.limits.wheel_rate_rad_s,
            // Generous: a command beyond the limits is the robot's affair, garbage is not.
            curvature_max: 10.0 * robot.limits.curvature_1_m,
            speed_max: 10.0 * robot.limits.speed_m_s,
            interval_s: model.interval_s,
            standing_m_s: model.command.standing_m_s,
            limits: RestLimits::new(model),
            model: Box::new(model.clone()),
            is_suspected: false,
            state: State::default(),
            observation: Observation::default(),
            further: None,
        }
    }

    /// The same, which reads gyro and currents too.
    #[must_use]
    pub fn with_further(mut self) -> Self {
        self.further = Some(Box::default());
        self
    }

    /// What the last completed observation holds of gyro and currents, where these are read.
    #[must_use]
    pub fn further(&self) -> Option<&Further> {
        self.further.as_deref().map(|collector| &collector.found)
    }

    /// The last completed observation.
    #[must_use]
    pub const fn observation(&self) -> &Observation {
        &self.observation
    }

    /// Whether a fault is suspected: what is learned on the way about the healthy robot allows for
    /// what a fault does.
    pub const fn suspect(&mut self, is_suspected: bool) {
        self.is_suspected = is_suspected;
    }

    /// Forgets everything: the next frame begins a new run.
    pub fn reset(&mut self) {
        self.state = State::default();
        self.begin_further();
    }

    fn begin_further(&mut self) {
        if let Some(further) = &mut self.further {
            **further = Collector::default();
        }
    }

    /// Takes a frame.
    pub fn push(&mut self, frame: &SensorFrame) -> FrameOutcome {
        let new_run = !self.state.started || frame.run_id != self.state.run_id;
        let t_ns = frame.header.t_capture_ns;
        let is_stale = !new_run && t_ns <= self.state.t_ns;
        self.state.stale = if is_stale { self.state.stale + 1 } else { 0 };
        let mut invalid = is_stale;
        if is_stale && self.state.stale < STALE_MAX {
            return FrameOutcome {
                invalid,
                ..FrameOutcome::default()
            };
        }
        if new_run {
            self.state = State {
                run_id: frame.run_id,
                started: true,
                ..State::default()
            };
            self.begin_further();
            self.state.reset_count = frame.pose_reset_count;
            self.state.anchor = true;
            let command = &self.model.command;
            self.state.body = BodyLag::new(command.lag_s, command.lag_uncertainty);
        }
        let dt_s = if new_run {
            0.0
        } else {
            t_ns.saturating_sub(self.state.t_ns) as f64 * 1e-9
        };
        if !new_run && !is_stale {
            self.state.period.push(t_ns - self.state.t_ns);
        }
        self.state.t_ns = t_ns;
        self.state.stale = 0;
        let jumped = is_stale || dt_s > GAP_S || frame.pose_reset_count != self.state.reset_count;
        if jumped {
            self.state.reset_count = frame.pose_reset_count;
            self.state.anchor = true;
        }
        if jumped || dt_s > self.interval_s {
            self.drop_frames(jumped);
        }
        invalid |= self.take_command(frame, dt_s.min(GAP_S), new_run);
        if self.state.sums.frames == 0 {
            self.state.sums.t_first_ns = t_ns;
        }
        self.state.sums.frames += 1;
        self.state.sums.after_first_ns += t_ns.saturating_sub(self.state.sums.t_first_ns);
        self.state.sums.elapsed_s += dt_s;
        invalid |= self.take_pose(frame);
        invalid |= self.take_wheels(frame);
        if let Some(further) = &mut self.further {
            invalid |= further.take(frame, &self.map);
        }
        let enough = self.state.sums.elapsed_s + NEARLY * self.period_s() >= self.interval_s;
        let complete = new_run || enough || jumped;
        if complete {
            self.complete();
            if let Some(further) = &mut self.further {
                further.complete();
            }
        }
        FrameOutcome {
            complete,
            invalid,
            new_run,
        }
    }

    /// Drops the frames of the observation under way: those before and after a jump or a gap must
    /// not be averaged, as nobody knows what the robot did in between. Over a gap time goes on.
    fn drop_frames(&mut self, jumped: bool) {
        let elapsed_s = self.state.sums.elapsed_s;
        self.state.sums = self.state.sums.next();
        if !jumped {
            self.state.sums.elapsed_s = elapsed_s;
        }
        self.state.body.drop_frames();
        if let Some(further) = &mut self.further {
            further.drop_frames();
        }
    }

    /// Period of the frames, s.
    fn period_s(&self) -> f64 {
        self.state.period.period_s().unwrap_or(FRAME_UNKNOWN_S)
    }

    fn take_command(&mut self, frame: &SensorFrame, dt_s: f64, new_run: bool) -> bool {
        let [curvature, speed, ..] = frame.command;
        let valid = frame.commanded(0).is_some() && frame.commanded(1).is_some();
        let sane = curvature.abs() <= self.curvature_max && speed.abs() <= self.speed_max;
        let state = &mut self.state;
        if valid && sane {
            state.command = [curvature, speed];
        }
        if new_run {
            state.body.begin(state.command);
        }
        state.body.advance(state.command, dt_s);
        for i in 0..2 {
            state.sums.command[i] += state.command[i];
        }
        !(valid && sane)
    }

    fn take_pose(&mut self, frame: &SensorFrame) -> bool {
        let Some([x, y, yaw]) = self.map.pose(frame) else {
            return false;
        };
        let sane = x.abs() <= POSITION_MAX_M && y.abs() <= POSITION_MAX_M && yaw.abs() <= 1e3;
        if !sane {
            return true;
        }
        let sums = &mut self.state.sums;
        if sums.pose_frames == 0 {
            sums.first_pose = [x, y, yaw];
        }
        sums.pose_frames += 1;
        sums.pose[0] += x - sums.first_pose[0];
        sums.pose[1] += y - sums.first_pose[1];
        sums.pose[2] += wrap(yaw - sums.first_pose[2]);
        false
    }

    fn take_wheels(&mut self, frame: &SensorFrame) -> bool {
        let mut invalid = false;
        let state = &mut self.state;
        for i in 0..self.wheel_count {
            if let Some(rate) = self.map.wheel_rate(frame, i) {
                if rate.abs() <= self.wheel_rate_max {
                    state.sums.wheels[i].push(rate, state.wheels[i].replace(rate));
                } else {
                    invalid = true;
                }
            }
            if let Some(angle) = self.map.steer(frame, i) {
                if angle.abs() <= std::f64::consts::PI {
                    state.sums.steer[i].push(angle, state.steer[i].replace(angle));
                } else {
                    invalid = true;
                }
            }
        }
        invalid
    }

    fn complete(&mut self) {
        let frame_s = self.period_s();
        let state = &mut self.state;
        let sums = state.sums;
        let elapsed = sums.elapsed_s.min(GAP_S);
        let middle_ns = sums.middle_ns();
        let middles_ns = middle_ns.saturating_sub(state.middle_ns);
        state.middle_ns = middle_ns;
        let followed = state.body.complete(elapsed);
        let command = sums.command.map(|sum| sum / f64::from(sums.frames.max(1)));
        // Dividing by a small travel would amplify rounding: a standing robot has its command's.
        let curvature = if followed.travel_m.abs() > 1e-6 {
            followed.turn_rad / followed.travel_m
        } else {
            command[0]
        };
        let speed = followed.speed_m_s;
        self.observation = Observation {
            t_ns: state.t_ns,
            t_first_ns: sums.t_first_ns,
            dt_s: elapsed,
            middles_s: (middles_ns as f64 * 1e-9).min(GAP_S),
            frame_s,
            frames: sums.frames,
            travel_m: followed.travel_m,
            curvature: curvature.clamp(-self.curvature_max, self.curvature_max),
            speed,
            travel_variance: followed.travel_variance,
            turn_variance: followed.turn_variance,
            command,
            moving: command[1].abs() >= self.standing_m_s && speed.abs() >= self.standing_m_s,
            anchor: state.anchor,
            pose_frames: sums.pose_frames,
            pose: sums.mean_pose(),
            wheels: sums.wheels,
            steer: sums.steer,
            troubles: Troubles::default(),
        };
        // A robot that is commanded to creep is not commanded to stand.
        let is_stopped =
            command[1].abs() < STANDS * self.standing_m_s && speed.abs() < self.standing_m_s;
        let (plausibility, observation) = (&mut state.plausibility, &mut self.observation);
        observation.troubles = plausibility.step(observation, is_stopped, &self.limits);
        self.learn_lag();
        let state = &mut self.state;
        // An anchor without a pose is still to come.
        state.anchor = state.anchor && sums.pose_frames == 0;
        state.sums = sums.next();
    }

    /// Compares the measured displacement since the last observation with what each lag predicts.
    fn learn_lag(&mut self) {
        let now = &self.observation;
        let pose = (now.pose_frames > 0).then_some(now.pose);
        let before = std::mem::replace(&mut self.state.pose_before, pose);
        let (Some(before), Some(pose), false) = (before, pose, now.anchor) else {
            self.state.body.interrupt();
            return;
        };
        let motion = &self.model.nominal.motion;
        let limit = self.model.command.curvature_max_1_m;
        let [yaw, forward, _] = motion.per_metre(now.curvature, now.speed, limit);
        let (sin, cos) = before[2].sin_cos();
        let measured = [
            cos * (pose[0] - before[0]) + sin * (pose[1] - before[1]),
            wrap(pose[2] - before[2]),
        ];
        // Two poses, each as noisy as this one.
        let [position, _, heading] = now.pose_variance(&self.model, [1.0; 3]).map(|v| 2.0 * v);
        let beyond = yaw - now.curvature;
        let body = &mut self.state.body;
        let variance = [position, heading];
        body.learn(measured, variance, [forward, beyond], self.is_suspected);
    }
}

impl Sums {
    /// Those of the next observation, empty.
    fn next(&self) -> Self {
        Self {
            wheels: self.wheels.each_ref().map(Reading::next),
            steer: self.steer.each_ref().map(Reading::next),
            ..Self::default()
        }
    }

    /// Mean time of the frames, ns.
    fn middle_ns(&self) -> u64 {
        self.t_first_ns + self.after_first_ns / u64::from(self.frames.max(1))
    }

    /// Mean pose; the first one, which means nothing, without any.
    fn mean_pose(&self) -> [f64; 3] {
        let mut pose = self.first_pose;
        if self.pose_frames > 0 {
            for (value, sum) in pose.iter_mut().zip(self.pose) {
                *value += sum / f64::from(self.pose_frames);
            }
            pose[2] = wrap(pose[2]);
        }
        pose
    }
}
