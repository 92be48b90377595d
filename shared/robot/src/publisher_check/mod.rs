//! Checks that a live publisher's frames agree with the robot's description: units, signs, sides.
//!
//! A healthy robot roughly follows its command. If it moves a thousand times as far or turns the
//! other way, a field holds another unit or sign. Each test sums measured against commanded motion
//! from the first motion on; noise and ground leave the ratio near 1, and a finding needs a ratio
//! that neither ground nor a fault explains. Wheels are told apart by what each should read: the
//! order of the channels that fits best is theirs. A test ends as soon as the motion excites it:
//! straight driving shows nothing of turns. [`PublisherCheck::scope`] names the tests that have not
//! ended. Once all have, a frame costs nothing more.

mod finding;
mod order;
mod pose;
mod regression;
mod scope;
mod wheels;

use vigil_blocks::SensorFrame;
use vigil_checkpoint::{Checkpoint, CheckpointValue};

use crate::channel_map::ChannelMap;
use crate::description::{Description, Kinematics};
use finding::WheelChannel;
pub use finding::{Finding, FindingKind, YAW_RATE_UNITS};
use pose::Poses;
pub use regression::RegressionSums;
pub use scope::Scope;
pub use wheels::expected_rate;
use wheels::{Group, Wheels};

/// Factor about 1 within which a ratio is no finding: ground and faults do as much. The smallest
/// factor of a unit is that of feet, 3.3.
const RATIO_MAX: f64 = 3.0;
/// Curvature from which turns are judged, 1/m: below it a fault turns a robot as much (up to 0.32
/// rad/m by a stuck wheel of the rover).
const TURNING_1_M: f64 = 0.3;
/// Commanded turn from which they are, rad. Forty deviations of a yaw noise of 5 mrad.
const TURN_MIN_RAD: f64 = 0.2;
/// Ratio of turns below which a sign is wrong. A wrong sign reads -1; chosen half-way to 0, which
/// leaves room for ground.
const TURN_REVERSED: f64 = -0.5;
/// Ratio of turns above which the unit is wrong: the geometric mean of 1 and 57 (degrees).
const TURN_UNIT: f64 = 8.0;
/// Ratio of turns below which a robot does not follow its command. A skid-steered one turns by a
/// third on grippy ground; revolutions for rad read 0.16.
const TURN_MIN: f64 = 0.2;
/// A robot that turns about a wheel that stands turns by at most this ratio, either way: 15 for a
/// Kobuki in the widest curve that is judged. Chosen between that and 57.
const TURN_ABOUT_WHEEL_MAX: f64 = 30.0;
/// Share of the turns in which a wheel may stand without a say in the ratio.
const STANDING_MAX: f64 = 0.1;
/// A pause in the frames beyond which the motion counts as interrupted, s. Six periods of a sensor
/// of 20 Hz.
pub const PAUSE_S: f64 = 0.3;
/// Time for which a command must be constant before a frame counts, s: three lags of
/// [`crate::body::Body`].
const SETTLED_S: f64 = 0.3;
/// Change of the commanded velocity that restarts this time, m/s and rad/s. Chosen: a tenth of the
/// rover's fastest.
const CHANGE: f64 = 0.05;
/// Tests there may be: travel, turn, gyro, unit, and by wheel those of [`SIGN`] to [`STEER_ORDER`].
const TESTS: usize = STEER_ORDER + vigil_blocks::WHEELS;

/// Bits of all of them.
const ALL: u64 = (1 << TESTS) - 1;

/// Outcome of one test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TestOutcome {
    /// The motion has not excited it.
    NotYet,
    /// The motion has, and the channel does not follow it: neither right nor explained.
    Unclear,
    /// The frames agree with the description.
    Fits,
    /// They do not.
    Wrong(Finding),
    /// They do not, and another test's finding says so.
    Told,
}

/// Commanded motion in one frame.
#[derive(Debug, Clone, Copy)]
struct Motion {
    /// Velocity: forward m/s, left m/s, yaw rate rad/s.
    twist: [f64; 3],
    /// For so long, s.
    dt_s: f64,
}

/// The tests of one publisher.
#[derive(Debug, Clone, Checkpoint)]
pub struct PublisherCheck {
    #[checkpoint(fixed)]
    robot: Description,
    poses: Poses,
    wheels: Wheels,
    #[checkpoint(fixed)]
    map: ChannelMap,
    gyro: GyroSums,
    last: Option<LastFrame>,
    /// Commanded velocity: forward m/s, left m/s, yaw rate rad/s.
    twist: [f64; 3],
    /// Time for which the command has been constant, s.
    settled_s: f64,
    /// Time since the tests were evaluated, s.
    unlooked_s: f64,
    /// Bits of the tests that have ended.
    judged: u64,
    /// Bits of those of them that found something wrong.
    wrong: u64,
    /// Bits of the tests of channels that the robot does not have.
    absent: u64,
    /// Bits of the tests that failed at the last evaluation: two failures in a row are a finding.
    suspected: u64,
    is_blinding: bool,
}

/// The frame before.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct LastFrame {
    epoch: u64,
    run_id: u64,
    pose_reset_count: u32,
    t_ns: u64,
}

impl LastFrame {
    const fn new(frame: &SensorFrame) -> Self {
        Self {
            epoch: frame.header.epoch,
            run_id: frame.run_id,
            pose_reset_count: frame.pose_reset_count,
            t_ns: frame.header.t_capture_ns,
        }
    }

    /// True if both frames are of one run of one writer, between two resets of the pose.
    fn is_of_track(&self, other: &Self) -> bool {
        self.epoch == other.epoch
            && self.run_id == other.run_id
            && self.pose_reset_count == other.pose_reset_count
    }
}

/// Sums of a gyro's rate against the commanded yaw rate.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
struct GyroSums {
    /// Measured times commanded rate.
    product: f64,
    /// Squared commanded rate.
    square: f64,
    /// Commanded turn, rad, and the part of it in which a wheel stood.
    turn_rad: f64,
    standing_rad: f64,
}

/// Time between evaluations of the tests, s. Chosen: four a second, so that a frame costs little
/// and a finding, which needs two, comes within half a second.
const LOOK_S: f64 = 0.25;
/// Bits of the tests by their place.
const TRAVEL: usize = 0;
const TURN: usize = 1;
const GYRO: usize = 2;
const UNIT: usize = 3;
const SIGN: usize = 4;
const STEER: usize = SIGN + vigil_blocks::WHEELS;
const SIDES: usize = STEER + vigil_blocks::WHEELS;
const AXLES: usize = SIDES + vigil_blocks::WHEELS;
const STEER_ORDER: usize = AXLES + vigil_blocks::WHEELS;

impl PublisherCheck {
    /// The tests for frames of `robot`.
    #[must_use]
    pub fn new(robot: &Description) -> Self {
        Self {
            robot: robot.clone(),
            poses: Poses::default(),
            wheels: Wheels::new(robot),
            map: ChannelMap::new(robot),
            gyro: GyroSums::default(),
            last: None,
            twist: [0.0; 3],
            settled_s: 0.0,
            unlooked_s: 0.0,
            judged: 0,
            wrong: 0,
            absent: 0,
            suspected: 0,
            is_blinding: false,
        }
        .without_absent_channels()
    }

    /// Ends the tests of channels that the robot does not have.
    fn without_absent_channels(mut self) -> Self {
        let (wheels, measured) = (self.wheels.wheel_count(), self.robot.measured);
        for test in 0..TESTS {
            let wheel = wheel_of(test).filter(|wheel| *wheel < wheels);
            let is_steered = |wheel: usize| measured.steer && self.robot.wheels[wheel].steered;
            let has_others = |group| {
                wheel.is_some_and(|wheel| self.wheels.others(group, wheel).next().is_some())
            };
            let is_there = match test {
                TRAVEL => measured.pose && self.robot.kinematics != Kinematics::None,
                TURN => measured.pose && self.is_turned(),
                GYRO => measured.yaw_rate && self.is_turned(),
                UNIT => measured.wheel_rates && wheels > 0,
                SIGN..STEER => measured.wheel_rates && wheel.is_some(),
                STEER..SIDES => wheel.is_some_and(is_steered),
                SIDES..AXLES => measured.wheel_rates && has_others(Group::Across),
                AXLES..STEER_ORDER => measured.wheel_rates && has_others(Group::Side),
                _ => wheel.is_some_and(is_steered) && has_others(Group::Steered),
            };
            self.absent |= u64::from(!is_there) << test;
        }
        self.judged = self.absent;
        self
    }

    /// True if a command can ask for turns.
    fn is_turned(&self) -> bool {
        match self.robot.kinematics {
            Kinematics::None => false,
            Kinematics::Omni3 => self.robot.command.len() > 2,
            _ => true,
        }
    }

    /// Restarts all tests, as for another publisher.
    pub fn reset(&mut self) {
        self.poses = Poses::default();
        self.wheels.reset(&self.robot);
        (self.gyro, self.last) = (GyroSums::default(), None);
        (self.settled_s, self.unlooked_s) = (0.0, 0.0);
        (self.judged, self.wrong, self.suspected) = (self.absent, 0, 0);
        self.is_blinding = false;
    }

    /// True if a finding hides faults.
    #[must_use]
    pub const fn is_blinding(&self) -> bool {
        self.is_blinding
    }

    /// Takes a frame; the next finding, one at a time.
    pub fn take(&mut self, frame: &SensorFrame) -> Option<Finding> {
        if self.judged == ALL {
            return None;
        }
        let now = LastFrame::new(frame);
        let last = self.last.replace(now).filter(|last| last.is_of_track(&now));
        let passed_ns = last.map_or(0, |last| now.t_ns.saturating_sub(last.t_ns));
        let dt_s = passed_ns as f64 * 1e-9;
        let twist = self.robot.twist(&frame.command);
        let mut axes = 0..self.robot.command.len();
        let is_commanded = axes.all(|i| frame.commanded(i).is_some());
        let moves =
            is_commanded && self.robot.path_speed_m_s(twist) >= self.robot.body.standing_m_s;
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
        self.add(frame, Motion { twist, dt_s });
        self.unlooked_s += dt_s;
        if self.unlooked_s < LOOK_S {
            return None;
        }
        self.look()
    }

    fn add(&mut self, frame: &SensorFrame, motion: Motion) {
        let Motion { twist, dt_s } = motion;
        let has_standing = self.wheels.take(&self.robot, &self.map, frame, motion);
        let standing_m_s = self.robot.body.standing_m_s;
        let pose = self
            .map
            .pose(frame)
            .filter(|pose| pose.iter().all(|v| v.is_finite()));
        self.poses.take(pose, motion, has_standing, standing_m_s);
        let turns = twist[2].abs() >= TURNING_1_M * twist[0].hypot(twist[1]);
        if let Some(yaw_rate) = self.map.yaw_rate(frame).filter(|v| turns && v.is_finite()) {
            self.gyro.product += yaw_rate * twist[2] * dt_s;
            self.gyro.square += twist[2] * twist[2] * dt_s;
            let turn_rad = twist[2].abs() * dt_s;
            self.gyro.turn_rad += turn_rad;
            if has_standing {
                self.gyro.standing_rad += turn_rad;
            }
        }
    }

    /// Evaluates every test that has not ended; returns the first that fails, and the others at the
    /// next evaluations.
    fn look(&mut self) -> Option<Finding> {
        assert!(
            self.absent & !self.judged == 0,
            "no test of a channel that the robot does not have is evaluated"
        );
        let (before, ended) = (self.suspected, self.judged);
        self.wheels.settle();
        for test in (0..TESTS).filter(|test| ended >> test & 1 == 0) {
            let bit = 1 << test;
            match self.judge(test) {
                TestOutcome::NotYet | TestOutcome::Unclear => self.suspected &= !bit,
                TestOutcome::Fits => {
                    self.suspected &= !bit;
                    self.judged |= bit;
                }
                TestOutcome::Wrong(_) | TestOutcome::Told if before & bit == 0 => {
                    self.suspected |= bit;
                }
                TestOutcome::Told => {
                    (self.judged, self.wrong) = (self.judged | bit, self.wrong | bit)
                }
                TestOutcome::Wrong(finding) => {
                    self.judged |= bit;
                    self.wrong |= bit;
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
            GYRO => self.gyro.turn(),
            UNIT => self.wheels.unit(),
            SIGN..STEER => self.wheels.sign(test - SIGN),
            STEER..SIDES => self.wheels.steering(test - STEER),
            SIDES..AXLES => self.order(WheelChannel::Rate, test - SIDES, Group::Across),
            AXLES..STEER_ORDER => self.order(WheelChannel::Rate, test - AXLES, Group::Side),
            _ => self.order(WheelChannel::Steer, test - STEER_ORDER, Group::Steered),
        }
    }

    fn order(&self, channel: WheelChannel, wheel: usize, group: Group) -> TestOutcome {
        self.wheels.order(channel, wheel, group)
    }

    /// True once a test has ended.
    #[must_use]
    pub const fn has_judged(&self) -> bool {
        self.judged != self.absent
    }
}

impl GyroSums {
    /// Tests the turns.
    fn turn(&self) -> TestOutcome {
        if self.turn_rad < TURN_MIN_RAD {
            return TestOutcome::NotYet;
        }
        let standing = self.standing_rad / self.turn_rad;
        turn(FindingKind::Gyro, self.product / self.square, standing)
    }
}

/// A ratio of turns, in this share of which a wheel stood.
fn turn(kind: FindingKind, ratio: f64, standing: f64) -> TestOutcome {
    let is_about_wheel = standing > STANDING_MAX && ratio.abs() < TURN_ABOUT_WHEEL_MAX;
    match (TURN_REVERSED..=TURN_UNIT).contains(&ratio) {
        false if is_about_wheel => TestOutcome::Unclear,
        false => TestOutcome::new(kind, None, ratio),
        true if ratio < TURN_MIN => TestOutcome::Unclear,
        true => TestOutcome::Fits,
    }
}

/// The wheel of a test of one.
fn wheel_of(test: usize) -> Option<usize> {
    Some(test.checked_sub(SIGN)? % vigil_blocks::WHEELS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "no test of a channel that the robot does not have is evaluated")]
    fn a_test_of_an_absent_channel_would_end_the_process() {
        let text = include_str!("../../../../config/robots/rover.toml");
        let robot: Description = toml::from_str(text).unwrap_or_else(|error| panic!("{error}"));
        let mut check = PublisherCheck::new(&robot);
        check.absent |= 1;
        check.look();
    }
}
