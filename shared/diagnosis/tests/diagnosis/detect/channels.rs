//! The detector on a model of channels, learned from frames made from a Kobuki's geometry.

use std::path::PathBuf;
use vigil_diagnosis::detect;

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::{DetectionBelief, Entry, HealthyBelief, ParticleBlock, SensorFrame};
use vigil_cycle::allocation::allocations;
use vigil_diagnosis::detect::Detector;
use vigil_learning::channel_learning::{Log, learn};
use vigil_recording::frames::Run;
use vigil_robot::{Description, RobotModel};

const RADIUS_M: f64 = 0.035;
const TRACK_M: f64 = 0.23;
const RATE_HZ: f64 = 50.0;

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../config")
        .join(name)
}

fn kobuki() -> (RobotModel, Description) {
    let robot = vigil_setup::load_robot(&path("robots/kobuki.toml")).unwrap();
    let model = vigil_setup::load_model(&path("models/kobuki.toml"), Some(&robot)).unwrap();
    (model, robot)
}

/// A detector that has learned from 300 s of healthy driving.
fn detector() -> Detector {
    let (_, robot) = kobuki();
    let healthy = Run {
        id: 0,
        frames: (0..15_000).map(|i| frame(i, f64::INFINITY)).collect(),
    };
    let (model, _) = learn(&Log::of_healthy(&[healthy]), &robot).unwrap();
    Detector::of_channels(&model, &robot, &detect::Settings::default()).unwrap()
}

/// Driving about; from `stuck_s` on the left wheel stands and the robot turns about it.
fn frame(i: u64, stuck_s: f64) -> SensorFrame {
    let t_s = i as f64 / RATE_HZ;
    let stuck = t_s >= stuck_s;
    let mut frame = SensorFrame {
        run_id: 1,
        ..SensorFrame::default()
    };
    frame.header.t_capture_ns = (t_s * 1e9).round() as u64;
    frame.set_command(0, 0.25 + 0.1 * (0.5 * t_s).sin());
    frame.set_command(1, 0.5 * (0.37 * t_s).sin());
    let mut rng = Pcg64Mcg::seed_from_u64(i);
    let mut noise = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
    for (wheel, side) in [(0, -1.0), (1, 1.0)] {
        let stands = stuck && wheel == 0;
        let speed = frame.command[0] + side * 0.5 * TRACK_M * frame.command[1];
        let rate = if stands { 0.0 } else { speed / RADIUS_M };
        frame.set_channel(wheel, rate + noise(0.1));
        let current = if stands { 1.5 } else { 0.03 } + noise(0.005);
        frame.set_channel(3 + wheel, current);
    }
    let difference = frame.channel[1] - frame.channel[0];
    frame.set_channel(2, difference * RADIUS_M / TRACK_M + noise(0.02));
    frame
}

#[test]
fn a_stuck_wheel_alarms_within_a_second_and_nothing_is_allocated() {
    let mut detector = detector();
    let mut belief = DetectionBelief::default();
    let mut hypotheses: Box<ParticleBlock> = Box::default();
    let before = allocations();
    let mut alarm_s = None;
    for i in 0..1500 {
        detector.step(Entry::Frame(&frame(i, 20.0)), &mut belief, &mut hypotheses);
        detector.step(Entry::Missed(1), &mut belief, &mut hypotheses);
        if belief.alarm != 0 && alarm_s.is_none() {
            alarm_s = Some(i as f64 / RATE_HZ);
        }
    }
    detector.step(Entry::Reset, &mut belief, &mut hypotheses);
    assert_eq!(allocations() - before, 0);
    let alarm_s = alarm_s.unwrap();
    assert!((20.0..21.0).contains(&alarm_s), "{alarm_s}");
    // Without a pose: nominal or unknown, and nothing to start an identification from.
    assert_eq!(hypotheses.count, 2);
    assert_eq!(hypotheses.healthy, HealthyBelief::default());
    assert_eq!(hypotheses.hypotheses[1].pose_covariance, [0.0; 6]);
}

#[test]
fn equal_frames_give_equal_beliefs_also_after_a_reset() {
    let mut detector = detector();
    let mut hypotheses: Box<ParticleBlock> = Box::default();
    let mut run = |detector: &mut Detector| {
        let mut told = Vec::new();
        for i in 0..500 {
            let mut belief = DetectionBelief::default();
            detector.step(Entry::Frame(&frame(i, 8.0)), &mut belief, &mut hypotheses);
            told.push((belief.log_odds.to_bits(), belief.alarm));
        }
        told
    };
    let first = run(&mut detector);
    detector.step(
        Entry::Reset,
        &mut DetectionBelief::default(),
        &mut Box::default(),
    );
    assert_eq!(first, run(&mut detector));
    assert_eq!(first.last().unwrap().1, 1);
    assert_eq!(first[300].1, 0);
}

#[test]
fn a_model_of_another_robot_is_refused() {
    let (model, mut robot) = kobuki();
    robot.interval_s = 0.2;
    let message = model.check_robot(&robot).unwrap_err().to_string();
    assert!(
        message.contains("0.1 s") && message.contains("0.2 s"),
        "{message}"
    );
}

#[test]
fn a_constant_fault_keeps_its_alarm_for_ten_minutes_and_its_end_is_seen() {
    let mut detector = detector();
    let mut belief = DetectionBelief::default();
    let mut hypotheses: Box<ParticleBlock> = Box::default();
    // A gyro that is off by six deviations of an observation, then whole again.
    let (from_s, to_s, end_s) = (20.0, 620.0, 640.0);
    let (mut raised_s, mut fallen_s) = (None, None);
    for i in 0..(end_s * RATE_HZ) as u64 {
        let t_s = i as f64 / RATE_HZ;
        let mut frame = frame(i, f64::INFINITY);
        frame.channel[2] += match (from_s..to_s).contains(&t_s) {
            true => 0.055,
            false => 0.0,
        };
        detector.step(Entry::Frame(&frame), &mut belief, &mut hypotheses);
        match (raised_s, belief.alarm) {
            (None, 1) => raised_s = Some(t_s),
            (Some(_), 0) if fallen_s.is_none() => fallen_s = Some(t_s),
            _ => {}
        }
    }
    let raised_s = raised_s.unwrap();
    assert!((from_s..from_s + 3.0).contains(&raised_s), "{raised_s}");
    let fallen_s = fallen_s.unwrap();
    assert!((to_s..to_s + 10.0).contains(&fallen_s), "{fallen_s}");
    assert_eq!((belief.alarm, belief.alarm_count), (0, 1));
}
