//! A model of channels: its file, and its joint law against a dense computation.

use std::path::PathBuf;

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_robot::Description;
use vigil_robot::channel_model::component::unfit;
use vigil_robot::channel_model::directions::{covariances, directions};
use vigil_robot::channel_model::law::{BLOCKS, Change, Direction, Law, Row};
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

/// A law of three channels, and the covariance of its window: channel by channel, then by block.
fn law() -> (Law, DMatrix<f64>) {
    let mixing = DMatrix::from_row_slice(3, 3, &[1.0, 0.6, 0.2, 0.1, 0.9, -0.5, 0.3, 0.0, 0.7]);
    let kept = [0.9, 0.5, 0.1];
    let at = |lag: usize| {
        let power = DMatrix::from_fn(3, 3, |i, j| match i == j {
            true => f64::powi(kept[i], lag as i32),
            false => 0.0,
        });
        &mixing * power * mixing.transpose()
    };
    let by_lag: Vec<DMatrix<f64>> = (0..BLOCKS).map(at).collect();
    let directions = directions(&by_lag);
    let by_lag = covariances(&directions, &[0, 1, 2]);
    let dense = DMatrix::from_fn(3 * BLOCKS, 3 * BLOCKS, |a, b| {
        by_lag[(a % BLOCKS).abs_diff(b % BLOCKS)][(a / BLOCKS, b / BLOCKS)]
    });
    (Law::new(&directions, 3, 0).unwrap(), dense)
}

fn rows(values: &DVector<f64>) -> Vec<Row> {
    let row = |i: usize| std::array::from_fn(|block| values[i * BLOCKS + block]);
    (0..3).map(row).collect()
}

#[test]
fn the_law_says_what_its_whole_covariance_says() {
    let (mut law, covariance) = law();
    let precision = covariance.clone().cholesky().unwrap().inverse();
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut draw = || DVector::from_fn(3 * BLOCKS, |_, _| rng.sample::<f64, _>(StandardNormal));
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-8 * (1.0 + b.abs()), "{a} {b}");
    for _ in 0..20 {
        let (z, s) = (draw(), draw());
        law.take(&rows(&z).iter().map(|row| row.map(Some)).collect::<Vec<_>>());
        near(law.square(), z.dot(&(&precision * &z)));
        // The first blocks alone have the square of their own law.
        for first in 0..=BLOCKS {
            let there: Vec<usize> = (0..3 * BLOCKS).filter(|i| i % BLOCKS < first).collect();
            let of_there = DMatrix::from_fn(there.len(), there.len(), |i, j| {
                covariance[(there[i], there[j])]
            });
            let z_there = DVector::from_fn(there.len(), |i, _| z[there[i]]);
            let square = z_there.dot(&(of_there.cholesky().unwrap().inverse() * &z_there));
            near(law.parts()[..first].iter().sum(), square);
        }
        let Change { b, a } = law.joint_change(&rows(&s), None);
        near(b, s.dot(&(&precision * &z)));
        near(a, s.dot(&(&precision * &s)));
        let weighed = law.weighed(&rows(&s));
        let product: f64 = rows(&z).iter().zip(&weighed).map(|(a, b)| dot(a, b)).sum();
        near(product, s.dot(&(&precision * &z)));
        // Without the first channel: under the law of the others alone.
        let Change { b, a } = law.joint_change(&rows(&without_first(&s)), Some(0));
        let others = 2 * BLOCKS;
        let of_others = covariance
            .view((BLOCKS, BLOCKS), (others, others))
            .into_owned();
        let of_others = of_others.cholesky().unwrap().inverse();
        let (z_others, s_others) = (z.rows(BLOCKS, others), s.rows(BLOCKS, others));
        near(b, s_others.dot(&(&of_others * z_others)));
        near(a, s_others.dot(&(&of_others * s_others)));
        let of_z = law.weighed(&rows(&z));
        let hidden = law.hidden(0, 0, [&weighed[0], &of_z[0]]);
        near(product - hidden, s_others.dot(&(&of_others * z_others)));
        // Completed so that they say nothing of the first.
        let mut silent = rows(&s);
        let added = law.silence(0, 0, &weighed[0]);
        silent[0].iter_mut().zip(added).for_each(|(a, b)| *a += b);
        law.weighed(&silent)[0]
            .into_iter()
            .for_each(|value| near(value, 0.0));
        for channel in 0..3 {
            let changes = law.change(channel, &rows(&s)[channel]);
            for (first, Change { b, a }) in changes.into_iter().enumerate() {
                let (from, to) = (channel * BLOCKS + first, (channel + 1) * BLOCKS);
                let alone = DVector::from_fn(3 * BLOCKS, |i, _| match (from..to).contains(&i) {
                    true => s[i],
                    false => 0.0,
                });
                near(b, alone.dot(&(&precision * &z)));
                near(a, alone.dot(&(&precision * &alone)));
                // Without these readings: the square of the others under their own law.
                let rest: Vec<usize> = (0..3 * BLOCKS)
                    .filter(|i| !(from..to).contains(i))
                    .collect();
                let of_rest = DMatrix::from_fn(rest.len(), rest.len(), |i, j| {
                    covariance[(rest[i], rest[j])]
                });
                let z_rest = DVector::from_fn(rest.len(), |i, _| z[rest[i]]);
                let without = z_rest.dot(&(of_rest.cholesky().unwrap().inverse() * &z_rest));
                near(law.square() - law.deviation(channel, first).0, without);
            }
        }
    }
}

fn dot(a: &Row, b: &Row) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn without_first(values: &DVector<f64>) -> DVector<f64> {
    DVector::from_fn(
        values.len(),
        |i, _| if i < BLOCKS { 0.0 } else { values[i] },
    )
}

#[test]
fn a_window_that_has_just_begun_is_judged_by_the_law_of_what_is_there() {
    let (_, covariance) = law();
    let (whole, _) = law();
    let first = 5;
    let mut short = Law::new(whole.directions(), 3, first).unwrap();
    let there: Vec<usize> = (0..3 * BLOCKS).filter(|i| i % BLOCKS >= first).collect();
    let of_there = DMatrix::from_fn(there.len(), there.len(), |i, j| {
        covariance[(there[i], there[j])]
    });
    let precision = of_there.cholesky().unwrap().inverse();
    let value = |i: usize| (i as f64 * 0.7).sin();
    let z = DVector::from_fn(there.len(), |i, _| value(there[i]));
    let mut window = vec![[None; BLOCKS]; 3];
    for &i in &there {
        window[i / BLOCKS][i % BLOCKS] = Some(value(i));
    }
    short.take(&window);
    assert!((short.square() - z.dot(&(&precision * &z))).abs() < 1e-9);
    let Change { b, a } = short.change(1, &[1.0; BLOCKS])[0];
    let shift = DVector::from_fn(there.len(), |i, _| {
        f64::from(u8::from(there[i] / BLOCKS == 1))
    });
    assert!((b - shift.dot(&(&precision * &z))).abs() < 1e-9);
    assert!((a - shift.dot(&(&precision * &shift))).abs() < 1e-9);
}

#[test]
fn what_no_fault_explains_is_weighed_by_the_density_of_wider_laws() {
    let (law, _) = law();
    let n = (3 * BLOCKS) as f64;
    // Of a Student law with 30 degrees of freedom, but for what does not depend on the window.
    let log_density = |square: f64, factor: f64| {
        -0.5 * (30.0 + n) * (1.0 + square / (30.0 * factor * factor)).ln() - n * factor.ln()
    };
    for square in [0.0, n, 10.0 * n, 1e3 * n, 1e5 * n] {
        let mut mean = 0.0;
        for factor in [2.0, 4.0, 8.0, 16.0, 32.0] {
            let ratio = log_density(square, factor) - log_density(square, 1.0);
            assert!((law.log_ratio_larger(square, factor) - ratio).abs() < 1e-9);
            mean += ratio.exp() / 5.0;
        }
        // Where nothing is known of its blocks: only from the start.
        let throughout = law.log_ratio_unknown(square, &[]);
        assert!((throughout - (mean / 4.0).ln()).abs() < 1e-9);
        // From each of the onsets on, of which the last blocks hold all but one a block.
        let before = [1.0; 7];
        let mut all = 0.0;
        for first in [0, 4, 6, 7] {
            let later = 3.0 * (BLOCKS - first) as f64;
            for factor in [2.0, 4.0, 8.0, 16.0, 32.0] {
                let rest = square - first as f64;
                let scaled = first as f64 + rest / (factor * factor);
                let densities = [scaled, square].map(|square| log_density(square, 1.0));
                let ratio = densities[0] - densities[1] - later * f64::ln(factor);
                all += ratio.exp() / 20.0;
            }
        }
        if square >= n {
            assert!((law.log_ratio_unknown(square, &before) - all.ln()).abs() < 1e-9);
        }
    }
}

#[test]
fn what_a_change_leaves_follows_from_how_much_more_likely_it_makes_the_window() {
    let (mut law, _) = law();
    law.take(&[
        [Some(4.0); BLOCKS],
        [Some(-3.0); BLOCKS],
        [Some(0.5); BLOCKS],
    ]);
    for share in [0.0, 0.3, 0.99, 1.0] {
        let less = share * law.square();
        let left = law.left(law.log_ratio(less, 0.0));
        assert!((left - (law.square() - less)).abs() < 1e-9 * law.square());
    }
    // What speaks against it leaves all.
    assert_eq!(law.left(-5.0), law.square());
}

#[test]
fn what_was_not_measured_takes_the_mean_that_its_block_gives() {
    let (mut law, covariance) = law();
    let now = DMatrix::from_fn(3, 3, |i, j| covariance[(i * BLOCKS, j * BLOCKS)]);
    let mut window = vec![[Some(0.0); BLOCKS]; 3];
    window[0][5] = Some(1.0);
    window[1][5] = None;
    window[2][5] = Some(-2.0);
    law.take(&window);
    let others =
        DMatrix::from_row_slice(2, 2, &[now[(0, 0)], now[(0, 2)], now[(2, 0)], now[(2, 2)]]);
    let weights = others
        .cholesky()
        .unwrap()
        .solve(&DVector::from_vec(vec![1.0, -2.0]));
    let mean = now[(1, 0)] * weights[0] + now[(1, 2)] * weights[1];
    assert!(
        (law.row(1)[5] - mean).abs() < 1e-9,
        "{} {mean}",
        law.row(1)[5]
    );
    // A block that nothing was measured in says nothing.
    law.take(&[[None; BLOCKS]; 3]);
    assert_eq!(law.square(), 0.0);
}

#[test]
fn a_covariance_that_is_none_of_a_process_is_made_one() {
    let impossible = vec![DMatrix::from_element(1, 1, 2.0); BLOCKS];
    let found = directions(&impossible);
    assert!(found[0].correlation.iter().all(|&value| value < 0.9));
    assert!(Law::new(&found, 1, 0).is_some());
    let direction = Direction {
        vector: vec![1.0],
        variance: 1.0,
        correlation: [1.0; BLOCKS - 1],
    };
    assert!(Law::new(&[direction], 1, 0).is_none());
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
