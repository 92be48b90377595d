//! `vigil evaluate` on a robot with a model of channels: what it says, and what it refuses.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

use super::workplace::root;

const SHIPPED: &str = "config/models/kobuki.toml";

fn vigil(command: &str, folder: &Path, more: &[&str]) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    program.args([command, "--robot", "config/robots/kobuki.toml"]);
    program.arg("--frames").arg(folder.join("frames.csv"));
    program.args(more).current_dir(root()).output().unwrap()
}

fn evaluate(folder: &Path, model: &str, more: &[&str]) -> Output {
    let labels = folder.join("labels.csv").display().to_string();
    let given = ["--model", model, "--part", "all", "--runs", &labels];
    vigil("evaluate", folder, &[&given[..], more].concat())
}

/// Two runs of 60 s: one as commanded, one whose left wheel stands from 30 s on. `sense`: sign of
/// the gyro.
fn record(folder: &Path, sense: f64) {
    let mut text =
        String::from("run,t,cmd_speed,cmd_yaw_rate,enc_L,enc_R,yaw_rate,current_L,current_R\n");
    for run in 0..2 {
        for i in 0..3000_u32 {
            let t_s = f64::from(i) * 0.02;
            // As good as white, and another one for every channel.
            let jitter = |k: u32| f64::from((i * (7919 + 2 * k) + run * 31) % 1009) / 504.5 - 1.0;
            let (speed, turn) = (
                0.3 + 0.15 * (0.7 * t_s).sin(),
                -0.4 + 0.3 * (0.5 * t_s).sin(),
            );
            let rate = |y: f64, k| (speed + y * turn) / 0.035 + 0.1 * jitter(k);
            let stands = run == 1 && t_s >= 30.0;
            let left = if stands { 0.0 } else { rate(-0.115, 1) };
            let right = rate(0.115, 2);
            let gyro = sense * ((right - left) * 0.035 / 0.23 + 0.02 * jitter(3));
            let current = if stands { 1.5 } else { 0.05 } + 0.01 * jitter(4);
            let other = 0.05 + 0.01 * jitter(5);
            let row = format!("{left},{right},{gyro},{current},{other}");
            writeln!(text, "{run},{t_s},{speed},{turn},{row}").unwrap();
        }
    }
    fs::write(folder.join("frames.csv"), text).unwrap();
    fs::write(
        folder.join("labels.csv"),
        "run,mode,onset_s\n0,ND,-1\n1,STUCK,30\n",
    )
    .unwrap();
}

#[test]
fn labels_count_as_fault_or_no_fault_and_the_page_has_what_applies() {
    let folder = TempDir::new().unwrap();
    record(folder.path(), 1.0);
    let [model, page] = ["model.toml", "page.html"].map(|name| folder.path().join(name));
    let model = model.to_str().unwrap();
    let learned = vigil("learn", folder.path(), &["--only", "0", "--out", model]);
    assert!(learned.status.success());
    let asked = ["--report", page.to_str().unwrap(), "--json"];
    let output = evaluate(folder.path(), model, &asked);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.success() && !errors.contains("warning"),
        "{errors}"
    );
    let score: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&score["identifies"], &score["identifier"]),
        (&false.into(), &"channels".into())
    );
    let found = &score["detection"]["STUCK"];
    assert_eq!((&found["n"], &found["detected"]), (&1.into(), &1.into()));
    assert!(found["delay"]["max_s"].as_f64().unwrap() < 2.0, "{found}");
    assert_eq!(score["false_alarms"]["alarms"], 0);
    assert_eq!(score["identification"], serde_json::json!({}));
    assert_eq!(score["calibration"], serde_json::json!({}));
    // Each run warms up for a second of motion, and half a second in which it begins to move.
    let warm_up_s = score["false_alarms"]["warm_up_h"].as_f64().unwrap() * 3600.0;
    assert!((2.0..4.0).contains(&warm_up_s), "{warm_up_s}");
    // The robot has no pose: one set of channels alone.
    let sets: Vec<&String> = score["sensor_sets"].as_object().unwrap().keys().collect();
    assert_eq!(sets, ["pose+encoders"]);
    let page = fs::read_to_string(page).unwrap();
    for section in [
        "summary",
        "confusion",
        "delay",
        "trade-off",
        "belief",
        "provenance",
    ] {
        assert!(
            page.contains(&format!("<section id=\"{section}\"")),
            "{section}"
        );
    }
    for absent in ["<section id=\"calibration\"", "leaf right", "by side"] {
        assert!(!page.contains(absent), "{absent}");
    }
    assert!(page.contains("they say fault or no fault"));
}

#[test]
fn what_has_no_meaning_there_is_refused_by_name() {
    let folder = TempDir::new().unwrap();
    record(folder.path(), 1.0);
    for (more, wanted) in [
        (
            ["--filters", "all"],
            "--filters: config/models/kobuki.toml is a model of channels",
        ),
        (
            ["--identifier", "imm"],
            "--identifier: config/models/kobuki.toml is a model of channels",
        ),
        (
            ["--sensors", "pose"],
            "no calibration for 'pose' and 'learned-bias', only for",
        ),
        (
            ["--detector", "windowed"],
            "no calibration for 'pose+encoders' and 'windowed', only for",
        ),
    ] {
        let output = evaluate(folder.path(), SHIPPED, &more);
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{more:?}: {errors}");
        assert!(
            errors.contains(wanted) && output.stdout.is_empty(),
            "{more:?}: {errors}"
        );
    }
}

/// Multiplies the frames' times.
fn restamp(folder: &Path, factor: f64) {
    let path = folder.join("frames.csv");
    let text = fs::read_to_string(&path).unwrap();
    let (mut restamped, rows) = text
        .split_once('\n')
        .map(|(h, r)| (h.to_owned(), r))
        .unwrap();
    for row in rows.lines() {
        let mut cells = row.splitn(3, ',');
        let [run, t, values] = [0; 3].map(|_| cells.next().unwrap());
        let t_s = factor * t.parse::<f64>().unwrap();
        write!(restamped, "\n{run},{t_s},{values}").unwrap();
    }
    fs::write(path, restamped).unwrap();
}

/// What learning, diagnosing and evaluating say on the error stream, and their exit status.
fn every_command(folder: &Path) -> [(String, Option<i32>); 3] {
    let [model, out] = ["model.toml", "out.csv"].map(|name| folder.join(name));
    let [model, out] = [&model, &out].map(|path| path.display().to_string());
    let outputs = [
        vigil("learn", folder, &["--only", "0", "--out", &model]),
        vigil("diagnose", folder, &["--model", SHIPPED, "--out", &out]),
        evaluate(folder, SHIPPED, &[]),
    ];
    outputs.map(|output| {
        let errors = String::from_utf8(output.stderr).unwrap();
        (errors, output.status.code())
    })
}

#[test]
fn time_in_ms_is_refused_by_every_command() {
    let folder = TempDir::new().unwrap();
    record(folder.path(), 1.0);
    restamp(folder.path(), 1000.0);
    let wanted = "row 2: run 0: a gap of 20.000 s, allowed is 1 s: start a new run; or is t in ms?";
    for (errors, status) in every_command(folder.path()) {
        assert_eq!(status, Some(2), "{errors}");
        assert!(errors.trim_end().ends_with(wanted), "{errors}");
    }
}

#[test]
fn every_command_says_that_a_slow_log_is_not_judged() {
    let folder = TempDir::new().unwrap();
    // A gyro of the wrong sign, which nothing finds.
    record(folder.path(), -1.0);
    restamp(folder.path(), 20.0);
    let wanted = "t advances by 0.400 s from frame to frame, allowed is 0.3 s; is t in ms?";
    for (errors, status) in every_command(folder.path()) {
        assert_eq!(status, Some(0), "{errors}");
        assert!(errors.contains(wanted), "{errors}");
    }
}

#[test]
fn columns_that_mean_something_else_are_told() {
    let folder = TempDir::new().unwrap();
    record(folder.path(), -1.0);
    let output = evaluate(folder.path(), SHIPPED, &[]);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        errors.contains("is it or cmd_yaw_rate positive to the right?"),
        "{errors}"
    );
    let judged = "2 of 2 runs that can be judged are like this";
    assert!(errors.contains(judged), "{errors}");
}
