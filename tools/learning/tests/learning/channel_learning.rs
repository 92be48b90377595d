//! A model of the channels of a synthetic robot: what it finds, refuses, and then detects.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_learning::channel_learning::{Log, LogError, learn};
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::{Model, Monitor, Observer, components};
use vigil_robot::learned::Form;
use vigil_robot::learned::channels::Channels;

use super::small::small;

const TRACK_M: f64 = 0.2;
const RADIUS_M: f64 = 0.1;
const NOISE_RAD_S: f64 = 0.05;
const RATE_HZ: f64 = 50.0;

fn robot() -> Description {
    small(
        "measured = { pose = false, wheel_rates = true, steer = false, yaw_rate = true }\n\
         polynomial_order = 2",
    )
}

/// What is wrong with the gyro from a time on.
#[derive(Clone, Copy)]
enum Fault {
    None,
    Bias(f64, f64),
    Scatter(f64, f64),
}

/// A run; `drive` gives speed and yaw rate commanded at a time.
fn run(id: u32, length_s: f64, drive: impl Fn(f64) -> [f64; 2], fault: Fault) -> Run {
    let mut rng = Pcg64Mcg::seed_from_u64(u64::from(id));
    let mut noise = || NOISE_RAD_S * rng.sample::<f64, _>(StandardNormal);
    let mut frames = Vec::new();
    for i in 0..(length_s * RATE_HZ) as u64 {
        let t = i as f64 / RATE_HZ;
        let [v, w] = drive(t);
        let mut frame = SensorFrame::default();
        frame.header.t_capture_ns = (t * 1e9) as u64;
        (frame.header.seq, frame.run_id) = (i, u64::from(id) + 1);
        frame.set_command(0, v);
        frame.set_command(1, w);
        frame.set_channel(0, (v - 0.5 * TRACK_M * w) / RADIUS_M + noise());
        frame.set_channel(1, (v + 0.5 * TRACK_M * w) / RADIUS_M + noise());
        let wrong = match fault {
            Fault::Bias(from_s, size) if t >= from_s => size,
            Fault::Scatter(from_s, size) if t >= from_s => size * noise() / NOISE_RAD_S,
            _ => 0.0,
        };
        frame.set_channel(2, w + noise() + wrong);
        frames.push(frame);
    }
    Run { id, frames }
}

fn weave(t: f64) -> [f64; 2] {
    [0.5 + 0.3 * (0.5 * t).sin(), 0.8 * (0.37 * t).sin()]
}

fn model(length_s: f64) -> (Model, Vec<String>) {
    let runs = [run(0, length_s, weave, Fault::None)];
    let (model, report) = learn(&Log::of_healthy(&runs), &robot()).unwrap();
    (model, report.warnings)
}

/// First time at which the log-odds reach the alarm for 24 h between false alarms, s.
fn alarm(model: &Model, run: &Run) -> Option<f64> {
    alarm_of(model, &robot(), run)
}

fn alarm_of(model: &Model, robot: &Description, run: &Run) -> Option<f64> {
    first_alarm(model, robot, run).map(|(t_s, _)| t_s)
}

/// The same with the component that is most probably broken.
fn first_alarm(model: &Model, robot: &Description, run: &Run) -> Option<(f64, String)> {
    let calibration = model.calibration(Channels::PoseEncoders, Form::LearnedBias);
    let threshold = calibration.unwrap().alarm_log_odds(24.0, 1.0);
    let mut monitor = Monitor::new(model, robot, Channels::PoseEncoders, 1.0).unwrap();
    let mut observer = Observer::new(robot);
    for frame in &run.frames {
        if observer.push(frame).complete {
            monitor.step(observer.history(), observer.orders());
            if monitor.is_ready() && monitor.report().log_odds > threshold {
                let parts = components(robot);
                let beliefs = monitor.beliefs().iter().zip(&parts);
                let best = beliefs.max_by(|a, b| a.0.p.total_cmp(&b.0.p)).unwrap();
                let t_s = frame.header.t_capture_ns as f64 * 1e-9;
                return Some((t_s, best.1.name.clone()));
            }
        }
    }
    None
}

#[test]
fn residuals_reach_the_sensors_noise_and_weights_the_geometry() {
    let (model, warnings) = model(700.0);
    assert!(
        !warnings.iter().any(|w| w.contains("widened")),
        "{warnings:?}"
    );
    assert!((model.widened - 1.0).abs() < 1e-12);
    for (channel, noise) in model.channel.iter().zip([NOISE_RAD_S; 3]) {
        // Five frames an observation.
        let (found, expected) = (channel.variance[0].sqrt(), noise / 5_f64.sqrt());
        assert!(
            found < 1.1 * expected && found > 0.8 * expected,
            "{}: {found} {expected}",
            channel.name
        );
        let ratio = channel.held_out_ratio;
        assert!((ratio - 1.0).abs() < 0.1, "{}: {ratio}", channel.name);
    }
    let names: Vec<&str> = model.channel.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["enc_L", "enc_R", "yaw_rate"]);
    let text = model.to_toml().unwrap();
    assert_eq!(Model::from_toml(&text).unwrap(), model);
}

#[test]
fn a_short_log_warns_and_widens_by_what_it_says() {
    let (short, warnings) = model(60.0);
    assert!(short.widened > 1.03, "{}", short.widened);
    let told = format!("{:.2}", short.widened);
    assert!(
        warnings
            .iter()
            .any(|w| w.contains(&told) && w.contains("600 s")),
        "{warnings:?}"
    );
}

#[test]
fn bias_and_scatter_are_found_and_healthy_driving_is_not() {
    let (model, _) = model(700.0);
    let faults = [Fault::Bias(20.0, 0.08), Fault::Scatter(20.0, 0.2)];
    for (i, fault) in faults.into_iter().enumerate() {
        let found = alarm(&model, &run(10 + i as u32, 40.0, weave, fault));
        let found = found.unwrap_or_else(|| panic!("fault {i}"));
        // Noise fills the window of four seconds first.
        assert!((20.0..27.0).contains(&found), "fault {i}: {found} s");
    }
    for id in 20..26 {
        assert_eq!(
            alarm(&model, &run(id, 120.0, weave, Fault::None)),
            None,
            "run {id}"
        );
    }
}

#[test]
fn a_log_that_lacks_what_a_model_needs_is_refused_by_name() {
    let refused = |drive: &dyn Fn(f64) -> [f64; 2]| {
        learn(
            &Log::of_healthy(&[run(0, 100.0, drive, Fault::None)]),
            &robot(),
        )
        .unwrap_err()
    };
    let straight = refused(&|t| [0.5 + 0.3 * t.sin(), 0.0]);
    assert!(
        matches!(&straight, LogError::Unexcited { axis, .. } if axis == "w"),
        "{straight}"
    );
    let coupled = refused(&|t| [0.4 + 0.3 * t.sin(), 0.8 + 0.6 * t.sin()]);
    assert!(matches!(coupled, LogError::Together { .. }), "{coupled}");
    let rare = refused(&|t| [0.5 + 0.3 * t.sin(), if t < 0.6 { 0.8 } else { 0.0 }]);
    assert!(
        matches!(&rare, LogError::Follows { axis } if axis == "w"),
        "{rare}"
    );
    let still = refused(&|_| [0.0, 0.0]);
    assert!(matches!(still, LogError::Still { .. }), "{still}");
    assert_eq!(
        learn(&Log::of_healthy(&[]), &robot()),
        Err(LogError::NoRuns)
    );
}

/// Two speeds, three yaw rates, each kept up for some seconds.
fn two_speeds(t: f64) -> [f64; 2] {
    let step = (t / 3.7) as u64 * 7919 % 101;
    [
        [0.2, 0.5][(step % 2) as usize],
        [-0.6, 0.0, 0.6][(step % 3) as usize],
    ]
}

#[test]
fn speeds_between_those_of_the_log_are_no_fault_and_what_it_does_not_tell_is_said() {
    // A drive that takes a few frames to follow: a fit may explain its steps by a curve.
    let lagged = |id: u32, drive: &dyn Fn(f64) -> [f64; 2], length_s: f64| {
        let mut run = run(id, length_s, drive, Fault::None);
        let mut state = [run.frames[0].channel[0], run.frames[0].channel[1]];
        for frame in &mut run.frames {
            let commanded = [
                (frame.command[0] - 0.5 * TRACK_M * frame.command[1]) / RADIUS_M,
                (frame.command[0] + 0.5 * TRACK_M * frame.command[1]) / RADIUS_M,
            ];
            for (i, state) in state.iter_mut().enumerate() {
                *state += 0.15 * (commanded[i] - *state);
                frame.channel[i] += *state - commanded[i];
            }
            frame.channel[2] += (state[1] - state[0]) * RADIUS_M / TRACK_M - frame.command[1];
        }
        run
    };
    let log = [lagged(0, &two_speeds, 700.0)];
    let (model, report) = learn(&Log::of_healthy(&log), &robot()).unwrap();
    assert_eq!(model.command[0].gaps, [[0.2, 0.5]]);
    let told = |text: &str| report.warnings.iter().any(|w| w.contains(text));
    assert!(
        told("without v^2: ") && told("v was not driven between 0.200 and 0.500 m/s"),
        "{:?}",
        report.warnings
    );
    for id in 0..15 {
        let speed = 0.25 + 0.05 * f64::from(id % 5);
        let healthy = lagged(30 + id, &|t: f64| [speed, two_speeds(t)[1]], 25.0);
        assert_eq!(alarm(&model, &healthy), None, "{speed} m/s");
    }
    // Noise is widened there, but a fault is still seen.
    let mut stuck = lagged(50, &|t: f64| [0.35, two_speeds(t)[1]], 25.0);
    for frame in stuck.frames.iter_mut().skip(500) {
        frame.channel[0] = 0.0;
    }
    let found_s = alarm(&model, &stuck).unwrap();
    assert!((10.0..11.0).contains(&found_s), "{found_s}");
}

/// Straight ahead, then turning on the spot, by turns.
fn straight_or_turning(t: f64) -> [f64; 2] {
    match (t / 6.0) as u64 % 2 {
        0 => [0.5 + 0.3 * (0.9 * t).sin(), 0.0],
        _ => [0.0, 0.8 * (0.7 * t).sin()],
    }
}

#[test]
fn a_combination_of_commands_that_the_log_lacks_is_no_fault() {
    // Wheels that slip in curves: a product of both axes that the log does not tell.
    let slipping = |id: u32, drive: &dyn Fn(f64) -> [f64; 2], length_s: f64| {
        let mut run = run(id, length_s, drive, Fault::None);
        for frame in &mut run.frames {
            let product = frame.command[0] * frame.command[1];
            frame.channel[2] -= 0.6 * product;
        }
        run
    };
    let log = [slipping(0, &straight_or_turning, 700.0)];
    let (model, report) = learn(&Log::of_healthy(&log), &robot()).unwrap();
    let told = report.warnings.iter().any(|w| w.contains("without v*w: "));
    assert!(told, "{:?}", report.warnings);
    for id in 0..6 {
        let known = slipping(60 + id, &straight_or_turning, 60.0);
        assert_eq!(alarm(&model, &known), None, "as in the log");
        let curve = slipping(70 + id, &|t: f64| [0.6, 0.7 * (0.4 * t).sin()], 60.0);
        assert_eq!(alarm(&model, &curve), None, "a curve");
    }
}

/// A car: no kinematics of ours, a speed and a steering angle commanded, two channels.
fn car() -> Description {
    toml::from_str(
        r#"
name = "car"
kinematics = "none"
command = [
  { name = "cmd_speed", unit = "m/s", limit = 5.0 },
  { name = "cmd_steer", unit = "rad", limit = 0.5 },
]
measured = { pose = false, wheel_rates = false, steer = false, yaw_rate = true, currents = false }
channel = [{ name = "speed", role = "other", unit = "m/s", limit = 6.0 }]
polynomial_order = 3
"#,
    )
    .unwrap()
}

#[test]
fn a_robot_without_a_geometry_is_learned_and_its_faults_are_named() {
    let robot = car();
    assert!(robot.is_told_to_move(&[1.0, 0.0]) && !robot.is_told_to_move(&[0.0, 0.4]));
    let drive = |id: u32, length_s: f64, bias_from_s: f64| {
        let command = |t: f64| [2.0 + 1.5 * (0.31 * t).sin(), 0.3 * (0.47 * t).sin()];
        let mut run = run(id, length_s, command, Fault::Bias(bias_from_s, 0.15));
        for frame in &mut run.frames {
            let [v, steer] = [frame.command[0], frame.command[1]];
            // Frames of the car: its gyro, then the speed.
            let noise = frame.channel[2] - steer;
            frame.channel[0] = v * steer.tan() / 1.2 + noise;
            frame.channel[1] = v + 0.1 * (frame.channel[1] - v);
            frame.channel_valid = 0b11;
        }
        run
    };
    let (model, _) = learn(&Log::of_healthy(&[drive(0, 700.0, 1e9)]), &robot).unwrap();
    let names: Vec<&str> = model.channel.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["yaw_rate", "speed"]);
    assert_eq!(first_alarm(&model, &robot, &drive(1, 120.0, 1e9)), None);
    let (t_s, name) = first_alarm(&model, &robot, &drive(2, 60.0, 20.0)).unwrap();
    assert!(
        (20.0..23.0).contains(&t_s) && name == "yaw_rate",
        "{t_s} s: {name}"
    );
}

#[test]
fn what_is_slow_in_one_axis_is_predicted_through_the_other() {
    // A heavy car: its speed follows within two seconds, its steering at once.
    let slow = |id: u32, bias_from_s: f64| {
        let command = |t: f64| {
            let step = (t / 4.0) as usize % 5;
            [[0.0, 3.0, 1.0, 2.0, 0.5][step], 0.3 * (0.47 * t).sin()]
        };
        let mut run = run(id, 120.0, command, Fault::Bias(bias_from_s, 0.2));
        let mut speed = 0.0;
        for frame in &mut run.frames {
            let [v, steer] = [frame.command[0], frame.command[1]];
            let noise = frame.channel[2] - steer;
            speed += (v - speed) / (2.0 * RATE_HZ);
            frame.channel[0] = speed * steer.tan() / 1.2 + noise;
            frame.channel[1] = speed + noise;
            frame.channel_valid = 0b11;
        }
        run
    };
    let runs: Vec<Run> = (0..6).map(|id| slow(id, 1e9)).collect();
    let (model, report) = learn(&Log::of_healthy(&runs), &car()).unwrap();
    let told = |text: &str| report.warnings.iter().any(|w| w.contains(text));
    assert!(
        model.knows_rest() && !told("at rest"),
        "{:?}",
        report.warnings
    );
    assert_eq!(alarm_of(&model, &car(), &slow(6, 1e9)), None);
    let found_s = alarm_of(&model, &car(), &slow(7, 60.0)).unwrap();
    assert!((60.0..63.0).contains(&found_s), "{found_s} s");
}

#[test]
fn a_rest_that_the_log_lacks_says_nothing() {
    let (model, warnings) = model(200.0);
    let told = warnings.iter().any(|w| w.contains("0 s at rest"));
    assert!(!model.knows_rest() && told, "{warnings:?}");
    let stopping = |t: f64| if t < 20.0 { weave(t) } else { [0.0, 0.0] };
    let mut parked = run(80, 60.0, stopping, Fault::None);
    for frame in parked.frames.iter_mut().skip(1500) {
        // As if the wheels were turned by hand.
        frame.channel[0] += 0.05;
    }
    assert_eq!(alarm(&model, &parked), None);
}

#[test]
fn columns_that_mean_something_else_are_refused_in_the_words_of_the_description() {
    let refused = |change: &dyn Fn(&mut SensorFrame)| {
        let mut run = run(3, 60.0, weave, Fault::None);
        run.frames.iter_mut().for_each(change);
        let refused = learn(&Log::of_healthy(&[run]), &robot()).unwrap_err();
        assert!(matches!(refused, LogError::Doubtful(_)), "{refused}");
        refused.to_string()
    };
    let message = refused(&|frame| frame.channel[2] = frame.channel[2].to_degrees());
    assert!(
        message.ends_with("commanded one: is it in deg/s?"),
        "{message}"
    );
    let message = refused(&|frame| frame.channel[2] *= -1.0);
    assert!(
        message.contains(
            "yaw_rate is -1.00 times the commanded one: is it or w positive to the right?"
        ),
        "{message}"
    );
    let message = refused(&|frame| frame.channel.swap(0, 1));
    assert!(
        message.contains("enc_L and enc_R fit when exchanged; or is w positive to the right?"),
        "{message}"
    );
    let message = refused(&|frame| frame.command[0] *= 1000.0);
    assert!(
        message.ends_with("; allowed is 1 m/s: is it in mm/s?"),
        "{message}"
    );
    let message = refused(&|frame| frame.command[1] = frame.command[1].to_degrees());
    assert!(
        message.ends_with("allowed is 2 rad/s: is it in deg/s or mrad/s?"),
        "{message}"
    );
    let message = refused(&|frame| frame.channel[1] = 3.0);
    assert!(message.contains("enc_R is 3 throughout"), "{message}");
}

#[test]
fn one_doubtful_run_among_many_is_told_and_learned_from() {
    let mut runs: Vec<Run> = (0..5).map(|id| run(id, 60.0, weave, Fault::None)).collect();
    runs[2]
        .frames
        .iter_mut()
        .for_each(|frame| frame.channel[2] *= -1.0);
    let (_, report) = learn(&Log::of_healthy(&runs), &robot()).unwrap();
    let told = |w: &String| {
        w.starts_with("1 of 5 runs are doubtful") && w.contains("run 2: signs: yaw_rate")
    };
    assert!(report.warnings.iter().any(told), "{:?}", report.warnings);
}
