//! Whether a publisher's frames mean what the robot's description says: units, signs, sides.
//!
//! A healthy robot does roughly what it is commanded. Where it moves a thousand times as far or
//! turns the other way, the fields hold something else than they should. Figures are ratios to the
//! command, summed frame by frame from the first motion on, so that noise and ground leave them
//! near 1; a finding needs a ratio that neither ground nor a fault explains. Each is judged once,
//! as soon as the motion shows it: straight driving shows nothing of turns, and what has not been
//! judged is said ([`PublisherCheck::unjudged`]). Once all is judged a frame costs nothing more.
//!
//! For recordings, where all frames are at hand, `vigil import` judges by
//! `vigil_plausibility`.

mod finding;
mod pose;
mod wheels;

use vigil_blocks::{SensorFrame, Valid};

use crate::description::Description;
pub use finding::{Finding, FindingKind};
use pose::Poses;
use wheels::Wheels;

/// A ratio within this factor of 1 is nothing: ground and faults do as much. The least factor of a
/// unit is that of feet, 3.3.
const RATIO_MAX: f64 = 3.0;
/// Curvature from which turns are judged, 1/m: below it a fault turns a robot as much (up to 0.32
/// rad/m by a stuck wheel of the rover).
const TURNING_1_M: f64 = 0.3;
/// Commanded turn from which they are, rad. Forty deviations of a yaw noise of 5 mrad.
const TURN_MIN_RAD: f64 = 0.2;
/// Ratios of turns: a sign is wrong below, a unit above. A wrong sign reads -1: half-way to none
/// leaves room for ground.
const TURN_REVERSED: f64 = -0.5;
/// Between a right one, 1, and degrees, 57, in the geometric mean.
const TURN_UNIT: f64 = 8.0;
/// A pause in the frames beyond which the motion counts as interrupted, s. Six periods of a sensor
/// of 20 Hz.
const PAUSE_S: f64 = 0.3;
/// A command must have stood so long before a frame counts, s: three lags of [`crate::body::Body`].
const SETTLED_S: f64 = 0.3;
/// Change of the commanded velocity that begins this anew, m/s and rad/s: chosen, a tenth of the
/// rover's fastest.
const CHANGE: f64 = 0.05;
/// Tests there may be: travel, turn, gyro, unit, and by wheel sign, steering, side.
const TESTS: usize = 4 + 3 * vigil_blocks::WHEELS;

/// Bits of all of them.
const ALL: u32 = (1 << TESTS) - 1;

/// Outcome of one test so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TestOutcome {
    /// The motion has not shown it.
    NotYet,
    /// As it should be.
    Fits,
    /// Not so.
    Wrong(Finding),
}

/// The tests of one publisher.
#[derive(Debug, Clone)]
pub struct PublisherCheck {
    robot: Description,
    poses: Poses,
    wheels: Wheels,
    gyro: [f64; 3],
    /// Run and writer of the last frame, its capture time, and the velocity commanded.
    last: Option<((u64, u64, u32), u64)>,
    twist: [f64; 3],
    settled_s: f64,
    /// Since the tests were looked at, s.
    unlooked_s: f64,
    /// Bits of the tests that have ended.
    judged: u32,
    /// Bits of those about what the robot does not have.
    absent: u32,
    /// Bits of those that were wrong when looked at last: twice in a row counts.
    suspected: u32,
    is_blinding: bool,
}

/// Time between looks at the sums, s.
const LOOK_S: f64 = 0.25;
/// Bits of the tests by their place.
const TRAVEL: usize = 0;
const TURN: usize = 1;
const GYRO: usize = 2;
const UNIT: usize = 3;
const SIGN: usize = 4;
const STEER: usize = SIGN + vigil_blocks::WHEELS;
const SIDES: usize = STEER + vigil_blocks::WHEELS;

impl PublisherCheck {
    /// The tests for frames of `robot`.
    #[must_use]
    pub fn new(robot: &Description) -> Self {
        Self {
            robot: robot.clone(),
            poses: Poses::default(),
            wheels: Wheels::new(robot),
            gyro: [0.0; 3],
            last: None,
            twist: [0.0; 3],
            settled_s: 0.0,
            unlooked_s: 0.0,
            judged: 0,
            absent: 0,
            suspected: 0,
            is_blinding: false,
        }
        .without_what_is_not_there()
    }

    /// Tests of what the robot does not have have ended.
    fn without_what_is_not_there(mut self) -> Self {
        let (wheels, pairs) = self.wheels.counts();
        let measured = self.robot.measured;
        for test in 0..TESTS {
            let is_there = match test {
                TRAVEL | TURN => measured.pose,
                GYRO => measured.yaw_rate,
                UNIT => measured.wheel_rates && wheels > 0,
                SIGN..STEER => measured.wheel_rates && test - SIGN < wheels,
                STEER..SIDES => {
                    let wheel = self.robot.wheels.get(test - STEER);
                    measured.steer && wheel.is_some_and(|wheel| wheel.steered && wheels > 0)
                }
                _ => measured.wheel_rates && test - SIDES < pairs,
            };
            self.absent |= u32::from(!is_there) << test;
        }
        self.judged = self.absent;
        self
    }

    /// Begins anew, as with another publisher.
    pub fn reset(&mut self) {
        self.poses = Poses::default();
        self.wheels.reset();
        (self.gyro, self.last) = ([0.0; 3], None);
        (self.settled_s, self.unlooked_s) = (0.0, 0.0);
        (self.judged, self.suspected) = (self.absent, 0);
        self.is_blinding = false;
    }

    /// True if something was found behind which faults go unseen.
    #[must_use]
    pub const fn is_blinding(&self) -> bool {
        self.is_blinding
    }

    /// Takes a frame; what it lets be found, one at a time.
    pub fn take(&mut self, frame: &SensorFrame) -> Option<Finding> {
        if self.judged == ALL {
            return None;
        }
        let run = (frame.header.epoch, frame.run_id, frame.pose_reset_count);
        let t_ns = frame.header.t_capture_ns;
        let last = self.last.replace((run, t_ns));
        let last_ns = last.filter(|(of, _)| *of == run).map(|(_, t_ns)| t_ns);
        let dt_s = last_ns.map_or(0.0, |last_ns| t_ns.saturating_sub(last_ns) as f64 * 1e-9);
        let twist = self.robot.twist(&frame.command);
        let mut axes = 0..self.robot.command.len();
        let is_told = axes.all(|i| frame.has(Valid::command(i)));
        let moves = is_told && self.robot.path_speed_m_s(twist) >= self.robot.body.standing_m_s;
        let is_broken = !moves || !(f64::MIN_POSITIVE..=PAUSE_S).contains(&dt_s);
        let mut changes = self.twist.iter().zip(twist).map(|(a, b)| (a - b).abs());
        let is_changed = changes.any(|change| change > CHANGE);
        if is_broken || is_changed {
            (self.twist, self.settled_s) = (twist, 0.0);
            self.poses.interrupt();
            return None;
        }
        self.settled_s += dt_s;
        if self.settled_s < SETTLED_S {
            return None;
        }
        self.add(frame, twist, dt_s);
        self.unlooked_s += dt_s;
        if self.unlooked_s < LOOK_S {
            return None;
        }
        self.look()
    }

    fn add(&mut self, frame: &SensorFrame, twist: [f64; 3], dt_s: f64) {
        let standing_m_s = self.robot.body.standing_m_s;
        self.poses.take(frame, twist, dt_s, standing_m_s);
        let turns = twist[2].abs() >= TURNING_1_M * twist[0].hypot(twist[1]);
        if turns && frame.has(Valid::YAW_RATE) {
            self.gyro[0] += frame.yaw_rate * twist[2] * dt_s;
            self.gyro[1] += twist[2] * twist[2] * dt_s;
            self.gyro[2] += twist[2].abs() * dt_s;
        }
        self.wheels.take(&self.robot, frame, twist, dt_s);
    }

    /// Looks at every test that has not ended; returns the first that is wrong, and the others at
    /// the next looks.
    fn look(&mut self) -> Option<Finding> {
        let (before, ended) = (self.suspected, self.judged);
        for test in (0..TESTS).filter(|test| ended >> test & 1 == 0) {
            let bit = 1 << test;
            match self.judge(test) {
                TestOutcome::NotYet => self.suspected &= !bit,
                TestOutcome::Fits => {
                    self.suspected &= !bit;
                    self.judged |= bit;
                }
                TestOutcome::Wrong(_) if before & bit == 0 => self.suspected |= bit,
                TestOutcome::Wrong(finding) => {
                    self.judged |= bit;
                    self.is_blinding |= finding.kind.is_blinding();
                    return Some(finding);
                }
            }
        }
        self.unlooked_s = 0.0;
        None
    }

    fn judge(&self, test: usize) -> TestOutcome {
        match test {
            TRAVEL => self.poses.travel(),
            TURN => self.poses.turn(),
            GYRO if self.gyro[2] < TURN_MIN_RAD => TestOutcome::NotYet,
            GYRO => turn(FindingKind::Gyro, self.gyro[0] / self.gyro[1]),
            UNIT => self.wheels.unit(),
            SIGN..STEER => self.wheels.sign(test - SIGN),
            STEER..SIDES => self.wheels.steering(test - STEER),
            _ => self.wheels.sides(test - SIDES),
        }
    }

    /// What no motion has shown yet, in words.
    #[must_use]
    pub fn unjudged(&self) -> Vec<&'static str> {
        let groups = [
            (TRAVEL..TURN, "travel of the pose"),
            (TURN..GYRO, "sign and unit of yaw"),
            (GYRO..UNIT, "sign and unit of yaw_rate"),
            (UNIT..STEER, "unit and signs of the wheel rates"),
            (STEER..SIDES, "signs of the steering angles"),
            (SIDES..TESTS, "sides of the wheels"),
        ];
        let lacks = |test: usize| self.judged >> test & 1 == 0;
        let groups = groups.into_iter();
        let lacking = groups.filter(|(tests, _)| tests.clone().any(lacks));
        lacking.map(|(_, name)| name).collect()
    }
}

/// A ratio of turns.
fn turn(kind: FindingKind, ratio: f64) -> TestOutcome {
    match !(TURN_REVERSED..=TURN_UNIT).contains(&ratio) {
        true => TestOutcome::new(kind, None, ratio),
        false => TestOutcome::Fits,
    }
}
