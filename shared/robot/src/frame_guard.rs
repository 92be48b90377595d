//! The content check of frames from outside: what no robot, healthy or broken, can report.
//!
//! The bounds are wide, because a broken sensor must reach the filters however strange its values
//! are. The guard rejects what only a wrong publisher sends: steering angles beyond half a turn
//! (degrees), positions beyond the horizon, memory that was never written, a capture time that was
//! never set. [`crate::publisher_check`] finds degrees that are small enough to be radians.
//!
//! Of all changes between two frames only the position's has a bound: what the robot can drive.
//! Rates, angles and currents step when a sensor or a wheel breaks, and the filters need that step.

use std::f64::consts::PI;

use vigil_blocks::{ActionOutcome, CHANNELS, COMMANDS, Rejection, SensorFrame};

use crate::channel::{Channel, Role, channels};
use crate::channel_map::ChannelMap;
use crate::description::{Description, Limits};

/// Largest coordinate of a pose, m. Chosen: a thousand kilometres, beyond the map of any robot.
pub const POSITION_MAX_M: f64 = 1e6;
/// Largest yaw, rad: a publisher need not wrap it. Chosen: 159 turns
/// in one direction; degrees reach it in three.
pub const YAW_MAX_RAD: f64 = 1e3;
/// Largest steering angle, rad: more than half a turn is none.
pub const STEER_MAX_RAD: f64 = PI;
/// Largest motor current, A. Chosen: beyond any robot's motor; milliamperes of 10 A reach it.
pub const CURRENT_MAX_A: f64 = 1e4;
/// Commands, wheel rates and yaw rates may exceed the robot's limits by this factor. Chosen below
/// the factors of wrong units (57, 60, 1000), and so large that a broken sensor reaches the
/// filters.
pub const BEYOND_LIMITS: f64 = 10.0;
/// Largest magnitude of a command on an axis that the robot's description does not name. Chosen:
/// finite, and beyond any unit.
pub const COMMAND_MAX: f64 = 1e6;
/// Largest jump of a pose between two frames, m, beyond what the robot can drive. Chosen: a robot
/// that loses its way in a building jumps less, and the filters must see that jump.
pub const JUMP_MAX_M: f64 = 100.0;
/// Longest time between the captures of two frames of a run, ns. Chosen, an hour: beyond it the
/// clock was set.
pub const PAUSE_MAX_NS: u64 = 3_600_000_000_000;

/// Checks the frames of one robot.
#[derive(Debug, Clone)]
pub struct FrameGuard {
    map: ChannelMap,
    command_max: [f64; COMMANDS],
    /// By channel; beyond the robot's channels infinite.
    channel_max: [f64; CHANNELS],
    speed_max_m_s: f64,
    /// The last frame with a pose.
    last: Option<Position>,
    captured: Option<Capture>,
}

/// The run to which a frame belongs, of one start of its writer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct RunKey {
    epoch: u64,
    run_id: u64,
}

/// When the last frame was captured.
#[derive(Debug, Clone, Copy)]
struct Capture {
    run: RunKey,
    t_ns: u64,
}

/// Where a frame with a pose was.
#[derive(Debug, Clone, Copy)]
struct Position {
    run: RunKey,
    pose_reset_count: u32,
    t_ns: u64,
    x_m: f64,
    y_m: f64,
}

impl RunKey {
    const fn new(frame: &SensorFrame) -> Self {
        Self {
            epoch: frame.header.epoch,
            run_id: frame.run_id,
        }
    }
}

impl FrameGuard {
    /// A guard for frames of `robot`.
    #[must_use]
    pub fn new(robot: &Description) -> Self {
        let mut command_max = [COMMAND_MAX; COMMANDS];
        for (max, axis) in command_max.iter_mut().zip(&robot.command) {
            *max = BEYOND_LIMITS * axis.limit;
        }
        let mut channel_max = [f64::INFINITY; CHANNELS];
        for (max, channel) in channel_max.iter_mut().zip(channels(robot)) {
            *max = largest(&channel, &robot.limits);
        }
        Self {
            map: ChannelMap::new(robot),
            command_max,
            channel_max,
            speed_max_m_s: BEYOND_LIMITS * robot.limits.speed_m_s,
            last: None,
            captured: None,
        }
    }

    /// Checks a frame. Every number must be finite, marked valid or not; what is marked valid must
    /// be within bounds.
    ///
    /// # Errors
    /// [`Rejection::Robot`], [`Rejection::NotFinite`], [`Rejection::OutOfRange`],
    /// [`Rejection::Clock`] or [`Rejection::Jump`].
    pub fn check(&mut self, frame: &SensorFrame) -> Result<(), Rejection> {
        if frame.robot_hash != self.map.hash() {
            return Err(Rejection::Robot);
        }
        if !is_finite(frame) {
            return Err(Rejection::NotFinite);
        }
        if !self.is_in_range(frame) {
            return Err(Rejection::OutOfRange);
        }
        if !self.follows(frame) {
            return Err(Rejection::Clock);
        }
        let Some([x_m, y_m, _]) = self.map.pose(frame) else {
            return Ok(());
        };
        let position = Position {
            run: RunKey::new(frame),
            pose_reset_count: frame.pose_reset_count,
            t_ns: frame.header.t_capture_ns,
            x_m,
            y_m,
        };
        let has_jumped = self.last.is_some_and(|last| self.jumps(&last, &position));
        // The next frame is measured by this one, so that one jump is one rejection.
        self.last = Some(position);
        if has_jumped {
            return Err(Rejection::Jump);
        }
        Ok(())
    }

    /// True if a frame was captured after the one before it in its run, within [`PAUSE_MAX_NS`].
    fn follows(&mut self, frame: &SensorFrame) -> bool {
        let t_ns = frame.header.t_capture_ns;
        let run = RunKey::new(frame);
        // The next frame is measured by this one, so that a clock that was set is one rejection.
        let last = self.captured.replace(Capture { run, t_ns });
        last.is_none_or(|last| {
            last.run != run || (last.t_ns < t_ns && t_ns - last.t_ns <= PAUSE_MAX_NS)
        })
    }

    fn jumps(&self, last: &Position, position: &Position) -> bool {
        let dt_s = position.t_ns.saturating_sub(last.t_ns) as f64 * 1e-9;
        let way_m = (position.x_m - last.x_m).hypot(position.y_m - last.y_m);
        // The pair of `is_finite` and `is_in_range`: what passed them has a distance.
        assert!(
            way_m <= 4.0 * POSITION_MAX_M,
            "the frame guard passes only positions that are finite and within bounds"
        );
        position.run == last.run
            && position.pose_reset_count == last.pose_reset_count
            && way_m > JUMP_MAX_M + self.speed_max_m_s * dt_s
    }

    fn is_in_range(&self, frame: &SensorFrame) -> bool {
        let within = |value: Option<f64>, max: f64| value.is_none_or(|value| value.abs() <= max);
        let planned = frame
            .planned()
            .map(|[x, y, yaw]| x.abs().max(y.abs()) <= POSITION_MAX_M && yaw.abs() <= YAW_MAX_RAD);
        (0..COMMANDS).all(|i| within(frame.commanded(i), self.command_max[i]))
            && (0..CHANNELS).all(|i| within(frame.measured(i), self.channel_max[i]))
            && planned.unwrap_or(true)
            && ActionOutcome::from_repr(frame.action_outcome).is_some()
            && frame.safe_stop <= 1
            && frame.planned_pose_valid <= 1
            && frame.channel_valid & !self.map.channel_bits() == 0
    }
}

/// Largest magnitude of a channel that a robot of these limits may report.
fn largest(channel: &Channel, limits: &Limits) -> f64 {
    if let Some(limit) = channel.limit {
        return BEYOND_LIMITS * limit;
    }
    match channel.role {
        Role::PoseX | Role::PoseY => POSITION_MAX_M,
        Role::PoseYaw => YAW_MAX_RAD,
        Role::BodyRate => BEYOND_LIMITS * limits.yaw_rate_rad_s,
        Role::WheelRate => BEYOND_LIMITS * limits.wheel_rate_rad_s,
        Role::SteeringAngle => STEER_MAX_RAD,
        Role::Current => CURRENT_MAX_A,
        _ => f64::MAX,
    }
}

fn is_finite(frame: &SensorFrame) -> bool {
    let mut values = frame.command.iter().chain(&frame.channel);
    values.all(|value| value.is_finite()) && frame.planned_pose.iter().all(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "the frame guard passes only positions that are finite")]
    fn a_position_that_passed_without_the_check_would_end_the_process() {
        let text = include_str!("../../../config/robots/rover.toml");
        let robot: Description = toml::from_str(text).unwrap_or_else(|error| panic!("{error}"));
        let guard = FrameGuard::new(&robot);
        let position = Position {
            run: RunKey::new(&SensorFrame::default()),
            pose_reset_count: 0,
            t_ns: 0,
            x_m: f64::NAN,
            y_m: 0.0,
        };
        guard.jumps(&position, &position);
    }
}
