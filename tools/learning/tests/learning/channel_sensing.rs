//! What a learned model of channels says of a robot that moves unasked, and of silent sensors.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_learning::channel_learning::{Log, learn};
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::{Model, Monitor, Observer};
use vigil_robot::learned::Form;
use vigil_robot::learned::channels::Channels;
use vigil_robot::slot::Slot;

use super::small::small;

const RATE_HZ: f64 = 20.0;

pub fn robot(has_wheel_rates: bool) -> Description {
    small(&format!(
        "measured = {{ pose = true, wheel_rates = {has_wheel_rates}, steer = false }}\n\
         polynomial_order = 1"
    ))
}

/// Command kept up for four seconds each; one of five is rest.
pub fn stop_and_go(t_s: f64) -> [f64; 2] {
    let step = (t_s / 4.0) as u64;
    if step % 5 == 4 {
        return [0.0, 0.0];
    }
    let at = |of: u64| (step * of % 11) as f64 / 10.0;
    [0.2 + 0.5 * at(3), 0.8 * at(7) - 0.4]
}

/// A run of a robot that follows `obeys` (with a lag of 0.2 s) while told to follow `told`.
pub fn run(
    id: u32,
    length_s: f64,
    told: impl Fn(f64) -> [f64; 2],
    obeys: impl Fn(f64) -> [f64; 2],
) -> Run {
    let mut rng = Pcg64Mcg::seed_from_u64(u64::from(id));
    let mut noise = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
    let (mut pose, mut twist) = ([0.0; 3], [0.0; 2]);
    let mut frames = Vec::new();
    for i in 0..(length_s * RATE_HZ) as u64 {
        let t_s = i as f64 / RATE_HZ;
        for (twist, wanted) in twist.iter_mut().zip(obeys(t_s)) {
            *twist += (wanted - *twist) * (1.0 - (-1.0 / RATE_HZ / 0.2_f64).exp());
        }
        let [v, w] = twist;
        let heading: f64 = pose[2] + 0.5 * w / RATE_HZ;
        pose[0] += v * heading.cos() / RATE_HZ;
        pose[1] += v * heading.sin() / RATE_HZ;
        pose[2] += w / RATE_HZ;
        let mut frame = SensorFrame::default();
        frame.header.t_capture_ns = (t_s * 1e9) as u64;
        (frame.header.seq, frame.run_id) = (i, u64::from(id) + 1);
        let told = told(t_s);
        frame.set_command(0, told[0]);
        frame.set_command(1, told[1]);
        for (i, side) in [0.1, -0.1].into_iter().enumerate() {
            frame.set_channel(3 + i, (v - side * w) / 0.1 + noise(0.05));
        }
        frame.set_channel(0, pose[0] + noise(0.003));
        frame.set_channel(1, pose[1] + noise(0.003));
        let yaw = vigil_inference::angle::wrap(pose[2] + noise(0.003));
        frame.set_channel(2, yaw);
        frames.push(frame);
    }
    Run { id, frames }
}

/// What a robot without wheel rates has of a run: the pose.
fn sensed(robot: &Description, mut run: Run) -> Run {
    if !robot.measured.wheel_rates {
        run.frames
            .iter_mut()
            .for_each(|frame| frame.channel_valid &= 0b111);
    }
    run
}

pub fn learned(robot: &Description) -> Model {
    let runs = [sensed(robot, run(0, 700.0, stop_and_go, stop_and_go))];
    learn(&Log::of_healthy(&runs), robot).unwrap().0
}

/// First alarm for 24 h between false alarms, s, and the channel with the highest log-odds then.
pub fn alarm(model: &Model, robot: &Description, run: &Run) -> Option<(f64, usize)> {
    let of = (Channels::PoseEncoders, Form::LearnedBias);
    let calibration = model.calibration(of.0, of.1).unwrap();
    let threshold = calibration.alarm_log_odds(24.0, 1.0);
    let mut monitor = Monitor::new(model, robot, Channels::PoseEncoders, 1.0).unwrap();
    let mut observer = Observer::new(robot);
    for frame in &sensed(robot, run.clone()).frames {
        if !observer.push(frame).complete {
            continue;
        }
        monitor.step(observer.history(), observer.orders());
        let report = monitor.report();
        if monitor.is_ready() && report.log_odds > threshold {
            let channels = report.channels.iter().enumerate();
            let (at, _) = channels.max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
            return Some((frame.header.t_capture_ns as f64 * 1e-9, at));
        }
    }
    None
}

#[test]
fn a_robot_that_runs_away_is_noticed_by_its_pose_alone() {
    let robot = robot(false);
    let model = learned(&robot);
    // Told to rest from 10 s on: what moves on is slow, or turns.
    for (id, unasked) in [
        (1, [0.4, 0.0]),
        (2, [0.1, 0.0]),
        (3, [-0.1, 0.0]),
        (4, [0.0, 0.5]),
    ] {
        let told = |t_s: f64| if t_s < 10.0 { [0.4, 0.1] } else { [0.0; 2] };
        let obeys = |t_s: f64| if t_s < 10.0 { [0.4, 0.1] } else { unasked };
        let found = alarm(&model, &robot, &run(id, 20.0, told, obeys));
        let (found_s, channel) = found.unwrap();
        assert!((10.0..15.0).contains(&found_s), "{unasked:?}: {found_s} s");
        assert!([Slot::POSE, Slot::ANY].contains(&channel), "{channel}");
    }
    // One that was not told to move at all since the start.
    let found = alarm(&model, &robot, &run(5, 10.0, |_| [0.0; 2], |_| [0.4, 0.0]));
    assert!(found.unwrap().0 < 4.0, "{found:?}");
    for id in 10..14 {
        let healthy = run(id, 120.0, stop_and_go, stop_and_go);
        assert_eq!(alarm(&model, &robot, &healthy), None, "run {id}");
    }
}

#[test]
fn what_has_ended_is_forgotten_within_seconds() {
    let robot = robot(false);
    let model = learned(&robot);
    let mut monitor = Monitor::new(&model, &robot, Channels::PoseEncoders, 1.0).unwrap();
    let mut observer = Observer::new(&robot);
    let told = |t_s: f64| match t_s {
        t_s if (10.0..14.0).contains(&t_s) => [0.0; 2],
        _ => [0.4, 0.1],
    };
    let mut at = Vec::new();
    for frame in &run(1, 24.0, told, |_| [0.4, 0.1]).frames {
        if observer.push(frame).complete {
            monitor.step(observer.history(), observer.orders());
            at.push(monitor.report().log_odds);
        }
    }
    // One observation lasts 0.1 s: while it runs away, and when it is told to drive again.
    assert!(at[138] > 5.0 && at[200] < 0.0, "{} {}", at[138], at[200]);
}

#[test]
fn a_sensor_that_falls_silent_is_a_fault_of_its_channel() {
    let robot = robot(true);
    let model = learned(&robot);
    let drive = |_: f64| [0.4, 0.1];
    let sensors = [
        (0b111, Slot::POSE),
        (1 << 3, Slot::wheel_rate(0)),
        (1 << 4, Slot::wheel_rate(1)),
    ];
    for (bits, channel) in sensors {
        let silent = |from_s: f64, to_s: f64| {
            let mut run = run(1, 20.0, drive, drive);
            for frame in &mut run.frames {
                let t_s = frame.header.t_capture_ns as f64 * 1e-9;
                if (from_s..to_s).contains(&t_s) {
                    frame.channel_valid &= !bits;
                }
            }
            alarm(&model, &robot, &run)
        };
        let (found_s, found) = silent(10.0, 20.0).unwrap();
        assert!(
            (11.0..13.0).contains(&found_s),
            "{channel}: {found_s} s by {found}"
        );
        assert_eq!(found, channel);
        assert_eq!(silent(10.0, 10.8), None, "{channel}: a short pause");
    }
}
