//! The shipped model, and observations of a robot that drives as commanded.

use std::path::PathBuf;

use vigil_blocks::SensorFrame;
use vigil_robot::learned::{Model, ModelError, Observation, Observer};
use vigil_robot::{ChannelMap, Description};

fn read(name: &str) -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../config");
    std::fs::read_to_string(root.join(name)).unwrap()
}

pub fn robot() -> Description {
    toml::from_str(&read("robots/rover.toml")).unwrap()
}

pub fn model() -> Model {
    Model::from_toml(&read("models/rover.toml")).unwrap()
}

#[test]
fn the_shipped_model_is_read_and_written() {
    let model = model();
    model.check_robot(&robot()).unwrap();
    let text = model.to_toml().unwrap();
    let again = Model::from_toml(&text).unwrap();
    assert_eq!((&again, again.hash()), (&model, model.hash()));
    assert_eq!(model.clone().sealed(), model);
    let learned = &model.provenance;
    assert!(
        learned
            .runs_learned
            .iter()
            .all(|id| !learned.runs_held_out.contains(id))
    );
}

#[test]
fn broken_models_are_refused_by_key() {
    let text = read("models/rover.toml");
    let cases = [
        (
            "version = 4",
            "version = 2",
            "layout version 2; this program reads version 4: learn it again",
        ),
        (
            "interval_s = 0.05",
            "interval_s = nan",
            "interval_s: NaN is not allowed: 0.001 to 1",
        ),
        (
            "interval_s = 0.05",
            "interval_s = 50.0",
            "interval_s: 50 is not allowed: 0.001 to 1",
        ),
        (
            "fault_rate_1_h = 1.0",
            "fault_rate_1_h = -1.0",
            ".fault_rate_1_h: -1 is not allowed: 1e-12 to 1e6",
        ),
        (
            "interval_s = 0.05",
            "intervals = 0.05",
            "unknown field `intervals`",
        ),
        (
            "wheel = \"LF\"",
            "wheel = \"XX\"",
            "stuck.XX: XX is not allowed: a name listed in wheels",
        ),
        (
            "yaw_rad = 0.00",
            "yaw_rad = 0.01",
            "it was changed or cut short. Learn it again; if the change is meant, write hash = \
             \"edited\"",
        ),
    ];
    for (from, to, expected) in cases {
        let error = Model::from_toml(&text.replacen(from, to, 1)).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
    }
    let cut = &text[..text.rfind("[[calibration]]").unwrap()];
    assert!(matches!(
        Model::from_toml(cut),
        Err(ModelError::Hash { .. })
    ));
    let seal = format!("hash = \"{}\"", model().hash);
    let edited = Model::from_toml(&cut.replacen(&seal, "hash = \"edited\"", 1)).unwrap();
    assert!(edited.is_edited() && !model().is_edited());
    let calibrations = model().calibration.len();
    assert_eq!(edited.calibration.len(), calibrations - 1);
    let mut other = robot();
    other.name = "other".into();
    let error = model().check_robot(&other).unwrap_err();
    assert!(matches!(error, ModelError::Robot { .. }));
}

#[test]
fn compensation_makes_a_stuck_robot_drive_the_commanded_curvature() {
    let model = model();
    for wheel in 0..6 {
        let motion = &model.stuck(wheel).unwrap().motion;
        let (gain, offset) = model.compensation(wheel);
        for wanted in [-0.5, -0.35, -0.2, 0.0, 0.2, 0.35, 0.5] {
            let driven = |k: f64| motion.yaw.value(k, 0.2) / motion.forward.value(k, 0.2);
            let with = (driven(gain * wanted + offset) - wanted).abs();
            let without = (driven(wanted) - wanted).abs();
            assert!(
                with < 0.015 && with < 0.2 * without,
                "{wheel}: {wanted}: {with} {without}"
            );
            let is_exact = wanted.abs() == 0.35;
            assert!(!is_exact || with < 1e-8, "{wheel}: {wanted}: {with}");
        }
    }
    assert_eq!(model.compensation(99), (1.0, 0.0));
}

/// Frames of a robot on a circle of curvature .5 at .2 m/s, `rate_hz` times a second.
pub fn circle(rate_hz: f64, duration_s: f64) -> Vec<SensorFrame> {
    let (curvature, speed) = (0.5, 0.2);
    let map = ChannelMap::new(&robot());
    (0..=(duration_s * rate_hz) as u64)
        .map(|k| {
            let t_s = k as f64 / rate_hz;
            let yaw = curvature * speed * t_s;
            let mut frame = SensorFrame {
                run_id: 1,
                ..SensorFrame::default()
            };
            frame.header.t_capture_ns = (t_s * 1e9).round() as u64;
            frame.set_command(0, curvature);
            frame.set_command(1, speed);
            let pose = [yaw.sin() / curvature, (1.0 - yaw.cos()) / curvature, yaw];
            map.set_pose(&mut frame, pose);
            for wheel in 0..6 {
                map.set_wheel_rate(&mut frame, wheel, 2.0 + 1e-6 * k as f64);
            }
            frame
        })
        .collect()
}

pub fn observe(frames: &[SensorFrame]) -> Vec<Observation> {
    let mut observer = Observer::new(&model(), &robot());
    let complete = |frame| {
        observer
            .push(frame)
            .complete
            .then(|| *observer.observation())
    };
    frames.iter().filter_map(complete).collect()
}

#[test]
fn observations_are_the_same_at_every_rate() {
    for rate_hz in [20.0, 100.0, 1000.0] {
        let frames = circle(rate_hz, 4.0);
        let observations = observe(&frames);
        assert_eq!(observations.len(), 81, "{rate_hz} Hz");
        assert!(observations[0].anchor && observations[0].travel_m == 0.0);
        for two in observations[1..].windows(2) {
            let (before, now) = (&two[0], &two[1]);
            assert!((now.dt_s - 0.05).abs() < 1e-9 && (now.travel_m - 0.01).abs() < 1e-9);
            assert!((now.curvature - 0.5).abs() < 1e-9 && now.moving && !now.anchor);
            // The mean pose moves as far as the commanded travel from middle to middle.
            assert!((now.pose[2] - before.pose[2] - 0.005).abs() < 1e-9);
            let moved = (now.pose[0] - before.pose[0]).hypot(now.pose[1] - before.pose[1]);
            assert!((moved - 0.01).abs() < 1e-6);
            let frames = (rate_hz * 0.05).round();
            assert_eq!(f64::from(now.frames), frames);
            // Equal information per second: the mean's variance does not depend on the rate.
            let model = model();
            let sample = model.sample_variance(model.noise.position_m, now.frame_s);
            let sd = now.mean_variance(sample, now.pose_frames).sqrt();
            assert!((sd - model.noise.position_m).abs() < 1e-9);
            assert_eq!(now.wheels[0].plain, now.frames);
        }
    }
}

#[test]
fn frames_out_of_order_and_channels_out_of_range_are_told() {
    let frames = circle(100.0, 1.0);
    let mut observer = Observer::new(&model(), &robot());
    for frame in &frames {
        assert!(!observer.push(frame).invalid);
    }
    assert!(observer.push(&frames[99]).invalid);
    let next = |change: fn(&mut SensorFrame)| {
        let mut frame = frames[100];
        frame.header.t_capture_ns += 10_000_000;
        change(&mut frame);
        frame
    };
    let cases: [fn(&mut SensorFrame); 5] = [
        |frame| frame.channel[1] = f64::NAN,
        |frame| frame.channel[0] = 1e300,
        |frame| frame.channel[3 + 3] = f64::INFINITY,
        |frame| frame.command[1] = f64::NAN,
        |frame| frame.command_valid &= !1,
    ];
    for change in cases {
        assert!(observer.clone().push(&next(change)).invalid);
    }
    // A channel that the frame does not claim to hold is no error.
    assert!(
        !observer
            .push(&next(|frame| {
                frame.channel[1] = f64::NAN;
                frame.channel_valid &= !0b111;
            }))
            .invalid
    );
}

#[test]
fn a_jump_or_a_gap_anchors_the_pose_anew() {
    for jump in [false, true] {
        let mut frames = circle(100.0, 2.0);
        for frame in &mut frames[100..] {
            if jump {
                frame.pose_reset_count = 1;
            } else {
                frame.header.t_capture_ns += 3_000_000_000;
            }
        }
        let anchors = observe(&frames).iter().filter(|o| o.anchor).count();
        assert_eq!(anchors, 2);
    }
}
