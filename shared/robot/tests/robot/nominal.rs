//! A nominal model's file and what its detection filter says.

use std::path::PathBuf;

use nalgebra::SVector;
use vigil_blocks::SensorFrame;
use vigil_inference::ages::Ages;
use vigil_inference::constant::Constant;
use vigil_inference::logspace::log_add;
use vigil_robot::Description;
use vigil_robot::learned::Form;
use vigil_robot::learned::channels::Channels;
use vigil_robot::nominal::{Channel, Model, Monitor, Observer, Quantity, ResidualWhitener};

fn config(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../config");
    std::fs::read_to_string(path.join(name)).unwrap()
}

fn shipped() -> String {
    config("models/kobuki.toml")
}

/// The shipped model, changed on purpose.
fn edited(from: &str, to: &str) -> String {
    let text = shipped();
    let stored = text
        .lines()
        .find(|line| line.starts_with("hash = "))
        .unwrap();
    let changed = text
        .replacen(stored, "hash = \"edited\"", 1)
        .replacen(from, to, 1);
    assert!(changed.contains(to), "{from}");
    changed
}

#[test]
fn a_file_that_was_changed_by_accident_is_refused() {
    let model = Model::from_toml(&shipped()).unwrap();
    assert_eq!(model.to_toml().unwrap(), shipped());
    assert!(!model.is_edited());
    let changed = shipped().replacen("exposure_s = 30", "exposure_s = 31", 1);
    let message = Model::from_toml(&changed).unwrap_err().to_string();
    assert!(
        message.contains("changed or cut short") && message.contains(&model.hash),
        "{message}"
    );
    let edited = Model::from_toml(&edited("exposure_s = 30", "exposure_s = 31")).unwrap();
    assert!(edited.is_edited() && edited.hash() != model.hash());
    let old = shipped().replacen("version = 2", "version = 1", 1);
    let message = Model::from_toml(&old).unwrap_err().to_string();
    assert!(
        message.contains("layout version 1; this program reads version 2"),
        "{message}"
    );
    let cut = &shipped()[..shipped().len() / 2];
    assert!(Model::from_toml(cut).is_err());
}

#[test]
fn an_interval_out_of_range_is_refused_with_what_is_allowed() {
    for (interval, found) in [
        ("5.0", "5"),
        ("0.01", "0.01"),
        ("inf", "inf"),
        ("nan", "NaN"),
    ] {
        let changed = edited("interval_s = 0.1", &format!("interval_s = {interval}"));
        let message = Model::from_toml(&changed).unwrap_err().to_string();
        let wanted = format!("interval_s: {found} is not allowed: 0.02 to 1");
        assert_eq!(message, wanted);
    }
}

#[test]
fn terms_that_point_at_nothing_are_refused_by_name() {
    for (from, to, key) in [
        ("lag = 1", "lag = 4", "channel.0.terms.2.lag: 4"),
        (
            "lag = 1",
            "lag = 9223372036854775807",
            "channel.0.terms.2.lag: 9223372036854775807",
        ),
        (
            "of = \"wheel\"",
            "of = \"wheel\"\nindex = 2",
            "channel.0.terms.1.index: 2",
        ),
        (
            "of = \"lagged\"",
            "of = \"lagged\"\nindex = 2",
            "channel.1.terms.6.index: 2",
        ),
        (
            "powers = [0, 1, 0, 0]",
            "powers = [0, 0, 1, 0]",
            "channel.1.terms.1.powers",
        ),
        (
            "powers = [0, 1, 0, 0]",
            "powers = [9, 0, 0, 0]",
            "channel.1.terms.1.powers",
        ),
        ("wheel = 0", "wheel = 2", "channel.0.target.wheel: 2"),
    ] {
        let message = Model::from_toml(&edited(from, to)).unwrap_err().to_string();
        assert!(message.starts_with(key), "{to}: {message}");
    }
    assert!(Model::from_toml(&edited("lag = 1", "lag = 3")).is_ok());
}

/// The shipped model with its gyro alone.
fn gyro() -> (Model, Description) {
    let mut model = Model::from_toml(&shipped()).unwrap();
    model
        .channel
        .retain(|channel| channel.target.quantity == Quantity::YawRate);
    assert_eq!(model.channel.len(), 1);
    (
        model,
        toml::from_str(&config("robots/kobuki.toml")).unwrap(),
    )
}

/// Healthy driving for 20 s, then a gyro that is a little off.
fn frames() -> Vec<SensorFrame> {
    let frame = |i: u32| {
        let t_s = f64::from(i) * 0.02;
        let mut frame = SensorFrame {
            run_id: 1,
            ..SensorFrame::default()
        };
        frame.header.t_capture_ns = u64::from(i) * 20_000_000;
        frame.set_command(0, 0.3);
        frame.set_command(1, -0.3 + 0.1 * (0.4 * t_s).sin());
        let side = 0.115 * frame.command[1] / 0.035;
        frame.set_channel(0, 8.6 - side);
        frame.set_channel(1, 8.6 + side);
        let noise = 0.02 * (f64::from(i * 7919 % 1000) / 500.0 - 1.0);
        // The geometry as the model has learned it.
        let [left, right, ..] = frame.channel;
        let turn = -0.0038 - 0.14654 * left + 0.14707 * right;
        let wrong = if t_s < 20.0 { 0.0 } else { 0.02 };
        frame.set_channel(2, turn + noise + wrong);
        frame
    };
    (0..1500).map(frame).collect()
}

/// Log-odds after each observation of motion that counts.
fn log_odds(model: &Model, robot: &Description, rate_1_h: f64) -> Vec<f64> {
    let mut monitor = Monitor::new(model, Channels::PoseEncoders, Form::LearnedBias, rate_1_h);
    let mut observer = Observer::new(robot);
    let mut out = Vec::new();
    for frame in &frames() {
        if observer.push(frame).complete {
            monitor.step(observer.history(), false);
            out.push(monitor.report().log_odds);
        }
    }
    out
}

/// Learned bias and scatter at a prior fault rate itself: births at that rate, no shift at the end.
fn directly(channel: &Channel, model: &Model, robot: &Description, rate_1_h: f64) -> Vec<f64> {
    let (mut ages, mut track) = (Ages::<1>::new(3.0), ResidualWhitener::new(channel));
    let mut scatter = Constant::default();
    let mut observer = Observer::new(robot);
    let mut out = Vec::new();
    for frame in &frames() {
        if !observer.push(frame).complete {
            continue;
        }
        let now = observer.history().ago(0).unwrap();
        match channel.residual(observer.history(), &model.sizes()) {
            Some(residual) if now.moving_s >= 0.5 => {
                let (apart, spread) = track.step(channel, residual.apart, residual.variance, false);
                let whitened = (apart / spread.sqrt()).clamp(-6.0, 6.0);
                let birth = rate_1_h / 3600.0 * now.dt_s;
                ages.step(&SVector::from([whitened]), birth);
                scatter.step(whitened * whitened / channel.scatter, 1.6, birth, birth);
            }
            _ => track.interrupt(),
        }
        out.push(log_add(ages.log_odds(), scatter.log_odds()));
    }
    out
}

#[test]
fn another_prior_rate_adds_its_logarithm_to_tempered_log_odds_as_a_direct_computation_does() {
    let (mut model, robot) = gyro();
    // The filter of scatter never leaves its floor, far from where its deaths would matter.
    model.channel[0].scatter = 1e6;
    let tail = model.channel[0].tail(Form::LearnedBias).unwrap().clone();
    assert!(
        (tail.slope - 0.5).abs() < 0.2,
        "tempering shows with a slope that is not 1"
    );
    let channel = model.channel[0].clone();
    let at_one = log_odds(&model, &robot, 1.0);
    for rate_1_h in [1e-3, 0.1, 10.0] {
        let shift = f64::ln(rate_1_h);
        let found = log_odds(&model, &robot, rate_1_h);
        let raw = directly(&channel, &model, &robot, rate_1_h);
        let (mut compared, mut highest) = (0, f64::NEG_INFINITY);
        for ((found, one), raw) in found.iter().zip(&at_one).zip(raw).skip(20) {
            // At its bound the filter no longer knows the prior.
            if raw > 600.0 {
                continue;
            }
            assert!((found - one - shift).abs() < 1e-9);
            // A channel without flaw, whose log-odds at the rate are `raw`, is as rare as these at
            // one fault an hour are: ln interval + slope (raw - shift - level); the prior comes on
            // top.
            let rarity = tail.interval_h.ln() + tail.slope * (raw - shift - tail.level_log_odds);
            assert!(
                (found - (rarity + shift)).abs() < 0.02,
                "{rate_1_h}: {found}, {raw}"
            );
            (compared, highest) = (compared + 1, f64::max(highest, raw));
        }
        assert!(compared > 200 && highest > 30.0, "{compared}, {highest}");
    }
}

#[test]
fn alarms_do_not_depend_on_the_prior_rate_as_the_threshold_moves_with_it() {
    let (model, robot) = gyro();
    let alarm = |rate_1_h: f64| {
        let of = (Channels::PoseEncoders, Form::LearnedBias);
        let threshold = model.alarm_log_odds(of, 24.0, rate_1_h).unwrap();
        assert!(threshold > 0.0);
        log_odds(&model, &robot, rate_1_h)
            .iter()
            .position(|&now| now > threshold)
    };
    let at_one = alarm(1.0).unwrap();
    assert!((200..240).contains(&at_one), "{at_one}");
    for rate_1_h in [0.01, 0.1, 10.0, 1000.0] {
        assert_eq!(alarm(rate_1_h), Some(at_one), "{rate_1_h}");
    }
}

#[test]
fn an_alarm_above_the_tempered_bound_of_a_form_is_refused_with_the_bound() {
    let model = Model::from_toml(&shipped()).unwrap();
    let of = (Channels::PoseEncoders, Form::Windowed);
    let highest = |rate_1_h| model.log_odds_max(of.0, of.1, rate_1_h);
    let bound = -1e-9_f64.ln();
    let tempered = model.channel.iter().map(|channel| {
        let tail = channel.tail(Form::Windowed).unwrap();
        tail.interval_h.ln() + tail.slope * (bound - tail.level_log_odds)
    });
    let by_hand = tempered.fold(f64::NEG_INFINITY, f64::max);
    assert!((highest(1.0) - by_hand).abs() < 1e-9);
    assert!((highest(10.0) - by_hand - 10.0_f64.ln()).abs() < 1e-9);
    let message = model.alarm_log_odds(of, 24.0, 1.0).unwrap_err().to_string();
    assert!(
        message.contains(&format!("reach {by_hand:.2} at the highest")),
        "{message}"
    );
    // What the message names as the longest interval is just reached.
    let calibration = model.calibration(of.0, of.1).unwrap();
    let longest_h = calibration.interval_h(by_hand, 1.0);
    assert!(
        message.contains(&format!("at most {longest_h:.4}")),
        "{message}"
    );
    for rate_1_h in [0.1, 1.0, 10.0] {
        assert!(
            model
                .alarm_log_odds(of, 0.999 * longest_h, rate_1_h)
                .is_ok()
        );
        assert!(
            model
                .alarm_log_odds(of, 1.001 * longest_h, rate_1_h)
                .is_err()
        );
    }
}

/// After each observation of [`frames`]: log-odds as reported, and those of all channels together.
fn with_joint(model: &Model, robot: &Description, rate_1_h: f64) -> Vec<(f64, f64)> {
    let channels = Channels::PoseEncoders;
    let mut monitor = Monitor::new(model, channels, Form::LearnedBias, rate_1_h);
    let mut observer = Observer::new(robot);
    let mut out = Vec::new();
    for mut frame in frames() {
        for wheel in 0..2 {
            frame.set_channel(3 + wheel, 0.05);
        }
        if observer.push(&frame).complete {
            monitor.step(observer.history(), false);
            let joint = monitor.joint_log_odds().unwrap();
            out.push((monitor.report().log_odds, joint));
        }
    }
    monitor.forget_evidence();
    assert!(monitor.joint_log_odds().unwrap() <= -700.0);
    out
}

#[test]
fn all_channels_together_add_to_what_each_says() {
    let robot: Description = toml::from_str(&config("robots/kobuki.toml")).unwrap();
    let mut with = Model::from_toml(&shipped()).unwrap();
    assert_eq!(with.joint.len(), 1);
    let mut without = with.clone();
    without.joint.clear();
    // A tail by which the joint log-odds weigh more than those of each channel.
    let tail = &mut with.joint[0].tail;
    (tail.level_log_odds, tail.interval_h, tail.slope) = (-2.0, 3.0, 0.9);
    let tail = tail.clone();
    let rate_1_h = 2.0_f64;
    let (together, each) = (
        with_joint(&with, &robot, rate_1_h),
        with_joint(&without, &robot, rate_1_h),
    );
    assert_eq!(together.len(), each.len());
    let mut most = 0.0_f64;
    for (&(all, joint), &(alone, same)) in together.iter().zip(&each) {
        assert_eq!(joint, same);
        let expected = log_add(alone, tail.tempered(joint) + rate_1_h.ln());
        assert!(
            (all - expected.max(-700.0)).abs() < 1e-9,
            "{all} {expected}"
        );
        most = most.max(all - alone);
    }
    assert!(most > 1.0, "{most}");
}

#[test]
fn a_joint_tail_without_sense_is_refused_by_name() {
    let mut model = Model::from_toml(&shipped()).unwrap();
    model.joint[0].tail.slope = 0.0;
    let text = model.sealed().to_toml().unwrap();
    let message = Model::from_toml(&text).unwrap_err().to_string();
    assert!(message.starts_with("joint.learned-bias"), "{message}");
}
