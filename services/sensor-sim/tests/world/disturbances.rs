//! Disturbances: each kind changes the signals that its physics says, and nothing else.

use vigil_blocks::SensorFrame;
use vigil_robot::disturbance_kind::{KINDS, Place};
use vigil_robot::injection::Change;
use vigil_robot::{Disturbance, DisturbanceKind, Injection};
use vigil_sensor_sim::{TrueState, World};
use vigil_setup::graph_file::Simulator;

use crate::rover::{all_finite, drive, measure, robot, segment, steady};

const RATE_HZ: f64 = 20.0;
/// Steps before the onset: the rover has long reached its speed.
const BEFORE: usize = 60;

fn change(world: &mut World, spec: &str) {
    let change = Injection::parse_change(spec, &robot()).unwrap();
    world.change(change).unwrap();
}

/// Frames and truths of 5 s after the onset of `specs`, and of the same world without them.
fn pairs(curvature_1_m: f64, specs: &[&str]) -> Vec<[(SensorFrame, TrueState); 2]> {
    let mut worlds = [
        steady(curvature_1_m, RATE_HZ),
        steady(curvature_1_m, RATE_HZ),
    ];
    let step = |worlds: &mut [World; 2]| {
        worlds.each_mut().map(|world| {
            drive(world, RATE_HZ, 1);
            (measure(world), world.true_state())
        })
    };
    for _ in 0..BEFORE {
        let [healthy, broken] = step(&mut worlds);
        assert!(healthy == broken, "bit-equal before the onset");
    }
    specs.iter().for_each(|spec| change(&mut worlds[1], spec));
    (0..100).map(|_| step(&mut worlds)).collect()
}

/// Velocity at the end, with and without.
fn velocities(curvature_1_m: f64, specs: &[&str]) -> [[f64; 3]; 2] {
    let [healthy, broken] = *pairs(curvature_1_m, specs).last().unwrap();
    [healthy.1.velocity, broken.1.velocity]
}

fn assert_near(found: f64, expected: f64, share: f64) {
    let apart = (found - expected).abs();
    assert!(
        apart <= share * expected.abs(),
        "{found} instead of {expected}"
    );
}

/// What a disturbance of a sensor may change in a frame, undone.
type Undo = fn(&mut SensorFrame, &SensorFrame);

#[test]
fn disturbances_of_sensors_touch_their_own_channel_only_and_end_without_a_trace() {
    let pose: Undo = |frame, healthy| frame.channel[..3].copy_from_slice(&healthy.channel[..3]);
    let position: Undo = |frame, healthy| frame.channel[..2].copy_from_slice(&healthy.channel[..2]);
    let yaw: Undo = |frame, healthy| {
        (frame.channel[2], frame.channel[13]) = (healthy.channel[2], healthy.channel[13]);
    };
    let missing: Undo = |frame, healthy| {
        frame.channel[..3].copy_from_slice(&healthy.channel[..3]);
        frame.channel_valid = healthy.channel_valid;
    };
    let encoder: Undo = |frame, healthy| frame.channel[3 + 1] = healthy.channel[3 + 1];
    let gyro: Undo = |frame, healthy| frame.channel[13] = healthy.channel[13];
    let current: Undo = |frame, healthy| frame.channel[14 + 1] = healthy.channel[14 + 1];
    let steer: Undo = |frame, healthy| frame.channel[9] = healthy.channel[9];
    let kinds: [(&str, Undo); 17] = [
        ("steer-bias:LF:0.1", steer),
        ("pose-jump:0.3", position),
        ("gyro-bias:0.05", gyro),
        ("gyro-scale:0", gyro),
        ("gyro-noise:20", gyro),
        ("current-noise:LM:20", current),
        ("current-bias:LM:0.5", current),
        ("current-scale:LM:0", current),
        ("yaw-rate-bias:0.02", yaw),
        ("pose-drift:0.02", position),
        ("pose-delay:0.3", pose),
        ("pose-drop", missing),
        ("pose-scale:1.05", position),
        ("encoder-scale:LM:1.2", encoder),
        ("encoder-delay:LM:0.3", encoder),
        ("encoder-bias:LM:0.6", encoder),
        ("encoder-drift:LM:0.05", encoder),
    ];
    for (spec, undo) in kinds {
        for [(healthy, true_healthy), (mut frame, truth)] in pairs(0.5, &[spec]) {
            assert!(true_healthy == truth, "{spec} does not move the rover");
            assert!(frame != healthy, "{spec}");
            undo(&mut frame, &healthy);
            assert!(frame == healthy, "{spec}: all else is bit-equal");
        }
        let kind = spec.split(':').next().unwrap();
        for clear in ["clear:all".to_owned(), format!("clear:{kind}")] {
            let mut worlds = [steady(0.5, RATE_HZ), steady(0.5, RATE_HZ)];
            change(&mut worlds[1], spec);
            drive(&mut worlds[0], RATE_HZ, 40);
            drive(&mut worlds[1], RATE_HZ, 40);
            change(&mut worlds[1], &clear);
            let [healthy, mended] = worlds.each_mut().map(measure);
            assert!(healthy == mended, "{spec} {clear}");
        }
    }
}

#[test]
fn disturbed_sensors_are_off_by_what_was_asked_for() {
    let seconds = |step: usize| (step + 1) as f64 / RATE_HZ;
    let with = |spec: &str| pairs(0.0, &[spec]);
    for (step, [(healthy, _), (frame, _)]) in with("yaw-rate-bias:0.02").iter().enumerate() {
        assert!((frame.channel[13] - healthy.channel[13] - 0.02).abs() < 1e-12);
        assert!((frame.channel[2] - healthy.channel[2] - 0.02 * seconds(step)).abs() < 1e-12);
    }
    for (step, [(healthy, _), (frame, _)]) in with("pose-drift:0.02").iter().enumerate() {
        // Straight ahead: to the left is along y.
        assert!((frame.channel[1] - healthy.channel[1] - 0.02 * seconds(step)).abs() < 1e-9);
        assert!((frame.channel[0] - healthy.channel[0]).abs() < 1e-9);
    }
    let late = with("pose-delay:0.3");
    for step in 6..100 {
        let [now, before] = [&late[step][1].0, &late[step - 6][0].0];
        assert_eq!(now.channel[..3], before.channel[..3]);
    }
    let scaled = with("pose-scale:1.05");
    let [first, last] = [scaled[0], scaled[99]].map(|[healthy, broken]| {
        (
            broken.0.channel[0] - healthy.0.channel[0],
            healthy.1.pose[0],
        )
    });
    assert_near(last.0 - first.0, 0.05 * (last.1 - first.1), 1e-9);
    let missing = |spec| {
        let missing = |pair: &&[(SensorFrame, TrueState); 2]| pair[1].0.channel_valid & 0b111 == 0;
        with(spec).iter().filter(missing).count()
    };
    assert_eq!(missing("pose-drop"), 100);
    assert!((15..45).contains(&missing("pose-drop:0.3")));
    for [(healthy, truth), (frame, _)] in with("encoder-scale:LM:1.2") {
        let added = frame.channel[3 + 1] - healthy.channel[3 + 1];
        assert_near(added, 0.2 * truth.wheel_rate_rad_s[1], 1e-9);
    }
    for [(healthy, _), (frame, _)] in with("encoder-bias:LM:0.6") {
        assert_near(frame.channel[3 + 1] - healthy.channel[3 + 1], 0.6, 1e-12);
    }
    let drifting = with("encoder-drift:LM:0.2");
    let added = drifting
        .iter()
        .map(|[(healthy, _), (frame, _)]| frame.channel[3 + 1] - healthy.channel[3 + 1]);
    let added: Vec<f64> = added.collect();
    assert!((0.0..0.011).contains(&added[0]));
    assert_near(added[99] - added[0], 0.2 * 99.0 * 0.05, 1e-9);
    for [(healthy, _), (frame, _)] in with("gyro-bias:0.05") {
        assert_near(frame.channel[13] - healthy.channel[13], 0.05, 1e-12);
    }
    for [(healthy, _), (frame, _)] in with("current-bias:LM:0.5") {
        assert_near(frame.channel[14 + 1] - healthy.channel[14 + 1], 0.5, 1e-12);
    }
    // What is dead reports exactly zero.
    assert!(
        with("gyro-scale")
            .iter()
            .all(|pair| pair[1].0.channel[13] == 0.0)
    );
    assert!(
        with("current-scale:LM")
            .iter()
            .all(|pair| pair[1].0.channel[15] == 0.0)
    );
    let late = with("encoder-delay:LM:0.3");
    for step in 6..100 {
        assert_eq!(
            late[step][1].0.channel[3 + 1],
            late[step - 6][0].0.channel[3 + 1]
        );
    }
}

#[test]
fn forces_from_outside_slow_the_rover_or_push_it_aside_by_what_the_soil_gives() {
    // Shear law: all wheels together give F at the relative slip K ln(1 / (1 - F / (mu W))), and
    // the motors give way by F r / 6 / k_v.
    let (weight_n, speed) = (14.2 * 9.81, 0.2);
    let slip = |force_n: f64| -0.2 * (1.0 - force_n / (0.65 * weight_n)).ln();
    let droop = |force_n: f64| force_n * 0.08 / 6.0 / 6.0 / 2.5;
    let [healthy, towed] = velocities(0.0, &["tether:20"]);
    assert_near(
        healthy[0] - towed[0],
        speed * (slip(20.0) + droop(20.0)),
        0.1,
    );
    assert!(towed[1].abs() < 1e-9 && towed[2].abs() < 1e-9);
    let [_, climbing] = velocities(0.0, &["slope:0.15"]);
    let force_n = weight_n * f64::sin(0.15);
    assert_near(
        healthy[0] - climbing[0],
        speed * (slip(force_n) + droop(force_n)),
        0.1,
    );
    let [_, falling] = velocities(0.0, &["slope:-0.15"]);
    assert!(falling[0] > healthy[0]);
    let [_, across] = velocities(0.0, &["side-slope:0.15"]);
    assert_near(across[1], -speed * slip(force_n), 0.1);
    assert!((across[0] - healthy[0]).abs() < 0.02 * speed);
}

#[test]
fn what_resists_on_one_side_turns_the_rover_toward_it() {
    for curvature in [-0.5, 0.0, 0.5] {
        for (spec, side) in [
            ("brush:RM:20", -1.0),
            ("brush:LF:20", 1.0),
            ("sinkage:RM:5", -1.0),
            ("sinkage:LR:5", 1.0),
            ("puncture:LM:0.9", 1.0),
            ("puncture:RF:0.9", -1.0),
        ] {
            let [healthy, broken] = velocities(curvature, &[spec]);
            let turned = (broken[2] - healthy[2]) * side;
            assert!(turned > 1e-4, "{spec} at {curvature}: {turned}");
            assert!(broken[0] < healthy[0], "{spec} slows the rover");
        }
    }
    // Resistance three times that of firm soil: a sixth of the weight resists by 0.1 of itself.
    let [healthy, sunk] = velocities(0.0, &["sinkage:RM:3"]);
    let [_, brushed] = velocities(0.0, &["brush:RM:2.32"]);
    assert_near(sunk[2] - healthy[2], brushed[2] - healthy[2], 0.1);
}

#[test]
fn a_weak_motor_or_soft_soil_leaves_the_pull_to_the_other_side() {
    let [pulled, weak] = velocities(0.0, &["tether:20"])
        .into_iter()
        .zip(velocities(0.0, &["tether:20", "torque-loss:RM:0.7"]))
        .next_back()
        .map(|(a, b)| [a, b])
        .unwrap();
    assert!(
        weak[2] < pulled[2] - 1e-4 && weak[0] < pulled[0],
        "{weak:?}"
    );
    let [(frame, _), (broken, _)] = pairs(0.0, &["torque-loss:RM:0.7"])[99];
    // The wheel keeps turning with the ground, its motor gives less.
    assert!((broken.channel[3 + 4] - frame.channel[3 + 4]).abs() < 0.1);
    let (torque, weak) = {
        let [(_, healthy), (_, broken)] = pairs(0.0, &["tether:20", "torque-loss:RM:0.7"])[99];
        (healthy.torque_n_m[4], broken.torque_n_m)
    };
    assert!(torque < weak[1] && weak[4] < 0.7 * weak[1], "{weak:?}");
    let [_, soft] = velocities(0.0, &["tether:20", "soil-soft:left:0.4"]);
    assert!(soft[2] > pulled[2] + 1e-3, "{soft:?}");
}

#[test]
fn bent_steering_turns_the_rover_whether_its_sensor_sees_it_or_not() {
    let seen = pairs(0.0, &["steer-jump:LF:0.2"]);
    let hidden = pairs(0.0, &["steer-offset-hidden:LF:0.2"]);
    for (seen, hidden) in seen.iter().zip(&hidden) {
        let [(healthy, _), (seen, moved)] = seen;
        assert!((seen.channel[9] - healthy.channel[9] - 0.2).abs() < 1e-12);
        assert_eq!(hidden[1].0.channel[9..13], healthy.channel[9..13]);
        assert_eq!(*moved, hidden[1].1, "the same motion");
    }
    assert!(seen[99][1].1.velocity[2] > 0.002);
    let [_, right] = velocities(0.0, &["steer-jump:LF:-0.2"]);
    assert!(right[2] < -0.002);
}

#[test]
fn a_moved_payload_loads_the_wheels_where_it_lies() {
    // In a turn the loads tell; straight ahead on even soil they all but do not.
    let moved = |spec| {
        let [healthy, broken] = velocities(0.5, &[spec]);
        broken[2] - healthy[2]
    };
    let (left, right) = (
        moved("payload-shift:0:0.15"),
        moved("payload-shift:0:-0.15"),
    );
    assert!(left != 0.0 && right != 0.0 && left.abs() < 0.01 && right.abs() < 0.01);
    assert!(left * right < 0.0, "{left} {right}");
}

#[test]
fn a_noisy_gyro_has_so_many_times_its_noise() {
    for [(healthy, at), (frame, _)] in pairs(0.5, &["gyro-noise:20"]) {
        let noise = |frame: &SensorFrame| frame.channel[13] - at.velocity[2];
        assert!((noise(&frame) - 20.0 * noise(&healthy)).abs() < 1e-12);
    }
}

#[test]
fn noise_of_every_channel_is_the_same_with_and_without_a_disturbance() {
    for row in &KINDS {
        let spec = match row.place {
            Place::Rover => row.name.to_owned(),
            Place::Side => format!("{}:left", row.name),
            Place::Wheel => format!("{}:RM", row.name),
            Place::SteeredWheel => format!("{}:LF", row.name),
        };
        let moves = pairs(0.5, &[&spec]);
        assert_eq!(moves.len(), 100);
        let of_sensors = ["pose", "yaw", "encoder", "gyro", "current", "steer-bias"];
        if of_sensors.into_iter().any(|of| spec.starts_with(of)) {
            continue; // Bit-equal: see above.
        }
        for [(healthy, at), (frame, moved)] in moves {
            assert!(at != moved, "{spec} moves the rover");
            let noise = |frame: &SensorFrame, truth: &TrueState| {
                let turned = frame.channel[3] - truth.wheel_rate_rad_s[0];
                [
                    frame.channel[0] - truth.pose[0],
                    frame.channel[13] - truth.velocity[2],
                    turned,
                ]
            };
            for (a, b) in noise(&healthy, &at).into_iter().zip(noise(&frame, &moved)) {
                assert!((a - b).abs() < 1e-12, "{spec}: {a} {b}");
            }
        }
    }
}

#[test]
fn every_kind_is_survived_at_its_limits_and_all_at_once_at_their_defaults() {
    for (seed, high) in [(1, Some(true)), (2, Some(false)), (3, None)] {
        let segments = [segment(3.0, 0.8, 0.3), segment(3.0, -0.8, 0.1)];
        let mut world =
            World::new(&robot(), &Simulator::default(), &segments, 100.0, seed).unwrap();
        drive(&mut world, 100.0, 100);
        for row in &KINDS {
            let mut parameter = [0.0; 2];
            for (value, range) in parameter.iter_mut().zip(row.parameters) {
                *value = high.map_or(
                    range.default,
                    |high| if high { range.high } else { range.low },
                );
            }
            let (kind, place) = (row.kind, 0);
            world
                .disturb(Disturbance {
                    kind,
                    place,
                    parameter,
                })
                .unwrap();
            drive(&mut world, 100.0, 20);
            let frame = measure(&mut world);
            assert!(all_finite(&frame), "{}", row.name);
            assert_eq!(world.unsolved(), 0, "{} {high:?}", row.name);
            if high.is_some() {
                world.end_disturbance(kind, Some(0));
            }
        }
        world.change(Change::ClearAll).unwrap();
        drive(&mut world, 100.0, 400);
        assert_eq!(world.unsolved(), 0);
        let [vx, ..] = world.true_state().velocity;
        assert!(vx > 0.09, "it drives again: {vx}");
    }
}

#[test]
fn places_and_parameters_that_do_not_exist_are_refused() {
    let mut world = steady(0.0, RATE_HZ);
    let refused = |world: &mut World, kind, place, first| {
        let parameter = [first, 0.0];
        let disturbance = Disturbance {
            kind,
            place,
            parameter,
        };
        world.disturb(disturbance).unwrap_err().to_string()
    };
    let found = refused(&mut world, DisturbanceKind::SteerJump, 1, 0.2);
    assert!(found.starts_with("steer-jump:STEERED_WHEEL"), "{found}");
    let found = refused(&mut world, DisturbanceKind::SoilSoft, 2, 0.5);
    assert!(found.contains("place 2"), "{found}");
    let found = refused(&mut world, DisturbanceKind::Tether, 0, f64::NAN);
    assert_eq!(found, "tether: N is NaN: allowed is 0 to 80");
}
