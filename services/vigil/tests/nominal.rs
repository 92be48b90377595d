//! `vigil evaluate` on a robot of which only the nominal behaviour is known: what it says, and what it
//! refuses.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

fn evaluate(folder: &Path, more: &[&str]) -> Output {
    let [frames, labels] = ["frames.csv", "labels.csv"].map(|name| folder.join(name));
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil"));
    command.args(["evaluate", "--robot", "config/robots/kobuki.toml"]);
    command.args(["--model", "config/models/kobuki.toml", "--part", "all"]);
    command
        .arg("--frames")
        .arg(frames)
        .arg("--runs")
        .arg(labels)
        .args(more);
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    command.current_dir(root).output().unwrap()
}

/// Two runs of 20 s: one as commanded, one whose left wheel stands from 10 s on. `sense`: sign of the
/// gyro.
fn record(folder: &Path, sense: f64) {
    let mut text =
        String::from("run,t,cmd_speed,cmd_yaw_rate,enc_L,enc_R,yaw_rate,current_L,current_R\n");
    for run in 0..2 {
        for i in 0..1000_u32 {
            let t_s = f64::from(i) * 0.02;
            let jitter = 0.02 * (f64::from(i * 7919 % 1000) / 500.0 - 1.0);
            let (speed, turn) = (0.3, -0.4 + 0.2 * (0.5 * t_s).sin());
            let [left, right] = [-0.115, 0.115].map(|y| (speed + y * turn) / 0.035 + jitter);
            let stands = run == 1 && t_s >= 10.0;
            let left = if stands { 0.0 } else { left };
            let gyro = sense * ((right - left) * 0.035 / 0.23 + jitter);
            let current = if stands { 1.5 } else { 0.05 };
            writeln!(
                text,
                "{run},{t_s},{speed},{turn},{left},{right},{gyro},{current},0.05"
            )
            .unwrap();
        }
    }
    fs::write(folder.join("frames.csv"), text).unwrap();
    fs::write(
        folder.join("labels.csv"),
        "run,mode,onset_s\n0,ND,-1\n1,STUCK,10\n",
    )
    .unwrap();
}

#[test]
fn labels_count_as_fault_or_no_fault_and_the_page_has_what_applies() {
    let folder = TempDir::new().unwrap();
    record(folder.path(), 1.0);
    let page = folder.path().join("page.html");
    let output = evaluate(
        folder.path(),
        &["--report", page.to_str().unwrap(), "--json"],
    );
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.success() && !errors.contains("warning"),
        "{errors}"
    );
    let score: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&score["identifies"], &score["identifier"]),
        (&false.into(), &"none".into())
    );
    assert_eq!(score["detection"]["STUCK"]["n"], 1);
    assert_eq!(score["detection"]["STUCK"]["detected"], 1);
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
    assert!(page.contains("labels say fault or no fault"));
}

#[test]
fn what_has_no_meaning_there_is_refused_by_name() {
    let folder = TempDir::new().unwrap();
    record(folder.path(), 1.0);
    for (more, wanted) in [
        (
            ["--filters", "all"],
            "--filters: config/models/kobuki.toml is a model of nominal",
        ),
        (
            ["--identifier", "imm"],
            "--identifier: config/models/kobuki.toml is a model of nominal",
        ),
        (
            ["--sensors", "pose"],
            "no calibration for 'pose' and 'learned-bias', only for",
        ),
        (["--detector", "windowed"], "reach 8.64 at the highest"),
    ] {
        let output = evaluate(folder.path(), &more);
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{more:?}: {errors}");
        assert!(
            errors.contains(wanted) && output.stdout.is_empty(),
            "{more:?}: {errors}"
        );
    }
}

#[test]
fn columns_that_mean_something_else_are_told() {
    let folder = TempDir::new().unwrap();
    record(folder.path(), -1.0);
    let output = evaluate(folder.path(), &[]);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        errors.contains("is yaw_rate or cmd_yaw_rate positive to the right?"),
        "{errors}"
    );
    assert!(errors.contains("2 of 2 runs begin like this"), "{errors}");
}
