//! Frames averaged into observations, for robots of any kind.

use vigil_blocks::{CHANNELS, SensorFrame};
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_inference::angle::wrap;

use super::component::{Quantity, Target, targets};
use super::orders::{OrderTracker, WheelOrders};
use super::{AXES, CHANNELS_MAX};
use crate::channel_map::ChannelMap;
use crate::description::Description;
use crate::frame_guard::BEYOND_LIMITS;
use crate::learned::FrameOutcome;
use crate::learned::observer::STALE_MAX;

/// Observations that a prediction may look back, the newest included.
pub const DEPTH: usize = 9;
/// A pause between frames longer than this breaks the record, s, unless an observation is longer.
const GAP_S: f64 = 0.5;
/// A frame that comes this part of a period early still completes an observation. Half: it ends at
/// the frame that is nearest to the learned interval.
const NEARLY: f64 = 0.5;
/// A pose with a coordinate, m, or a yaw, rad, of this or more is none: the observer's bound of a
/// position. The frame guard bounds frames from outside more closely, at 1e6 m.
const POSE_MAX: f64 = 1e7;
/// Change of a command's axis, relative to its limit, after which the robot has to settle anew. A
/// tenth is beyond the jitter of a planner's command.
const CHANGE: f64 = 0.1;

/// Time constants with which commands are smoothed, s: what is slower than the observations that a
/// prediction looks back on.
pub const SMOOTHING_S: [f64; 2] = [0.5, 2.0];

/// What was measured over one interval.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Observation {
    /// Capture time of its last frame, ns.
    pub t_ns: u64,
    /// Its length, s.
    pub dt_s: f64,
    /// Mean command, in the units of the robot's description.
    pub command: [f64; AXES],
    /// The same, smoothed with each of [`SMOOTHING_S`]; a record begins as if its first command had
    /// stood for long.
    pub smoothed: [[f64; AXES]; SMOOTHING_S.len()],
    /// What each channel measured, in the order of [`targets`]; none if it did not.
    pub values: [Option<f64>; CHANNELS_MAX],
    /// True if the robot is told to move, or its wheels turn.
    pub moving: bool,
    /// How long it has been moving, s.
    pub moving_s: f64,
    /// How long the command has hardly changed, s.
    pub steady_s: f64,
}

impl Default for Observation {
    fn default() -> Self {
        Self {
            t_ns: 0,
            dt_s: 0.0,
            command: [0.0; AXES],
            smoothed: [[0.0; AXES]; SMOOTHING_S.len()],
            values: [None; CHANNELS_MAX],
            moving: false,
            moving_s: 0.0,
            steady_s: 0.0,
        }
    }
}

/// The last few observations of one unbroken record.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct History {
    last: [Observation; DEPTH],
    count: usize,
}

impl History {
    /// The observation so many before the newest; none before the record began.
    #[must_use]
    pub fn ago(&self, lag: usize) -> Option<&Observation> {
        if lag < self.count {
            self.last.get(lag)
        } else {
            None
        }
    }

    /// The command so many observations before the newest; before the record began the first one.
    #[must_use]
    pub fn command(&self, lag: usize) -> &[f64; AXES] {
        &self.last[lag.min(self.count.max(1) - 1)].command
    }

    /// Adds the newest.
    pub fn push(&mut self, observation: Observation) {
        self.last.rotate_right(1);
        self.last[0] = observation;
        self.count = (self.count + 1).min(DEPTH);
    }

    /// Begins a new record.
    pub fn clear(&mut self) {
        self.count = 0;
    }
}

/// The commands smoothed up to now, with each of [`SMOOTHING_S`]: those of the last observation and
/// this one's command.
#[must_use]
pub fn smoothed(last: Option<&Observation>, now: &Observation) -> [[f64; AXES]; SMOOTHING_S.len()] {
    let Some(last) = last else {
        return [now.command; SMOOTHING_S.len()];
    };
    std::array::from_fn(|i| {
        let part = 1.0 - (-now.dt_s / SMOOTHING_S[i]).exp();
        let before = &last.smoothed[i];
        std::array::from_fn(|axis| before[axis] + part * (now.command[axis] - before[axis]))
    })
}

/// Sum of the readings of one channel; of an angle each is taken next to the first.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
struct Mean {
    first: f64,
    sum: f64,
    count: u32,
}

impl Mean {
    fn push(&mut self, value: f64, period: Option<f64>) {
        if self.count == 0 {
            self.first = value;
        }
        self.sum += self.first + within(value - self.first, period);
        self.count += 1;
    }

    fn take(&mut self, period: Option<f64>) -> Option<f64> {
        let count = std::mem::take(&mut self.count);
        let sum = std::mem::take(&mut self.sum);
        (count > 0).then(|| within(sum / f64::from(count), period))
    }
}

/// A value, if it is an angle within half a period of 0.
fn within(value: f64, period: Option<f64>) -> f64 {
    period.map_or(value, |period| value - period * (value / period).round())
}

/// The wheels with whose turns a declared fault comes back: place of the rate, and wheel.
fn turning(robot: &Description, targets: &[Target]) -> Vec<(usize, usize)> {
    let named = robot.fault.iter().filter_map(|fault| fault.wheel.as_ref());
    let named: Vec<usize> = named.filter_map(|name| robot.wheel_index(name)).collect();
    let rates = targets.iter().enumerate();
    let rates = rates.filter(|(_, target)| target.quantity == Quantity::WheelRate);
    let wheels = rates.filter_map(|(place, target)| Some((place, target.wheel?)));
    wheels.filter(|(_, wheel)| named.contains(wheel)).collect()
}

/// Builds observations from frames.
#[derive(Debug, Clone, Checkpoint)]
pub struct Observer {
    #[checkpoint(fixed)]
    robot: Description,
    #[checkpoint(fixed)]
    map: ChannelMap,
    #[checkpoint(fixed)]
    targets: Vec<Target>,
    history: History,
    started: bool,
    run_id: u64,
    t_ns: u64,
    /// Time since the run began, s.
    run_s: f64,
    reset_count: u32,
    elapsed_s: f64,
    command: [Mean; AXES],
    means: [Mean; CHANNELS_MAX],
    /// The readings of the last frame.
    readings: [Option<f64>; CHANNELS_MAX],
    /// The wheels with whose turns a declared fault comes back, and what was found of them.
    orders: OrderTracker,
    pose: Option<[f64; 3]>,
    pose_before: Option<[f64; 3]>,
    /// Frames in a row that were not newer than the last one taken.
    stale: u32,
}

impl Observer {
    /// An observer of a robot.
    #[must_use]
    pub fn new(robot: &Description) -> Self {
        let targets = targets(robot);
        Self {
            map: ChannelMap::new(robot),
            orders: OrderTracker::new(&turning(robot, &targets), targets.len()),
            targets,
            robot: robot.clone(),
            history: History::default(),
            started: false,
            run_id: 0,
            t_ns: 0,
            run_s: 0.0,
            reset_count: 0,
            elapsed_s: 0.0,
            command: [Mean::default(); AXES],
            means: [Mean::default(); CHANNELS_MAX],
            readings: [None; CHANNELS_MAX],
            pose: None,
            pose_before: None,
            stale: 0,
        }
    }

    /// The last observations.
    #[must_use]
    pub const fn history(&self) -> &History {
        &self.history
    }

    /// What the last turns show of each wheel with which a declared fault comes back, at the end of
    /// the newest observation: with each of [`MEMORIES_TURNS`](super::orders::MEMORIES_TURNS).
    #[must_use]
    pub fn orders(&self) -> &[WheelOrders] {
        self.orders.found()
    }

    /// Forgets everything: the next frame begins a new run.
    pub fn reset(&mut self) {
        self.started = false;
    }

    /// Takes a frame.
    pub fn push(&mut self, frame: &SensorFrame) -> FrameOutcome {
        let new_run = !self.started || frame.run_id != self.run_id;
        let t_ns = frame.header.t_capture_ns;
        let is_stale = !new_run && t_ns <= self.t_ns;
        self.stale = if is_stale { self.stale + 1 } else { 0 };
        if is_stale && self.stale < STALE_MAX {
            return FrameOutcome {
                invalid: true,
                ..FrameOutcome::default()
            };
        }
        let dt_s = if new_run {
            0.0
        } else {
            t_ns.saturating_sub(self.t_ns) as f64 * 1e-9
        };
        self.run_s = if new_run { 0.0 } else { self.run_s + dt_s };
        // What is measured before sensors have settled is as good as lost.
        let is_cold = self.run_s < self.robot.warm_up_s;
        let lost = is_stale || dt_s > GAP_S.max(2.0 * self.robot.interval_s);
        let broken = new_run || is_cold || lost;
        self.stale = 0;
        if broken {
            self.history.clear();
            self.clear();
            self.orders.clear();
        }
        if broken || frame.pose_reset_count != self.reset_count {
            (self.pose, self.pose_before) = (None, None);
        }
        self.reset_count = frame.pose_reset_count;
        (self.started, self.run_id, self.t_ns) = (true, frame.run_id, t_ns);
        let invalid = self.collect(frame);
        if broken {
            // The first frame only says where the first observation begins.
            self.clear();
            self.pose_before = self.pose;
            return FrameOutcome {
                complete: false,
                invalid,
                new_run,
            };
        }
        self.elapsed_s += dt_s;
        self.orders.take(dt_s, &self.readings);
        let complete = self.elapsed_s + NEARLY * dt_s >= self.robot.interval_s;
        if complete {
            self.complete();
        }
        FrameOutcome {
            complete,
            invalid,
            new_run,
        }
    }

    fn clear(&mut self) {
        self.elapsed_s = 0.0;
        self.command = [Mean::default(); AXES];
        self.means = [Mean::default(); CHANNELS_MAX];
    }

    /// Adds a frame's readings; true if one was refused.
    fn collect(&mut self, frame: &SensorFrame) -> bool {
        let mut invalid = false;
        let mut push = |mean: &mut Mean, value: Option<f64>, (largest, period)| {
            let sane = value.filter(|value| value.abs() <= largest);
            invalid |= value.is_some() && sane.is_none();
            sane.inspect(|&value| mean.push(value, period))
        };
        for (i, axis) in self.robot.command.iter().enumerate().take(AXES) {
            let largest = BEYOND_LIMITS * axis.limit;
            push(&mut self.command[i], frame.commanded(i), (largest, None));
        }
        self.readings = [None; CHANNELS_MAX];
        let slots = self.means.iter_mut().zip(&mut self.readings);
        for (target, (mean, reading)) in self.targets.iter().zip(slots) {
            if target.place < CHANNELS {
                let value = frame.measured(target.place);
                let sane = push(mean, value, (target.largest, target.period));
                *reading = sane.filter(|_| target.period.is_none());
            }
        }
        if let Some(pose) = self.map.pose(frame) {
            let sane = pose.iter().all(|value| value.abs() < POSE_MAX);
            self.pose = sane.then_some(pose);
            invalid |= !sane;
        }
        invalid
    }

    fn complete(&mut self) {
        let last = self.history.ago(0).copied();
        let mut now = Observation {
            t_ns: self.t_ns,
            dt_s: std::mem::take(&mut self.elapsed_s),
            ..Observation::default()
        };
        for (i, mean) in self.command.iter_mut().enumerate() {
            let before = last.map_or(0.0, |last| last.command[i]);
            now.command[i] = mean.take(None).unwrap_or(before);
        }
        now.smoothed = smoothed(last.as_ref(), &now);
        let moved = self.moved();
        let mut rolls = false;
        let standing_m_s = self.robot.body.standing_m_s;
        for (i, target) in self.targets.iter().enumerate() {
            now.values[i] = match target.quantity {
                Quantity::Forward => moved.map(|moved| moved[0] / now.dt_s),
                Quantity::Lateral => moved.map(|moved| moved[1] / now.dt_s),
                Quantity::Turn => moved.map(|moved| moved[2] / now.dt_s),
                _ => self.means[i].take(target.period),
            };
            let rate = now.values[i].filter(|_| target.quantity == Quantity::WheelRate);
            rolls |= rate.is_some_and(|rate| rate.abs() * self.robot.wheel_radius_m > standing_m_s);
        }
        now.moving = self.robot.is_told_to_move(&now.command) || rolls;
        self.pose_before = self.pose.take();
        let changed = last.is_none_or(|last| {
            let axes = self.robot.command.iter().enumerate().take(AXES);
            let mut apart = axes.map(|(i, a)| (now.command[i] - last.command[i]).abs() / a.limit);
            apart.any(|apart| apart > CHANGE)
        });
        if let Some(last) = last.filter(|_| now.moving) {
            now.moving_s = last.moving_s + now.dt_s;
            now.steady_s = last.steady_s + now.dt_s;
        }
        if changed {
            now.steady_s = 0.0;
        }
        self.history.push(now);
        self.orders.sum_up();
    }

    /// Displacement along and across (left) the mean heading, m, and turn, rad.
    fn moved(&self) -> Option<[f64; 3]> {
        let (from, to) = (self.pose_before?, self.pose?);
        let turn = wrap(to[2] - from[2]);
        let (sin, cos) = (from[2] + 0.5 * turn).sin_cos();
        let (x, y) = (to[0] - from[0], to[1] - from[1]);
        Some([x * cos + y * sin, y * cos - x * sin, turn])
    }
}
