//! What no frame of a robot can say: the content check of frames from outside.
//!
//! The bounds are wide. What a broken sensor or a broken robot may say is for the filters to judge,
//! however strange; this refuses what only a wrong publisher says: steering angles beyond half a
//! turn, as most are in degrees, positions beyond the horizon, memory that was never written, a
//! capture time that was never set. (Degrees that are small enough to be radians are found by
//! `vigil check-publisher`, which knows how the robot turns.) Of changes from one frame to the next
//! only the position's has a bound, what the robot can drive: rates, angles and currents step at
//! once when a sensor or a wheel breaks, and those steps are what the filters live on.

use std::f64::consts::PI;

use vigil_blocks::{ActionOutcome, COMMANDS, Rejection, SensorFrame, Valid, WHEELS};

use crate::description::Description;

/// Largest coordinate of a pose, m.
pub const POSITION_MAX_M: f64 = 1e6;
/// Largest yaw, rad: a publisher need not wrap it.
pub const YAW_MAX_RAD: f64 = 1e3;
/// Largest steering angle, rad: more than half a turn is none.
pub const STEER_MAX_RAD: f64 = PI;
/// Largest motor current, A.
pub const CURRENT_MAX_A: f64 = 1e4;
/// Commands, wheel rates and yaw rates may exceed the robot's limits by this factor: a broken
/// sensor must get through to the filters, a wrong unit (57, 60, 1000) must not.
pub const BEYOND_LIMITS: f64 = 10.0;
/// Largest magnitude of a command on an axis that the robot's description does not know.
pub const COMMAND_MAX: f64 = 1e6;
/// A pose may be off by this much between two frames, m, besides what the robot can drive: a robot
/// that loses its way may jump, and that is for the filters to see.
pub const JUMP_MAX_M: f64 = 100.0;
/// Longest time between the captures of two frames of a run, ns: an hour. Beyond it a clock was
/// set.
pub const PAUSE_MAX_NS: u64 = 3_600_000_000_000;

/// Checks the frames of one robot.
#[derive(Debug, Clone)]
pub struct FrameGuard {
    command_max: [f64; COMMANDS],
    speed_max_m_s: f64,
    yaw_rate_max_rad_s: f64,
    wheel_rate_max_rad_s: f64,
    last: Option<Place>,
    /// Run of the last frame, and when that was captured, ns.
    captured: Option<((u64, u64), u64)>,
}

/// Where the last frame with a pose was.
#[derive(Debug, Clone, Copy)]
struct Place {
    track: (u64, u64, u32),
    t_ns: u64,
    x: f64,
    y: f64,
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

    /// Judges a frame. Every number of it must be finite, marked valid or not; what is marked valid
    /// must be within bounds.
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
        let place = Place {
            track: (frame.header.epoch, frame.run_id, frame.pose_reset_count),
            t_ns: frame.header.t_capture_ns,
            x: frame.pose[0],
            y: frame.pose[1],
        };
        let has_jumped = self.last.is_some_and(|last| self.jumps(&last, &place));
        // The next is measured by this one: one jump is one refusal.
        self.last = Some(place);
        if has_jumped {
            return Err(Rejection::Jump);
        }
        Ok(())
    }

    /// True if a frame was captured after the one before it of its run, and not ages after.
    fn follows(&mut self, frame: &SensorFrame) -> bool {
        let t_ns = frame.header.t_capture_ns;
        let run = (frame.header.epoch, frame.run_id);
        // The next is measured by this one: a clock that was set is one refusal.
        let last = self.captured.replace((run, t_ns));
        last.is_none_or(|(of, last_ns)| {
            of != run || (last_ns < t_ns && t_ns - last_ns <= PAUSE_MAX_NS)
        })
    }

    fn jumps(&self, last: &Place, place: &Place) -> bool {
        let dt_s = place.t_ns.saturating_sub(last.t_ns) as f64 * 1e-9;
        let way_m = (place.x - last.x).hypot(place.y - last.y);
        place.track == last.track && way_m > JUMP_MAX_M + self.speed_max_m_s * dt_s
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
            && ActionOutcome::from_wire(frame.action_outcome).is_some()
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
