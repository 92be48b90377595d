//! The detector on recorded runs that its model has not seen, and on garbage.

use proptest::prelude::*;
use vigil_blocks::{DetectionBelief, Entry, MODE_UNKNOWN, ParticleBlock, SensorFrame};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::detect;
use vigil_diagnosis::detect::Detector;
use vigil_robot::learned::channels::Channels;
use vigil_robot::learned::{Form, Healthy, Monitor, Observer, triangle};

use crate::recorded::{model, robot, unseen};

/// Capture time, s.
fn time_s(frame: &SensorFrame) -> f64 {
    frame.header.t_capture_ns as f64 * 1e-9
}

struct Bench {
    detector: Detector,
    belief: DetectionBelief,
    hypotheses: Box<ParticleBlock>,
}

impl Bench {
    fn new(sensors: Sensors) -> Self {
        let settings = detect::Settings {
            sensors,
            ..detect::Settings::default()
        };
        let detector = Detector::new(&model(), &robot(), &settings).unwrap();
        Self {
            detector,
            belief: DetectionBelief::default(),
            hypotheses: Box::default(),
        }
    }

    fn step(&mut self, frame: &SensorFrame) -> &DetectionBelief {
        self.detector
            .step(Entry::Frame(frame), &mut self.belief, &mut self.hypotheses);
        &self.belief
    }

    /// Time of the first alarm, s.
    fn alarm_s(&mut self, frames: &[SensorFrame]) -> Option<f64> {
        frames
            .iter()
            .find(|frame| self.step(frame).alarm != 0)
            .map(time_s)
    }
}

#[test]
fn nominal_driving_raises_no_alarm() {
    let (frames, _) = unseen("ND", "");
    for sensors in [Sensors::Pose, Sensors::PoseEncoders] {
        assert_eq!(Bench::new(sensors).alarm_s(&frames), None);
    }
}

#[test]
fn faults_are_seen_soon_after_their_onset() {
    let cases = [
        ("RM_STUCK", "stuck", Sensors::PoseEncoders, 0.15),
        ("LR_STUCK", "stuck", Sensors::Pose, 3.0),
        ("LF_ENC", "zero", Sensors::PoseEncoders, 0.15),
        ("LF_ENC", "frozen", Sensors::PoseEncoders, 0.35),
        ("LF_ENC", "noise", Sensors::PoseEncoders, 0.25),
    ];
    for (mode, kind, sensors, allowed_s) in cases {
        let (frames, label) = unseen(mode, kind);
        let delay_s = Bench::new(sensors).alarm_s(&frames).unwrap() - label.onset_s.unwrap();
        assert!(
            (0.0..allowed_s).contains(&delay_s),
            "{mode} {kind}: {delay_s} s"
        );
    }
}

#[test]
fn the_channel_at_fault_is_named() {
    let (frames, label) = unseen("RF_ENC", "zero");
    let mut bench = Bench::new(Sensors::PoseEncoders);
    bench.alarm_s(&frames).unwrap();
    let wheel = label.wheel.unwrap();
    let channels = bench.belief.channel_log_odds;
    let best = (0..channels.len()).max_by(|&a, &b| channels[a].total_cmp(&channels[b]));
    assert_eq!(best, Some(3 + wheel));
}

/// A nominal run in which the encoder of wheel 2 reports zero from 4 to 6 s.
fn dropout() -> Vec<SensorFrame> {
    let (mut frames, _) = unseen("ND", "");
    for frame in frames
        .iter_mut()
        .filter(|frame| (4.0..6.0).contains(&time_s(frame)))
    {
        frame.channel[3 + 2] = 0.0;
    }
    frames
}

#[test]
fn an_alarm_falls_when_the_robot_is_nominal_again() {
    let mut bench = Bench::new(Sensors::PoseEncoders);
    for frame in dropout() {
        let t_s = time_s(&frame);
        let alarm = bench.step(&frame).alarm != 0;
        if (4.2..6.0).contains(&t_s) || t_s >= 9.0 {
            assert_eq!(alarm, t_s < 6.0, "at {t_s} s");
        }
    }
    assert_eq!(bench.belief.alarm_count, 1);
}

#[test]
fn a_standing_robot_is_no_evidence() {
    let mut bench = Bench::new(Sensors::PoseEncoders);
    let mut last = 0.0;
    for mut frame in dropout() {
        let t_s = time_s(&frame);
        if t_s >= 5.0 {
            // It stops, and its encoders read what encoders at rest read.
            frame.command[1] = 0.0;
            frame.channel[3..9].fill(0.01);
        }
        let belief = bench.step(&frame);
        if t_s > 5.1 {
            assert!(belief.alarm != 0, "the alarm fell at {t_s} s");
            assert_eq!(belief.log_odds, last);
        }
        last = belief.log_odds;
    }
}

#[test]
fn a_jump_of_the_pose_frame_is_no_fault() {
    let (mut frames, _) = unseen("ND", "");
    for frame in frames.iter_mut().filter(|frame| time_s(frame) >= 7.0) {
        frame.channel[0] += 25.0;
        frame.pose_reset_count += 1;
    }
    assert_eq!(Bench::new(Sensors::PoseEncoders).alarm_s(&frames), None);
    // Without the count it is one.
    for frame in &mut frames {
        frame.pose_reset_count = 0;
    }
    let alarm_s = Bench::new(Sensors::PoseEncoders).alarm_s(&frames).unwrap();
    assert!((7.0..7.2).contains(&alarm_s), "{alarm_s}");
}

#[test]
fn misses_predict_and_change_nothing() {
    let (frames, _) = unseen("ND", "");
    let (mut with, mut without) = (
        Bench::new(Sensors::PoseEncoders),
        Bench::new(Sensors::PoseEncoders),
    );
    for frame in &frames {
        without.step(frame);
        with.step(frame);
        let p_fault = with.belief.p_fault;
        with.detector
            .step(Entry::Missed(50), &mut with.belief, &mut with.hypotheses);
        assert!(with.belief.p_fault > p_fault && with.belief.p_fault < p_fault + 0.01);
    }
    with.step(frames.last().unwrap());
    without.step(frames.last().unwrap());
    assert_eq!(
        with.belief.log_odds.to_bits(),
        without.belief.log_odds.to_bits()
    );
}

#[test]
fn equal_input_and_seed_give_equal_bits_and_a_new_run_starts_anew() {
    let (frames, _) = unseen("RM_STUCK", "stuck");
    let mut bench = Bench::new(Sensors::PoseEncoders);
    let mut first = Vec::new();
    for frame in &frames {
        first.push(*bench.step(frame));
    }
    for (frame, before) in frames.iter().zip(first) {
        let mut frame = *frame;
        frame.run_id += 1000;
        let belief = bench.step(&frame);
        assert_eq!(belief.log_odds.to_bits(), before.log_odds.to_bits());
        assert_eq!(belief.alarm, before.alarm);
    }
}

#[test]
fn an_identification_starts_from_what_the_detector_believes_bit_for_bit() {
    let (frames, _) = unseen("ND", "");
    let (model, robot) = (model(), robot());
    let rate_1_h = detect::Settings::default().fault_rate_1_h;
    let channels = Channels::PoseEncoders;
    let mut monitor = Monitor::new(&model, &robot, channels, Form::LearnedBias, rate_1_h);
    let mut observer = Observer::new(&model, &robot);
    let mut bench = Bench::new(Sensors::PoseEncoders);
    let mut compared = 0;
    for frame in &frames {
        let belief = *bench.step(frame);
        if observer.push(frame).complete {
            observer.suspect(false);
            monitor.step(observer.observation(), observer.further(), false);
        }
        let block = &bench.hypotheses;
        let wheels = Healthy::unsure(&model, &robot).wheels;
        let read = Healthy::from_block(&block.healthy, wheels);
        // Bit for bit, but for what rounding sets apart within a symmetric covariance.
        let part = |healthy: Healthy| healthy.to_block();
        assert_eq!(read.map(part), monitor.healthy().map(part));
        assert_eq!(belief.alarm, 0);
        let [nominal, unknown] = block.used() else {
            panic!("{} hypotheses", block.count);
        };
        assert_eq!((nominal.mode, unknown.mode), (0, MODE_UNKNOWN));
        assert!((unknown.log_weight.exp() - belief.p_fault).abs() < 1e-12);
        assert!((nominal.log_weight.exp() + unknown.log_weight.exp() - 1.0).abs() < 1e-12);
        if let Some(healthy) = monitor.healthy() {
            assert_eq!(nominal.pose, <[f64; 3]>::from(healthy.pose));
            assert_eq!(nominal.pose_covariance, triangle(&healthy.covariance));
            compared += 1;
        }
    }
    assert!(compared > 200, "{compared}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn frames_that_are_lost_are_no_evidence_of_a_fault(
        lost in prop::collection::vec(prop::bool::weighted(0.2), 400),
        gap_at in 20_usize..250, gap in 0_usize..18,
        sensors in prop::sample::select(vec![Sensors::Pose, Sensors::PoseEncoders]),
    ) {
        let (frames, _) = unseen("ND", "");
        let is_kept = |k: usize| !lost[k % lost.len()] && !(gap_at..gap_at + gap).contains(&k);
        let kept: Vec<SensorFrame> = (0..frames.len())
            .filter(|&k| is_kept(k))
            .map(|k| frames[k])
            .collect();
        prop_assert_eq!(Bench::new(sensors).alarm_s(&kept), None);
    }
}
