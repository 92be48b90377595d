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

use vigil_blocks::{ActionOutcome, COMMANDS, Rejection, SensorFrame, Valid, WHEELS};

use crate::description::Description;

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
    command_max: [f64; COMMANDS],
    speed_max_m_s: f64,
    yaw_rate_max_rad_s: f64,
    wheel_rate_max_rad_s: f64,
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
        let limits = &robot.limits;
        Self {
            command_max,
            speed_max_m_s: BEYOND_LIMITS * limits.speed_m_s,
            yaw_rate_max_rad_s: BEYOND_LIMITS * limits.yaw_rate_rad_s,
            wheel_rate_max_rad_s: BEYOND_LIMITS * limits.wheel_rate_rad_s,
            last: None,
            captured: None,
        }
    }

    /// Checks a frame. Every number must be finite, marked valid or not; what is marked valid must
    /// be within bounds.
    ///
    /// # Errors
    /// [`Rejection::NotFinite`], [`Rejection::OutOfRange`], [`Rejection::Clock`] or
    /// [`Rejection::Jump`].
    pub fn check(&mut self, frame: &SensorFrame) -> Result<(), Rejection> {
        if !is_finite(frame) {
            return Err(Rejection::NotFinite);
        }
        if !self.is_in_range(frame) {
            return Err(Rejection::OutOfRange);
        }
        if !self.follows(frame) {
            return Err(Rejection::Clock);
        }
        if !frame.has(Valid::POSE) {
            return Ok(());
        }
        let position = Position {
            run: RunKey::new(frame),
            pose_reset_count: frame.pose_reset_count,
            t_ns: frame.header.t_capture_ns,
            x_m: frame.pose[0],
            y_m: frame.pose[1],
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
        let within = |valid: u64, value: f64, max: f64| !frame.has(valid) || value.abs() <= max;
        let pose = |valid: u64, [x, y, yaw]: [f64; 3]| {
            within(valid, x, POSITION_MAX_M)
                && within(valid, y, POSITION_MAX_M)
                && within(valid, yaw, YAW_MAX_RAD)
        };
        let wheel = |i: usize| {
            within(
                Valid::wheel_rate(i),
                frame.wheel_rate[i],
                self.wheel_rate_max_rad_s,
            ) && within(Valid::steer(i), frame.steer[i], STEER_MAX_RAD)
                && within(Valid::current(i), frame.current[i], CURRENT_MAX_A)
        };
        let command = |i: usize| within(Valid::command(i), frame.command[i], self.command_max[i]);
        (0..COMMANDS).all(command)
            && (0..WHEELS).all(wheel)
            && pose(Valid::POSE, frame.pose)
            && pose(Valid::PLANNED_POSE, frame.planned_pose)
            && within(Valid::YAW_RATE, frame.yaw_rate, self.yaw_rate_max_rad_s)
            && ActionOutcome::from_repr(frame.action_outcome).is_some()
            && frame.safe_stop <= 1
    }
}

fn is_finite(frame: &SensorFrame) -> bool {
    let groups: [&[f64]; 8] = [
        &frame.command,
        &frame.pose,
        &frame.planned_pose,
        &[frame.yaw_rate],
        &frame.wheel_rate,
        &frame.steer,
        &frame.current,
        &frame.reserved,
    ];
    groups
        .iter()
        .all(|group| group.iter().all(|v| v.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "the frame guard passes only positions that are finite")]
    fn a_position_that_passed_without_the_check_would_end_the_process() {
        let guard = FrameGuard {
            command_max: [0.0; COMMANDS],
            speed_max_m_s: 1.0,
            yaw_rate_max_rad_s: 1.0,
            wheel_rate_max_rad_s: 1.0,
            last: None,
            captured: None,
        };
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
