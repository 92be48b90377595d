//! The content check of frames lets pass everything that a robot and its faults can say, and
//! nothing else.

use proptest::prelude::*;
use vigil_blocks::{Rejection, SensorFrame};
use vigil_robot::channel::channels;
use vigil_robot::frame_guard::{
    BEYOND_LIMITS, CURRENT_MAX_A, JUMP_MAX_M, PAUSE_MAX_NS, POSITION_MAX_M, STEER_MAX_RAD,
    YAW_MAX_RAD,
};
use vigil_robot::publisher_check::PublisherCheck;
use vigil_robot::{ChannelMap, Description, FrameGuard};

use crate::learned::robot;

/// A number of a frame: its name, how to get at it, which of an array, and its bound.
type Place = (String, fn(&mut SensorFrame, usize) -> &mut f64, usize, f64);

/// Every number of a frame that has a meaning.
fn places(robot: &Description) -> Vec<Place> {
    let mut all: Vec<Place> = Vec::new();
    for (i, axis) in robot.command.iter().enumerate() {
        let bound = BEYOND_LIMITS * axis.limit;
        all.push((axis.name.clone(), |f, i| &mut f.command[i], i, bound));
    }
    let pose = [POSITION_MAX_M, POSITION_MAX_M, YAW_MAX_RAD];
    for (i, bound) in pose.into_iter().enumerate() {
        let name = format!("planned pose {i}");
        all.push((name, |f, i| &mut f.planned_pose[i], i, bound));
    }
    let limits = &robot.limits;
    let rates = [BEYOND_LIMITS * limits.wheel_rate_rad_s; 6];
    let gyro = [BEYOND_LIMITS * limits.yaw_rate_rad_s];
    let bounds = [
        &pose[..],
        &rates,
        &[STEER_MAX_RAD; 4],
        &gyro,
        &[CURRENT_MAX_A; 6],
    ]
    .concat();
    assert_eq!(channels(robot).len(), bounds.len());
    for ((i, channel), bound) in channels(robot).into_iter().enumerate().zip(bounds) {
        all.push((channel.name, |f, i| &mut f.channel[i], i, bound));
    }
    all
}

/// A frame of the robot in which every number is 0 and, where asked for, marked.
fn blank(robot: &Description, is_marked: bool) -> SensorFrame {
    let map = ChannelMap::new(robot);
    let mut frame = SensorFrame {
        robot_hash: map.hash(),
        ..SensorFrame::default()
    };
    if is_marked {
        frame.channel_valid = map.channel_bits();
        frame.command_valid = map.command_bits();
        frame.planned_pose_valid = 1;
    }
    frame
}

#[test]
fn each_number_has_its_bound_and_only_where_it_is_marked_valid() {
    let robot = robot();
    for (name, place, i, bound) in places(&robot) {
        for (value, expected) in [
            (bound, Ok(())),
            (-bound, Ok(())),
            (bound * 1.001, Err(Rejection::OutOfRange)),
            (-bound * 1.001, Err(Rejection::OutOfRange)),
            (1e308, Err(Rejection::OutOfRange)),
            (f64::MIN_POSITIVE / 2.0, Ok(())),
            (f64::NAN, Err(Rejection::NotFinite)),
            (f64::INFINITY, Err(Rejection::NotFinite)),
        ] {
            let mut frame = blank(&robot, true);
            *place(&mut frame, i) = value;
            assert_eq!(
                FrameGuard::new(&robot).check(&frame),
                expected,
                "{name}: {value}"
            );
            frame = blank(&robot, false);
            *place(&mut frame, i) = value;
            let unmarked = FrameGuard::new(&robot).check(&frame);
            let is_finite = if value.is_finite() { Ok(()) } else { expected };
            assert_eq!(unmarked, is_finite, "{name}, not marked: {value}");
        }
    }
}

#[test]
fn words_without_a_meaning_are_refused() {
    let robot = robot();
    let good = blank(&robot, true);
    for bad in [
        SensorFrame {
            action_outcome: 4,
            ..good
        },
        SensorFrame {
            safe_stop: 2,
            ..good
        },
        SensorFrame {
            planned_pose_valid: 2,
            ..good
        },
        // A channel that the robot does not have.
        SensorFrame {
            channel_valid: good.channel_valid | 1 << 20,
            ..good
        },
    ] {
        assert_eq!(
            FrameGuard::new(&robot).check(&bad),
            Err(Rejection::OutOfRange)
        );
    }
    assert_eq!(FrameGuard::new(&robot).check(&good), Ok(()));
    let other = SensorFrame {
        robot_hash: good.robot_hash ^ 1,
        ..good
    };
    assert_eq!(FrameGuard::new(&robot).check(&other), Err(Rejection::Robot));
}

#[test]
fn a_jump_is_measured_from_the_frame_before_and_a_new_track_has_none() {
    let robot = robot();
    let at = |x: f64, t_s: u64| {
        let mut frame = blank(&robot, true);
        frame.channel[0] = x;
        frame.header.t_capture_ns = t_s * 1_000_000_000;
        frame
    };
    let way_m = JUMP_MAX_M + BEYOND_LIMITS * robot.limits.speed_m_s;
    let mut guard = FrameGuard::new(&robot);
    assert_eq!(guard.check(&at(5000.0, 1)), Ok(()), "the first");
    assert_eq!(guard.check(&at(5000.0 + way_m, 2)), Ok(()));
    let too_far = |t_s| at(5000.0 + 2.0 * way_m + 0.1, t_s);
    assert_eq!(guard.check(&too_far(3)), Err(Rejection::Jump));
    assert_eq!(guard.check(&too_far(4)), Ok(()), "one jump is one refusal");
    for change in [
        (|f: &mut SensorFrame| f.run_id = 2) as fn(&mut SensorFrame),
        |f| f.pose_reset_count = 7,
        |f| f.header.epoch = 9,
    ] {
        let mut frame = at(0.0, 5);
        change(&mut frame);
        assert_eq!(guard.clone().check(&frame), Ok(()));
    }
    assert_eq!(guard.check(&at(0.0, 5)), Err(Rejection::Jump));
}

#[test]
fn a_capture_time_that_stands_goes_back_or_leaps_is_refused_once_for_each_setting_of_the_clock() {
    let robot = robot();
    let mut guard = FrameGuard::new(&robot);
    let mut check = |run_id: u64, t_capture_ns: u64| {
        let mut frame = blank(&robot, false);
        frame.run_id = run_id;
        frame.header.t_capture_ns = t_capture_ns;
        guard.check(&frame)
    };
    let clock = Err(Rejection::Clock);
    for (run_id, t_ns, expected) in [
        (1, 5_000, Ok(())),
        (1, 5_001, Ok(())),
        (1, 5_001, clock),
        (1, 5_002, Ok(())),
        (1, 4_000, clock), // set back
        (1, 4_010, Ok(())),
        (1, 4_010 + PAUSE_MAX_NS, Ok(())),
        (1, 4_011 + 2 * PAUSE_MAX_NS, clock), // set forward
        (1, 4_012 + 2 * PAUSE_MAX_NS, Ok(())),
        (1, u64::MAX, clock),
        (1, 4_013 + 2 * PAUSE_MAX_NS, clock), // and back
        (1, 4_014 + 2 * PAUSE_MAX_NS, Ok(())),
        (2, 0, Ok(())), // a new run may begin at any time
        (2, 0, clock),
    ] {
        assert_eq!(check(run_id, t_ns), expected, "{run_id}, {t_ns}");
    }
}

/// Any bits at all, often those of special numbers.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<u64>().prop_map(f64::from_bits),
        prop::sample::select(vec![f64::NAN, f64::INFINITY, -0.0, 1e308, 5e-324]),
        -10.0..10.0_f64,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4096))]

    #[test]
    fn whatever_passes_is_finite_and_within_bounds_where_it_is_marked(
        spoilt in prop::collection::vec((any::<prop::sample::Index>(), any_number()), 0..3),
        is_marked in any::<bool>(),
    ) {
        let robot = robot();
        let places = places(&robot);
        let mut frame = blank(&robot, is_marked);
        for (which, value) in &spoilt {
            let (_, place, i, _) = which.get(&places);
            *place(&mut frame, *i) = *value;
        }
        let is_good = places.iter().all(|(_, place, i, bound)| {
            let value = *place(&mut frame, *i);
            value.is_finite() && (!is_marked || value.abs() <= *bound)
        });
        prop_assert_eq!(FrameGuard::new(&robot).check(&frame).is_ok(), is_good);
    }

    #[test]
    fn no_sequence_of_frames_ends_the_process(
        frames in prop::collection::vec(
            (prop::array::uniform3(any_number()), any_number(), any::<u64>(), 0_u64..2), 1..20),
        in_order in any::<bool>(),
    ) {
        let robot = robot();
        let (mut guard, mut check) = (FrameGuard::new(&robot), PublisherCheck::new(&robot));
        for (i, (pose, rate, t_ns, run_id)) in (1_u64..).zip(frames) {
            let mut frame = blank(&robot, true);
            frame.run_id = run_id;
            frame.channel[..3].copy_from_slice(&pose);
            frame.channel[3..9].fill(rate);
            (frame.command[0], frame.command[1]) = (0.3, 0.2);
            frame.header.t_capture_ns = if in_order { i * 50_000_000 } else { t_ns };
            let is_good = guard.check(&frame).is_ok();
            prop_assert!(!is_good || pose.iter().all(|value| value.is_finite()));
            check.take(&frame);
        }
    }
}
