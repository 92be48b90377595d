//! What publishers do wrong, over frames of simulated robots, and what is said of it.

use std::ops::Range;

use vigil_blocks::SensorFrame;
use vigil_robot::learned::wheels::steering_angle;
use vigil_robot::publisher_check::{PublisherCheck, Scope, expected_rate};
use vigil_robot::{ChannelMap, Description};

const PERIOD_S: f64 = 0.02;

/// A robot by the name of its file.
fn robot(name: &str) -> Description {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/robots");
    let text = std::fs::read_to_string(format!("{folder}/{name}.toml")).unwrap();
    let mut robot: Description = toml::from_str(&text).unwrap();
    // Its log lacks the rates; a publisher has them.
    robot.measured.wheel_rates = true;
    robot
}

/// A command, and for how long it holds, s.
type Stretch = ([f64; 2], f64);

fn straight(name: &str) -> Vec<Stretch> {
    match name {
        "rover" => vec![([0.0, 0.2], 5.0)],
        _ => vec![([0.2, 0.0], 5.0)],
    }
}

/// Straight ahead, a left curve, a right one; an omni drive goes all ways.
fn curves(name: &str) -> Vec<Stretch> {
    match name {
        "rover" => vec![([0.0, 0.2], 4.0), ([0.9, 0.2], 8.0), ([-0.9, 0.2], 8.0)],
        "robotino" => vec![([0.2, 0.0], 8.0), ([0.0, 0.2], 8.0), ([0.15, 0.15], 8.0)],
        _ => vec![([0.3, 0.0], 4.0), ([0.25, 0.6], 8.0), ([0.25, -0.6], 8.0)],
    }
}

/// A healthy drive, with noise, a wheel that slips by 4 % and a lag of a tenth of a second.
fn drive(robot: &Description, stretches: &[Stretch]) -> Vec<SensorFrame> {
    let map = ChannelMap::new(robot);
    let (mut frames, mut pose, mut seed) = (Vec::new(), [0.0_f64; 3], 1_u64);
    let mut noise = move |deviation: f64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        deviation * ((seed >> 33) as f64 / f64::from(1_u32 << 30) - 1.0)
    };
    let mut actual = [0.0; 2];
    for (command, seconds) in stretches {
        for _ in 0..(seconds / PERIOD_S) as usize {
            for (actual, wanted) in actual.iter_mut().zip(command) {
                *actual += (wanted - *actual) * PERIOD_S / 0.1;
            }
            let mut frame = SensorFrame::default();
            (frame.header.epoch, frame.header.seq) = (1, frames.len() as u64);
            frame.header.t_capture_ns = 1_000_000_000 + 20_000_000 * frames.len() as u64;
            for (axis, value) in command.iter().enumerate() {
                frame.set_command(axis, *value);
            }
            let mut command = frame.command;
            command[..2].copy_from_slice(&actual);
            let [forward, left, turn] = robot.twist(&command);
            let (sin, cos) = pose[2].sin_cos();
            pose[0] += (forward * cos - left * sin) * PERIOD_S;
            pose[1] += (forward * sin + left * cos) * PERIOD_S;
            pose[2] += turn * PERIOD_S;
            map.set_pose(&mut frame, pose.map(|value| value + noise(0.002)));
            map.set_yaw_rate(&mut frame, turn + noise(0.01));
            for wheel in 0..robot.wheels.len() {
                let slip = if wheel == 0 { 0.96 } else { 1.0 };
                let rate = slip * expected_rate(robot, wheel, &command);
                map.set_wheel_rate(&mut frame, wheel, rate + noise(0.05));
                let steer = steering_angle(robot, wheel, command[0]);
                map.set_steer(&mut frame, wheel, steer + noise(0.003));
                map.set_current(&mut frame, wheel, 0.5 + 0.1 * rate + noise(0.02));
            }
            frames.push(frame);
        }
    }
    frames
}

type Mistake = fn(&mut SensorFrame, &ChannelMap);

/// What is found once the mistake was made in every frame, and what was judged.
fn checked(name: &str, stretches: &[Stretch], mistake: Mistake) -> (Vec<String>, Scope) {
    let robot = robot(name);
    let map = ChannelMap::new(&robot);
    let mut check = PublisherCheck::new(&robot);
    let mut found = Vec::new();
    for mut frame in drive(&robot, stretches) {
        mistake(&mut frame, &map);
        found.extend(check.take(&frame).map(|finding| finding.text(&robot)));
    }
    (found, check.scope())
}

/// Gives the channel of each wheel the rate of another: of wheel `reads[i]` to channel i.
fn reorder(frame: &mut SensorFrame, map: &ChannelMap, reads: &[usize]) {
    let rates: Vec<f64> = reads
        .iter()
        .map(|w| map.wheel_rate(frame, *w).unwrap())
        .collect();
    for (wheel, rate) in rates.into_iter().enumerate() {
        map.set_wheel_rate(frame, wheel, rate);
    }
}

fn steer_exchange(frame: &mut SensorFrame, map: &ChannelMap, wheels: [usize; 2]) {
    let [a, b] = wheels.map(|wheel| map.steer(frame, wheel));
    if let (Some(a), Some(b)) = (a, b) {
        map.set_steer(frame, wheels[0], b);
        map.set_steer(frame, wheels[1], a);
    }
}

fn scale_rates(frame: &mut SensorFrame, map: &ChannelMap, wheels: Range<usize>, by: f64) {
    for wheel in wheels {
        let rate = map.wheel_rate(frame, wheel);
        rate.into_iter()
            .for_each(|rate| map.set_wheel_rate(frame, wheel, by * rate));
    }
}

fn change_pose(frame: &mut SensorFrame, map: &ChannelMap, change: fn([f64; 3]) -> [f64; 3]) {
    if let Some(pose) = map.pose(frame) {
        map.set_pose(frame, change(pose));
    }
}

fn scale_gyro(frame: &mut SensorFrame, map: &ChannelMap, by: f64) {
    let rate = map.yaw_rate(frame);
    rate.into_iter()
        .for_each(|rate| map.set_yaw_rate(frame, by * rate));
}

fn exchange(frame: &mut SensorFrame, map: &ChannelMap, wheels: [usize; 2]) {
    let mut reads: Vec<usize> = (0..8)
        .take_while(|w| map.wheel_rate(frame, *w).is_some())
        .collect();
    reads.swap(wheels[0], wheels[1]);
    reorder(frame, map, &reads);
}

const RPM: f64 = 30.0 / std::f64::consts::PI;

/// A mistake in what frames mean.
struct Case {
    what: &'static str,
    robots: &'static [&'static str],
    mistake: Mistake,
    /// How what is said of it begins, finding by finding in any order.
    said: &'static [&'static str],
}

const EVERY: &[&str] = &["rover", "kobuki", "robotino", "husky"];
const TWO_SIDED: &[&str] = &["kobuki", "husky"];
const ROVER: &[&str] = &["rover"];
const WITH_POSE: &[&str] = &["rover", "robotino"];
const L_R: &str = "order: enc_L and enc_R fit when exchanged; or is cmd_yaw_rate positive to the";
const LM_RM: &str =
    "order: enc_LM and enc_RM fit when exchanged; or is cmd_curv positive to the right";
const RM: &str = "signs: enc_RM has the other sign";
const RIGHT: &[&str] = &["signs: enc_RF has", RM, "signs: enc_RR has"];
const SIDES: &[&str] = &[
    "order: enc_LF and enc_RF fit",
    LM_RM,
    "order: enc_LR and enc_RR fit",
];

/// Of the mistakes that users make, those in what the frames mean.
#[rustfmt::skip]
const CASES: &[Case] = &[
    Case { what: "none", robots: EVERY, mistake: |_, _| (), said: &[] },
    Case { what: "yaw in degrees", robots: ROVER, said: &["units: yaw turns 57"],
        mistake: |f, m| change_pose(f, m, |[x, y, yaw]| [x, y, yaw.to_degrees()]) },
    Case { what: "gyro in deg/s", robots: TWO_SIDED, said: &["units: yaw_rate is 5"],
        mistake: |f, m| scale_gyro(f, m, 57.3) },
    Case { what: "rates in rpm", robots: EVERY, said: &["units: the wheels turn 9"],
        mistake: |f, m| scale_rates(f, m, 0..6, RPM) },
    Case { what: "pose in mm", robots: WITH_POSE, said: &["units: x and y move"],
        mistake: |f, m| change_pose(f, m, |[x, y, yaw]| [1e3 * x, 1e3 * y, yaw]) },
    Case { what: "left and right exchanged", robots: TWO_SIDED, said: &[L_R],
        mistake: |f, m| exchange(f, m, [0, 1]) },
    Case { what: "both sides exchanged", robots: ROVER, said: SIDES,
        mistake: |f, m| reorder(f, m, &[3, 4, 5, 0, 1, 2]) },
    Case { what: "gyro reversed", robots: TWO_SIDED, said: &["signs: yaw_rate is -0.9"],
        mistake: |f, m| scale_gyro(f, m, -1.0) },
    Case { what: "yaw reversed", robots: ROVER,
        said: &["signs: yaw turns -1", "axes: x and y move"],
        mistake: |f, m| change_pose(f, m, |[x, y, yaw]| [x, y, -yaw]) },
    Case { what: "z down", robots: ROVER, said: &["signs: yaw turns -1"],
        mistake: |f, m| change_pose(f, m, |[x, y, yaw]| [x, -y, -yaw]) },
    Case { what: "x and y exchanged", robots: WITH_POSE, said: &["axes: x and y move"],
        mistake: |f, m| change_pose(f, m, |[x, y, yaw]| [y, x, yaw]) },
    Case { what: "one encoder reversed", robots: TWO_SIDED, said: &["signs: enc_R has"],
        mistake: |f, m| scale_rates(f, m, 1..2, -1.0) },
    Case { what: "one encoder reversed", robots: ROVER, said: &[RM],
        mistake: |f, m| scale_rates(f, m, 4..5, -1.0) },
    Case { what: "one encoder reversed", robots: &["robotino"], said: &["signs: enc_B has"],
        mistake: |f, m| scale_rates(f, m, 1..2, -1.0) },
    Case { what: "right encoders reversed", robots: ROVER, said: RIGHT,
        mistake: |f, m| scale_rates(f, m, 3..6, -1.0) },
    Case { what: "one reversed, sides exchanged", robots: TWO_SIDED, said: &["signs: enc_R", L_R],
        mistake: |f, m| { exchange(f, m, [0, 1]); scale_rates(f, m, 1..2, -1.0); } },
    Case { what: "middle wheels exchanged", robots: ROVER, said: &[LM_RM],
        mistake: |f, m| exchange(f, m, [1, 4]) },
    Case { what: "wheels axle by axle", robots: ROVER, said: &[
            "order: enc_LM fits as enc_RF", "order: enc_LR fits as enc_LM",
            "order: enc_RF fits as enc_RM", "order: enc_RM fits as enc_LR"],
        mistake: |f, m| reorder(f, m, &[0, 3, 1, 4, 2, 5]) },
    Case { what: "wheels A and C exchanged", robots: &["robotino"],
        said: &["order: enc_A and enc_C fit when exchanged"],
        mistake: |f, m| exchange(f, m, [0, 2]) },
    Case { what: "wheels one further", robots: &["robotino"], said: &[
            "order: enc_A fits as enc_B", "order: enc_B fits as enc_C",
            "order: enc_C fits as enc_A"],
        mistake: |f, m| reorder(f, m, &[1, 2, 0]) },
    Case { what: "steering reversed", robots: ROVER, said: &[
            "signs: steer_LF", "signs: steer_LR", "signs: steer_RF", "signs: steer_RR"],
        mistake: |f, m| (0..6).for_each(|w| {
            let angle = m.steer(f, w).unwrap_or(0.0);
            m.set_steer(f, w, -angle);
        }) },
    Case { what: "front steering exchanged", robots: ROVER,
        said: &["order: steer_LF and steer_RF fit when exchanged"],
        mistake: |f, m| steer_exchange(f, m, [0, 3]) },
    Case { what: "front and rear exchanged", robots: ROVER, said: &[],
        mistake: |f, m| exchange(f, m, [0, 2]) },
    // Faults of the robot are none of its publisher.
    Case { what: "a wheel sticks", robots: EVERY, said: &[],
        mistake: |f, m| m.set_wheel_rate(f, 0, 0.0) },
    Case { what: "an encoder is frozen", robots: ROVER, said: &[],
        mistake: |f, m| m.set_wheel_rate(f, 0, 3.1) },
];

#[test]
fn each_mistake_is_told_on_each_robot() {
    let mut wrong = Vec::new();
    for case in CASES {
        for name in case.robots {
            let (found, _) = checked(name, &curves(name), case.mistake);
            let is_said = |said: &&str| found.iter().filter(|text| text.starts_with(said)).count();
            if found.len() != case.said.len() || case.said.iter().any(|said| is_said(said) != 1) {
                wrong.push(format!("{name}, {}: {found:?}", case.what));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A robot with two wheels turns about the one that sticks, to the left whatever it is told.
#[test]
fn a_body_that_turns_about_a_stuck_wheel_has_no_other_sign() {
    let about_left: Mistake = |frame, map| {
        let right_m_s = frame.command[0] + 0.115 * frame.command[1];
        map.set_wheel_rate(frame, 0, 0.0);
        map.set_yaw_rate(frame, right_m_s / 0.23);
    };
    for seconds in [0.8, 1.4, 2.0, 8.0] {
        let (found, _) = checked("kobuki", &[([0.25, -0.6], seconds)], about_left);
        assert_eq!(found, [""; 0], "{seconds} s");
    }
    // One that sticks later.
    let sticks: Mistake = |frame, map| {
        let right_m_s = frame.command[0] + 0.115 * frame.command[1];
        if frame.header.seq > 250 {
            map.set_wheel_rate(frame, 0, 0.0);
            map.set_yaw_rate(frame, right_m_s / 0.23);
        }
    };
    let (found, _) = checked("kobuki", &[([0.3, 0.0], 5.0), ([0.25, -0.6], 8.0)], sticks);
    assert_eq!(found, [""; 0]);
}

/// What no wheel explains is told beside one that stands, and what a wheel might explain where
/// none does.
#[test]
fn mistakes_are_told_beside_a_broken_encoder_and_in_tight_curves() {
    let in_degrees: Mistake = |frame, map| {
        map.set_wheel_rate(frame, 0, 0.0);
        scale_gyro(frame, map, 57.3);
    };
    let to_the_right: Mistake = |frame, _| frame.set_command(1, -frame.command[1]);
    let tight = [([0.25, 0.9], 8.0), ([0.25, -0.9], 8.0)];
    for (mistake, said) in [
        (in_degrees, "units: yaw_rate is 5"),
        (to_the_right, "signs: yaw_rate is -"),
    ] {
        for stretches in [&tight[..], &tight[..1], &tight[1..]] {
            let (found, _) = checked("kobuki", stretches, mistake);
            let is_told = found.iter().any(|text| text.starts_with(said));
            assert!(is_told, "{said}: {found:?}");
        }
    }
}

/// True if something that begins so is said to fit.
fn says(fits: &[String], what: &str) -> bool {
    fits.iter().any(|text| text.starts_with(what))
}

#[test]
fn nothing_fits_that_the_motion_has_not_shown() {
    let mistakes: [Mistake; 5] = [
        |f, m| change_pose(f, m, |[x, y, yaw]| [x, y, yaw.to_degrees()]),
        |f, m| scale_gyro(f, m, -1.0),
        |f, m| exchange(f, m, [0, 1]),
        |f, m| change_pose(f, m, |[x, y, yaw]| [x, -y, -yaw]),
        |f, m| steer_exchange(f, m, [0, 3]),
    ];
    for name in EVERY {
        for mistake in mistakes {
            let (found, scope) = checked(name, &straight(name), mistake);
            assert_eq!(found, Vec::<String>::new(), "{name}");
            for what in ["sign and unit of yaw", "sides", "order", "signs of steer"] {
                assert!(!says(&scope.fits, what), "{name}: {what}: {scope:?}");
            }
            assert!(!scope.unjudged.is_empty());
        }
    }
    // A channel that does not follow fits nothing, whatever is driven.
    let still: Mistake = |f, m| m.set_wheel_rate(f, 4, 0.0);
    let (_, scope) = checked("rover", &curves("rover"), still);
    assert!(
        scope.unclear.contains(&"signs of enc_RM".to_owned()),
        "{scope:?}"
    );
    let slow: Mistake = |f, m| scale_gyro(f, m, 0.1);
    let (_, scope) = checked("kobuki", &curves("kobuki"), slow);
    assert_eq!(scope.unclear, ["sign and unit of yaw_rate"]);
    // A command in other units is beyond its limits, and nothing fits it.
    for (axis, by) in [(0, 100.0), (1, 57.3)] {
        let robot = robot("kobuki");
        let mut check = PublisherCheck::new(&robot);
        for mut frame in drive(&robot, &curves("kobuki")) {
            let value = by * frame.command[axis];
            frame.set_command(axis, value);
            check.take(&frame);
        }
        let fits = check.scope().fits;
        assert!(
            !says(&fits, "unit of the wheel rates") || axis == 1,
            "{fits:?}"
        );
        assert!(
            !says(&fits, "sign and unit of yaw_rate") || axis == 0,
            "{fits:?}"
        );
    }
}

#[test]
fn any_two_exchanged_wheels_of_the_rover_are_told_where_motion_tells_them() {
    let robot = robot("rover");
    let clean = drive(&robot, &curves("rover"));
    let map = ChannelMap::new(&robot);
    for (i, j) in (0..6).flat_map(|i| (i + 1..6).map(move |j| (i, j))) {
        let mut check = PublisherCheck::new(&robot);
        let mut found = Vec::new();
        for mut frame in clean.clone() {
            exchange(&mut frame, &map, [i, j]);
            found.extend(check.take(&frame).map(|finding| finding.text(&robot)));
        }
        let [a, b] = [i, j].map(|wheel| &robot.wheels[wheel]);
        if a.y == b.y && a.x == -b.x {
            assert_eq!(found, Vec::<String>::new());
            let pair = format!("which is which of enc_{}, enc_{}", a.name, b.name);
            assert!(check.scope().unknowable.contains(&pair), "{pair}");
            continue;
        }
        // The rear wheel of a side reads as the front one does: the nearer exchange is told.
        let is_right = |text: &String| {
            let sides = [&a.name[..1], &b.name[..1]];
            let told = text.starts_with("order: enc_");
            told && sides
                .iter()
                .all(|side| text.contains(&format!("enc_{side}")))
        };
        assert!(
            !found.is_empty() && found.iter().all(is_right),
            "{} {}: {found:?}",
            a.name,
            b.name
        );
    }
}
