//! What no filter could tell: sensors that fell silent, and motion that nobody commanded.
//!
//! A filter weighs what it reads while the robot is driven. Readings that do not come change no
//! belief, and a robot that should stand is not weighed at all: both would pass for health.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;
use vigil_inference::angle::wrap;

use super::{Model, Observation};

/// A channel that says nothing for so long is silent, s: chosen. Slower sensors are not supported.
const SILENT_S: f64 = 2.0;
/// A pose that repeats itself exactly for so long in motion is frozen, s: if in this run it has
/// changed so often (two seconds of 50 ms), and never stood for a quarter as long.
const FROZEN_S: f64 = 1.0;
const CHANGES: u32 = 40;
/// Two poses less apart, relative to their size, are the same: means of equal numbers differ in the
/// last bits.
const SAME: f64 = 4.0 * f64::EPSILON;
/// Time for which the robot is commanded to stand before it is expected to, s: twice the longest
/// lag.
const STOPPED_S: f64 = 1.0;
/// Motion at rest counts when it lasts so long, s: no single reading decides. Six 50 ms
/// observations.
const LASTING_S: f64 = 0.3;
/// How far a standing robot's pose may wander within [`WANDERING_S`], m and rad, besides its noise:
/// ten and twenty deviations of it.
const WANDER_M: f64 = 0.05;
const WANDER_RAD: f64 = 0.1;
/// Time over which a slow wandering of the pose is taken for the map's, s. 0.05 m in it are 5 mm/s:
/// slower is the map's, faster the robot's.
const WANDERING_S: f64 = 10.0;
/// Poses whose mean is where the robot rests. 0.3 s of 50 ms: their mean has 0.4 of the noise.
const REST_POSES: u32 = 6;
/// Deviations of the pose's noise that are no motion. By chance 2 in 1e9: once in ten months at 20
/// Hz.
const NOISE_SD: f64 = 6.0;
/// A standing robot's wheels turn slower than this, rad/s: six deviations of their noise.
const TURNING_RAD_S: f64 = 0.3;

/// What is the matter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, CheckpointValue)]
pub struct Troubles {
    /// No pose for a while.
    pub pose_silent: bool,
    /// The pose repeats itself exactly while the robot moves, as it never did before.
    pub pose_frozen: bool,
    /// Wheels whose rates used to come and do not any more, as bits.
    pub wheels_silent: u32,
    /// The pose moves, and most wheels turn, though the robot is commanded to stand.
    pub pose_moves: bool,
    /// As `pose_moves`, for the wheels.
    pub wheels_turn: bool,
    /// Most wheels are read, and stand.
    pub wheels_stand: bool,
}

impl Troubles {
    /// True if anything is the matter with what is used: the pose, and the wheels if they are.
    #[must_use]
    pub const fn any(&self, use_wheels: bool) -> bool {
        let pose = self.pose_silent || self.pose_frozen || self.pose_moves;
        pose || use_wheels && (self.wheels_silent != 0 || self.wheels_turn)
    }
}

/// Watches for troubles, observation by observation.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub struct PlausibilityCheck {
    pose_silent_s: f64,
    last_pose: Option<[f64; 3]>,
    pose_held_s: f64,
    pose_held_before_s: f64,
    pose_changes: u32,
    wheels_silent_s: [f64; WHEELS],
    wheels_heard: u32,
    stopped_s: f64,
    rest: Option<[f64; 3]>,
    rest_poses: u32,
    pose_moving_s: f64,
    wheels_turning_s: f64,
}

impl PlausibilityCheck {
    /// Takes the next observation of a run; `is_stopped` if the robot is commanded to stand and
    /// the body has followed.
    pub fn step(
        &mut self,
        observation: &Observation,
        is_stopped: bool,
        limits: &RestLimits,
    ) -> Troubles {
        let dt_s = observation.dt_s;
        let lasting = |so_far_s: f64, holds: bool| if holds { so_far_s + dt_s } else { 0.0 };
        self.pose_silent_s = lasting(self.pose_silent_s, observation.pose_frames == 0);
        let pose_frozen = self.freezes(observation);
        let mut wheels_silent = 0;
        let (mut heard, mut turning) = (0, 0);
        for (wheel, reading) in observation.wheels.iter().enumerate() {
            let is_read = reading.count() > 0;
            self.wheels_silent_s[wheel] = lasting(self.wheels_silent_s[wheel], !is_read);
            self.wheels_heard |= u32::from(is_read) << wheel;
            let is_silent = self.wheels_silent_s[wheel] >= SILENT_S;
            wheels_silent |= u32::from(is_silent) << wheel & self.wheels_heard;
            heard += u32::from(is_read);
            turning += u32::from(is_read && reading.mean.abs() > TURNING_RAD_S);
        }
        self.stopped_s = lasting(self.stopped_s, is_stopped);
        let at_rest = self.stopped_s >= STOPPED_S;
        let turns = at_rest && 2 * turning > heard;
        let wheels_stand = 2 * heard > self.wheels_heard.count_ones() && 2 * turning <= heard;
        self.wheels_turning_s = lasting(self.wheels_turning_s, turns);
        if observation.anchor || !at_rest {
            (self.rest, self.rest_poses, self.pose_moving_s) = (None, 0, 0.0);
        } else if observation.pose_frames > 0 {
            let moves = self.moves(observation.pose, dt_s, limits);
            self.pose_moving_s = lasting(self.pose_moving_s, moves);
        }
        Troubles {
            pose_silent: self.pose_silent_s >= SILENT_S,
            pose_frozen,
            wheels_silent,
            pose_moves: self.pose_moving_s >= LASTING_S,
            wheels_turn: self.wheels_turning_s >= LASTING_S,
            wheels_stand: wheels_stand && self.stopped_s >= STOPPED_S,
        }
    }

    /// True if the pose is frozen.
    fn freezes(&mut self, observation: &Observation) -> bool {
        if observation.pose_frames == 0 {
            return self.is_frozen();
        }
        let pose = observation.pose;
        let is_same = self.last_pose.replace(pose).is_some_and(|last| {
            let mut pairs = pose.into_iter().zip(last);
            pairs.all(|(now, before)| (now - before).abs() <= SAME * now.abs().max(1.0))
        });
        let before_s = self.pose_held_s;
        self.pose_held_s = match is_same {
            true => before_s + observation.moved_s(),
            false => 0.0,
        };
        let was_frozen = before_s >= FROZEN_S && self.pose_changes >= CHANGES;
        if !is_same && !was_frozen {
            self.pose_changes = self.pose_changes.saturating_add(1);
            self.pose_held_before_s = self.pose_held_before_s.max(before_s);
        }
        self.is_frozen()
    }

    fn is_frozen(&self) -> bool {
        let usually_changes =
            self.pose_changes >= CHANGES && self.pose_held_before_s <= 0.25 * FROZEN_S;
        usually_changes && self.pose_held_s >= FROZEN_S
    }

    /// True if a pose is away from where the robot rests, which follows it slowly.
    fn moves(&mut self, pose: [f64; 3], dt_s: f64, limits: &RestLimits) -> bool {
        // The mean of the first poses: one alone may be an outlier.
        self.rest_poses = (self.rest_poses + 1).min(REST_POSES);
        let is_found = self.rest_poses == REST_POSES;
        let rest = self.rest.get_or_insert(pose);
        let apart = [
            pose[0] - rest[0],
            pose[1] - rest[1],
            wrap(pose[2] - rest[2]),
        ];
        let share = match is_found {
            true => (dt_s / WANDERING_S).min(1.0),
            false => 1.0 / f64::from(self.rest_poses),
        };
        for (rest, apart) in rest.iter_mut().zip(apart) {
            *rest += share * apart;
        }
        let is_apart =
            apart[0].hypot(apart[1]) > limits.position_m || apart[2].abs() > limits.yaw_rad;
        is_found && is_apart
    }
}

/// How far a resting pose may be from where it was.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestLimits {
    position_m: f64,
    yaw_rad: f64,
}

impl RestLimits {
    /// Those of a model's pose sensor.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            position_m: WANDER_M + NOISE_SD * model.noise.position_m,
            yaw_rad: WANDER_RAD + NOISE_SD * model.noise.yaw_rad,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learned::Reading;

    const LIMITS: RestLimits = RestLimits {
        position_m: 0.08,
        yaw_rad: 0.13,
    };

    fn observation(x: f64, rates: &[f64]) -> Observation {
        let mut observation = Observation {
            dt_s: 0.05,
            pose_frames: 1,
            pose: [x, 0.0, 3.1],
            ..Observation::default()
        };
        for (wheel, &rate) in rates.iter().enumerate() {
            let mut reading = Reading::default();
            reading.push(rate, None);
            observation.wheels[wheel] = reading;
        }
        observation
    }

    /// Observations after which `troubles` are first seen.
    fn first(
        check: &mut PlausibilityCheck,
        stopped: bool,
        next: impl Fn(u32) -> Observation,
        seen: impl Fn(&Troubles) -> bool,
    ) -> Option<u32> {
        (1..=400).find(|&k| seen(&check.step(&next(k), stopped, &LIMITS)))
    }

    #[test]
    fn a_channel_is_silent_after_two_seconds_and_no_longer_once_it_reads() {
        let mut check = PlausibilityCheck::default();
        let good = observation(0.0, &[1.0, 1.0]);
        assert_eq!(check.step(&good, false, &LIMITS), Troubles::default());
        let mut bad = observation(0.0, &[1.0]);
        bad.pose_frames = 0;
        let found = first(&mut check, false, |_| bad, |t| t.pose_silent);
        assert_eq!(found, Some(40));
        let troubles = check.step(&bad, false, &LIMITS);
        // The third wheel never read anything: it is not there.
        assert_eq!((troubles.wheels_silent, troubles.any(false)), (2, true));
        assert_eq!(check.step(&good, false, &LIMITS), Troubles::default());
    }

    #[test]
    fn a_pose_that_freezes_is_noticed_after_a_second_and_a_slow_one_is_none() {
        let drives = |k: u32| Observation {
            moving: true,
            ..observation(0.01 * f64::from(k), &[2.5; 6])
        };
        for (hold, frozen) in [(1, true), (20, false), (100, false)] {
            let mut check = PlausibilityCheck::default();
            let slow = |k: u32| drives(k / hold * hold);
            assert_eq!(first(&mut check, false, slow, |t| t.any(true)), None);
            let held = |_| drives(9999);
            let found = first(&mut check, false, held, |t| t.pose_frozen);
            assert_eq!(found, frozen.then_some(21), "one pose in {hold}");
            assert!(!check.step(&drives(0), false, &LIMITS).pose_frozen);
        }
    }

    #[test]
    fn a_robot_that_drives_on_though_it_should_stand_is_noticed() {
        for speed in [0.05, 0.2, -0.2] {
            let mut check = PlausibilityCheck::default();
            let drives = |k: u32| observation(speed * 0.05 * f64::from(k), &[0.1; 6]);
            assert_eq!(first(&mut check, false, drives, |t| t.any(true)), None);
            let found = first(&mut check, true, drives, |t| t.pose_moves);
            let after_s = f64::from(found.unwrap_or(u32::MAX)) * 0.05;
            assert!(after_s < 1.5 + 0.1 / f64::abs(speed), "{after_s}");
        }
        let mut check = PlausibilityCheck::default();
        let spins = |_| observation(0.0, &[2.0, 2.0, 2.0, 2.0, 0.0, 0.0]);
        let found = first(&mut check, true, spins, |t| t.wheels_turn);
        assert_eq!(found, Some(25));
    }

    #[test]
    fn a_noisy_or_slowly_drifting_pose_and_one_broken_encoder_are_no_motion() {
        let mut check = PlausibilityCheck::default();
        let rests = |k: u32| {
            let noise = if k.is_multiple_of(2) { 0.02 } else { -0.02 };
            observation(noise + 0.002 * 0.05 * f64::from(k), &[5.0, 0.0, 0.0, 0.0])
        };
        assert_eq!(first(&mut check, true, rests, |t| t.any(true)), None);
        // A jump of the map is none either.
        let mut jump = observation(9.0, &[0.0; 4]);
        jump.anchor = true;
        assert!(!check.step(&jump, true, &LIMITS).any(true));
        let there = |_| observation(9.0, &[0.0; 4]);
        assert_eq!(first(&mut check, true, there, |t| t.any(true)), None);
    }
}
