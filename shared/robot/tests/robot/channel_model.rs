//! A model of channels: its file, and its joint law against a dense computation.

use std::path::PathBuf;

use nalgebra::{DMatrix, DVector};
use vigil_robot::Description;
use vigil_robot::channel_model::component::unfit;
use vigil_robot::channel_model::tree::tree;
use vigil_robot::channel_model::{Combinations, Model, Monitor, Observer, components, drives};
use vigil_robot::channel_table::FurtherChannel;
use vigil_robot::description::Kinematics;
use vigil_robot::learned::Form;
use vigil_robot::learned::channels::Channels;

fn config(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../config");
    std::fs::read_to_string(path.join(name)).unwrap()
}

fn shipped() -> String {
    config("models/kobuki.toml")
}

pub fn robot(name: &str) -> Description {
    toml::from_str(&config(&format!("robots/{name}.toml"))).unwrap()
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

/// Why the shipped model is refused after a change that is sealed.
fn refused(change: impl Fn(&mut Model)) -> String {
    let mut model = Model::from_toml(&shipped()).unwrap();
    change(&mut model);
    let text = model.sealed().to_toml().unwrap();
    Model::from_toml(&text).unwrap_err().to_string()
}

#[test]
fn a_file_that_was_changed_by_accident_is_refused() {
    let model = Model::from_toml(&shipped()).unwrap();
    assert_eq!(model.to_toml().unwrap(), shipped());
    assert!(!model.is_edited());
    let changed = shipped().replacen("exposure_s = 46", "exposure_s = 946", 1);
    let message = Model::from_toml(&changed).unwrap_err().to_string();
    assert!(
        message.contains("changed or cut short") && message.contains(&model.hash),
        "{message}"
    );
    let edited = Model::from_toml(&edited("exposure_s = 46", "exposure_s = 946")).unwrap();
    assert!(edited.is_edited() && edited.hash() != model.hash());
    let old = shipped().replacen("version = 6", "version = 5", 1);
    let message = Model::from_toml(&old).unwrap_err().to_string();
    assert!(
        message.contains("layout version 5; this program reads version 6"),
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
        let wanted = format!("interval_s: {found} is not allowed: 0.02 to 0.3");
        assert_eq!(message, wanted);
    }
}

#[test]
fn what_points_at_nothing_is_refused_by_name() {
    for (from, to, key) in [
        ("lag = 1", "lag = 9", "channel.0.terms.5.lag: 9"),
        (
            "of = \"lagged\"",
            "of = \"lagged\"\nindex = 2",
            "channel.0.terms.5.index: 2",
        ),
        (
            "powers = [0, 1, 0, 0]",
            "powers = [0, 0, 1, 0]",
            "channel.0.terms.1.powers",
        ),
        (
            "powers = [0, 1, 0, 0]",
            "powers = [9, 0, 0, 0]",
            "channel.0.terms.1.powers",
        ),
    ] {
        let message = Model::from_toml(&edited(from, to)).unwrap_err().to_string();
        assert!(message.starts_with(key), "{to}: {message}");
    }
    for message in [
        refused(|m| m.direction[1].variance = -1.0),
        refused(|m| m.direction[0].correlation = [1.0; 7]),
    ] {
        assert!(message.starts_with("direction"), "{message}");
    }
    let message = refused(|m| m.scatter.mean.clear());
    assert!(message.starts_with("scatter"), "{message}");
    let message = refused(|m| m.tail[0].slope = 0.0);
    assert!(message.starts_with("tail"), "{message}");
}

#[test]
fn numbers_that_would_blind_or_end_a_service_are_refused() {
    for (key, message) in [
        ("tail", refused(|m| m.tail[6].slope = 1e308)),
        ("tail", refused(|m| m.tail[6].level_log_odds = -1e9)),
        (
            "direction",
            refused(|m| m.direction[0].vector = vec![1e150; 5]),
        ),
        ("direction", refused(|m| m.direction[0].variance = 1e308)),
        ("scatter", refused(|m| m.scatter.covariance[0][0] = 1e-310)),
        ("scatter", refused(|m| m.scatter.covariance[0][1] = 1e5)),
        (
            "channel.0.weights",
            refused(|m| m.channel[0].weights[0] = 1e300),
        ),
        (
            "channel.0.silence_s",
            refused(|m| m.channel[0].silence_s = -1.0),
        ),
        ("command", refused(|m| m.command[0].size = 0.0)),
        (
            "turning",
            refused(|m| m.turning.wheel[0].squares[0] = f64::NAN),
        ),
        ("turning", refused(|m| m.turning.fault[1].real.clear())),
        (
            "turning.fault.1.fault",
            refused(|m| m.turning.fault[1].fault = "LEFT_TYRE".to_owned()),
        ),
        (
            "combinations",
            refused(|m| m.combinations.precision[0].clear()),
        ),
    ] {
        assert!(message.starts_with(key), "{key}: {message}");
    }
}

#[test]
fn wheels_without_a_command_have_no_drives() {
    let mut robot = robot("kobuki");
    robot.kinematics = Kinematics::None;
    robot.command.clear();
    robot.fault.clear();
    assert!(drives(&robot).is_empty());
    let names: Vec<String> = components(&robot).into_iter().map(|one| one.name).collect();
    assert_eq!(
        names,
        ["enc_L", "enc_R", "yaw_rate", "current_L", "current_R"]
    );
    assert_eq!(unfit(&robot), None);
    let further = |name: &str| FurtherChannel {
        name: name.to_owned(),
        ..toml::from_str("name = 'a'\nrole = 'other'\nunit = 'V'").unwrap()
    };
    robot.channel = vec![further("enc_L")];
    assert!(unfit(&robot).unwrap().contains("'enc_L'"));
    robot.channel = (0..24).map(|i| further(&format!("c{i}"))).collect();
    assert!(unfit(&robot).unwrap().contains("29 channels"));
}

#[test]
fn drives_share_the_command_as_the_geometry_says() {
    let all = drives(&robot("kobuki"));
    let names: Vec<&str> = all.iter().map(|drive| drive.name.as_str()).collect();
    assert_eq!(names, ["L", "R"]);
    // 0.3 m/s and 1 rad/s: the wheels are 0.23 m apart.
    let command = [0.3, 1.0, 0.0, 0.0];
    assert!((all[0].commanded(&command) - 0.185).abs() < 1e-12);
    assert!((all[1].commanded(&command) - 0.415).abs() < 1e-12);
    // With the left wheel standing it turns about that wheel.
    let [speed, turn, ..] = all[0].without(&command);
    assert!((speed - 0.2075).abs() < 1e-9 && (turn - 0.415 / 0.23).abs() < 1e-9);
    // Without a geometry each axis is a drive.
    let axes = drives(&robot("rover"));
    assert_eq!(axes[0].name, "cmd_curv");
    assert_eq!(axes[0].without(&[0.5, 0.2, 0.0, 0.0]), [0.0, 0.2, 0.0, 0.0]);
}

#[test]
fn a_tree_has_a_leaf_for_each_component_below_its_wheel() {
    let robot = robot("robotino");
    let tree = tree(&robot).unwrap();
    assert_eq!(tree.leaves().count(), components(&robot).len());
    let parent = |name: &str| {
        let node = &tree.nodes()[tree.index(name).unwrap()];
        tree.nodes()[node.parent.unwrap()].name.clone()
    };
    assert_eq!(parent("enc_B"), "WHEEL_B");
    assert_eq!(parent("drive_B"), "WHEEL_B");
    assert_eq!(parent("pose"), "BODY");
}

#[test]
fn another_prior_rate_moves_log_odds_and_threshold_by_its_logarithm() {
    let (model, robot) = (Model::from_toml(&shipped()).unwrap(), robot("kobuki"));
    let log_odds = |rate_1_h: f64| {
        let mut monitor = Monitor::new(&model, &robot, Channels::PoseEncoders, rate_1_h).unwrap();
        let mut observer = Observer::new(&robot);
        let mut out = Vec::new();
        for i in 0..600_u32 {
            let mut frame = vigil_blocks::SensorFrame {
                run_id: 1,
                ..Default::default()
            };
            frame.header.t_capture_ns = u64::from(i) * 20_000_000;
            frame.set_command(0, 0.3);
            frame.set_command(1, 0.0);
            for channel in 0..5 {
                let off = if i > 300 && channel == 2 { 0.4 } else { 0.0 };
                frame.set_channel(channel, [8.5, 8.5, 0.0, 0.03, 0.03][channel] + off);
            }
            if observer.push(&frame).complete {
                monitor.step(observer.history(), observer.orders());
                out.push(monitor.report().log_odds);
            }
        }
        out
    };
    let one = log_odds(1.0);
    assert!(one.iter().any(|&value| value > 0.0), "{one:?}");
    for rate_1_h in [1e-3, 10.0] {
        let shift = f64::ln(rate_1_h);
        for (found, one) in log_odds(rate_1_h).iter().zip(&one) {
            assert!((found - one - shift).abs() < 1e-9);
        }
        let of = (Channels::PoseEncoders, Form::LearnedBias);
        let threshold = |rate_1_h| model.alarm_log_odds(of, 1000.0, rate_1_h).unwrap();
        assert!((threshold(rate_1_h) - threshold(1.0) - shift).abs() < 1e-9);
    }
}

#[test]
fn novelty_is_one_on_average_and_grows_with_what_was_not_driven() {
    let near =
        |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    let powers = vec![[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]];
    // One axis at a time, never both.
    let driven = [
        [1.0, 0.0, 0.0, 0.0],
        [0.5, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0, 0.0],
    ];
    let row = |c: &[f64; 4]| DVector::from_vec(vec![1.0, c[0], c[1]]);
    let mut mean = DMatrix::zeros(3, 3);
    for command in &driven {
        mean += row(command) * row(command).transpose() / driven.len() as f64;
    }
    let precision = mean.try_inverse().unwrap();
    let combinations = Combinations {
        powers,
        precision: (0..3)
            .map(|i| precision.row(i).iter().copied().collect())
            .collect(),
    };
    let all = driven.iter().map(|command| combinations.novelty(command));
    near(all.sum::<f64>() / driven.len() as f64, 1.0);
    let both = [1.0, 1.0, 0.0, 0.0];
    let expected = (row(&both).transpose() * &precision * row(&both))[(0, 0)] / 3.0;
    near(combinations.novelty(&both), expected);
    assert!(expected > combinations.novelty(&driven[0]));
    near(Combinations::default().novelty(&both), 0.0);
}
