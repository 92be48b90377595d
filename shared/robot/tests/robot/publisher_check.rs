//! What publishers do wrong, over frames of simulated robots, and what is said of it.

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
        "robotino" => vec![([0.2, 0.0], 6.0), ([0.0, 0.2], 6.0), ([0.15, 0.15], 8.0)],
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

fn steer_reorder(frame: &mut SensorFrame, map: &ChannelMap, wheels: [usize; 2]) {
    let [a, b] = wheels.map(|wheel| map.steer(frame, wheel).unwrap());
    map.set_steer(frame, wheels[0], b);
    map.set_steer(frame, wheels[1], a);
}

fn scale_rates(frame: &mut SensorFrame, map: &ChannelMap, wheels: std::ops::Range<usize>, by: f64) {
    for wheel in wheels {
        let rate = map.wheel_rate(frame, wheel).unwrap();
        map.set_wheel_rate(frame, wheel, by * rate);
    }
}

fn change_pose(frame: &mut SensorFrame, map: &ChannelMap, change: fn([f64; 3]) -> [f64; 3]) {
    if let Some(pose) = map.pose(frame) {
        map.set_pose(frame, change(pose));
    }
}

fn scale_gyro(frame: &mut SensorFrame, map: &ChannelMap, by: f64) {
    let rate = map.yaw_rate(frame).unwrap();
    map.set_yaw_rate(frame, by * rate);
}

/// Robots, a mistake, and how what is said of it begins, finding by finding.
const MISTAKES: &[(&[&str], &str, Mistake, &[&str])] = &[
    (
        &["rover", "kobuki", "robotino", "husky"],
        "none",
        |_, _| (),
        &[],
    ),
    (
        &["rover"],
        "yaw in degrees",
        |f, m| change_pose(f, m, |[x, y, a]| [x, y, a.to_degrees()]),
        &["axes: ", "units: yaw turns 57"],
    ),
];

#[test]
fn each_mistake_is_told_on_each_robot() {
    for (robots, what, mistake, wanted) in MISTAKES {
        for name in *robots {
            let (found, scope) = checked(name, &curves(name), *mistake);
            eprintln!("{name} {what}: {found:#?} {scope:#?} {}", wanted.len());
        }
    }
    let _ = (straight, reorder, steer_reorder, scale_rates, scale_gyro);
}
