//! A learned model as a user sees it, and recordings that a user should not trust.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

use super::workplace::root;

const MODEL: &str = "config/models/rover.toml";

fn run(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    let command = command.args(arguments).current_dir(root());
    command.output().unwrap()
}

fn text(arguments: &[&str]) -> String {
    let output = run(arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && errors.is_empty(), "{errors}");
    String::from_utf8(output.stdout).unwrap()
}

fn refused(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty());
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn the_shipped_model_is_shown_as_text_and_as_one_document() {
    let shown = text(&["learn", "--show", "--model", MODEL]);
    for wanted in [
        "robot          rover (LF LM LR RF RM RR)",
        "file layout    version 4",
        "frames         learn_frames.csv.gz",
        "labels         learn_runs.csv",
        "ground         soil",
        "seed           1",
        "left out       0.333 of every mode and kind",
        "runs learned   334: 0-1 4 6",
        "runs left out  158: 2-3 5",
        "learned range  curvature to 1.000 1/m, 0.101 to 0.299 m/s",
        "\nLM_STUCK\n",
        "pose+encoders  windowed",
    ] {
        assert!(shown.contains(wanted), "{wanted}\n{shown}");
    }
    // The same side sharpens, the other makes shallower, on every circle both ways.
    let rows: Vec<Vec<&str>> = shown
        .lines()
        .map(|line| line.split_whitespace().collect())
        .filter(|words: &Vec<&str>| {
            words.len() == 8 && words[1] != "out" && (words[0] == "left" || words[0] == "right")
        })
        .collect();
    assert_eq!(rows.len(), 20);
    for words in rows {
        for (i, word) in words[2..].iter().enumerate() {
            let sharpens = (i < 3) == (words[0] == "left");
            let change: f64 = word.parse().unwrap();
            assert_eq!(change > 0.0, sharpens, "{words:?}");
        }
    }
    let json = text(&["learn", "--show", "--model", MODEL, "--json"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert!(shown.contains(&format!(
        "model hash     {}",
        json["model_hash"].as_str().unwrap()
    )));
    assert_eq!(
        json["provenance"]["runs_learned"].as_array().unwrap().len(),
        334
    );
    assert_eq!(json["modes"].as_array().unwrap().len(), 7);
    assert_eq!(json["modes"][2]["mode"], "LM_STUCK");
    assert_eq!(
        json["modes"][2]["motion"]["yaw"]["curvature"]
            .as_array()
            .unwrap()
            .len(),
        5
    );
    assert_eq!(json["heading_rate_change"].as_array().unwrap().len(), 20);
    assert!(json["alarms"][0]["alarm_log_odds_24_h"].as_f64().unwrap() > 0.0);
    assert_eq!(json["edited"], false);
}

#[test]
fn showing_and_learning_do_not_mix() {
    for arguments in [
        &["learn", "--show"][..],
        &["learn", "--model", MODEL],
        &["learn", "--show", "--model", MODEL, "--out", "x.toml"],
        &["learn", "--frames", "x.csv", "--runs", "y.csv"],
    ] {
        assert!(
            refused(arguments).contains("Usage: vigil learn"),
            "{arguments:?}"
        );
    }
}

#[test]
fn an_edited_model_is_refused_unless_it_says_that_it_is_edited() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("model.toml");
    let shipped = fs::read_to_string(root().join(MODEL)).unwrap();
    let edited = shipped.replacen("lag_s = 0.1", "lag_s = 0.2", 1);
    assert_ne!(edited, shipped);
    let name = path.display().to_string();
    let show = ["learn", "--show", "--model", &name];
    fs::write(&path, &edited).unwrap();
    let message = refused(&show);
    assert!(message.contains("changed or cut short"), "{message}");
    assert!(message.contains("write hash = \"edited\""), "{message}");
    let stored = shipped
        .lines()
        .find(|line| line.starts_with("hash = "))
        .unwrap();
    fs::write(&path, edited.replacen(stored, "hash = \"edited\"", 1)).unwrap();
    assert!(text(&show).contains(", edited by hand\n"));
    // Comments and layout are no content.
    fs::write(&path, format!("# ours\n{shipped}\n")).unwrap();
    assert!(text(&show).contains("model hash"));
    fs::write(&path, shipped.replacen("version = 4", "version = 3", 1)).unwrap();
    assert!(refused(&show).contains("learn it again with `vigil learn`"));
}

/// Writes a curved drive of 4 s at .2 m/s, its yaw multiplied by `factor`, its times as if frames
/// were `spacing_s` apart.
fn drive(to: &Path, runs: u32, factor: f64, spacing_s: f64) {
    let mut rows = String::from(
        "run,t,x,y,yaw,enc_LF,enc_LM,enc_LR,enc_RF,enc_RM,enc_RR,steer_LF,steer_LR,steer_RF,\
         steer_RR,cmd_curv,cmd_speed\n",
    );
    for run in 0..runs {
        for k in 1..=80 {
            let t_s = 0.05 * f64::from(k);
            let yaw = 0.1 * t_s;
            let (x, y) = (2.0 * yaw.sin(), 2.0 - 2.0 * yaw.cos());
            let rate = 2.5 + 1e-3 * f64::from(k);
            let rates = format!("{rate},{rate},{rate},{rate},{rate},{rate}");
            let yaw = factor * yaw;
            let t_s = spacing_s * f64::from(k);
            rows += &format!("{run},{t_s},{x},{y},{yaw},{rates},.1,-.1,.1,-.1,0.5,0.2\n");
        }
    }
    fs::write(to, rows).unwrap();
}

#[test]
fn diagnose_warns_of_columns_that_mean_something_else() {
    let folder = TempDir::new().unwrap();
    let [frames, out] = ["frames.csv", "out.csv"].map(|name| folder.path().join(name));
    let diagnose = |factor: f64| {
        drive(&frames, 3, factor, 0.05);
        let names = [&frames, &out].map(|path| path.display().to_string());
        let output = run(&[
            "diagnose", "--model", MODEL, "--frames", &names[0], "--out", &names[1],
        ]);
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    assert_eq!(diagnose(1.0), "");
    let message = diagnose(-1.0);
    assert!(
        message.contains("run 0: signs: yaw turns -1.00 times the commanded angle"),
        "{message}"
    );
    let judged = "3 of 3 runs that can be judged are like this";
    assert!(message.contains(judged), "{message}");
}

#[test]
fn learning_faults_says_that_a_slow_log_is_not_judged() {
    let folder = TempDir::new().unwrap();
    let [frames, runs, out] =
        ["frames.csv", "runs.csv", "model.toml"].map(|name| folder.path().join(name));
    drive(&frames, 1, 1.0, 0.4);
    let labels = "run,mode,kind,wheel,onset_s,cmd_curv,cmd_speed,dur_s\n0,ND,,,-1,.5,.2,4\n";
    fs::write(&runs, labels).unwrap();
    let names = [&frames, &runs, &out].map(|path| path.display().to_string());
    let message = refused(&[
        "learn",
        "--robot",
        "config/robots/rover.toml",
        "--frames",
        &names[0],
        "--runs",
        &names[1],
        "--out",
        &names[2],
    ]);
    let wanted = format!(
        "warning: {}: units, signs and sides of 1 of 1 runs are NOT judged: in run 0 t advances by \
         0.400 s from frame to frame, allowed is 0.3 s; is t in ms?\n",
        names[0]
    );
    assert!(message.starts_with(&wanted), "{message}");
}

#[test]
fn a_model_of_channels_is_shown_and_an_edited_one_refused_in_the_same_way() {
    const CHANNELS: &str = "config/models/kobuki.toml";
    let shown = text(&["learn", "--show", "--model", CHANNELS]);
    for wanted in [
        "robot          kobuki",
        "file layout    version ",
        "frames         kobuki.csv.gz",
        "runs learned   3: 0-2",
        "of each run    the first 60 s",
        "learned range  cmd_yaw_rate -1.320 to 0.990 rad/s",
        "\nenc_L\n",
        "cmd_yaw_rate^2",
        "pose+encoders  learned-bias",
        "log-odds without a fault, by class of faults",
        "steady   above",
    ] {
        assert!(shown.contains(wanted), "{wanted}\n{shown}");
    }
    let json = text(&["learn", "--show", "--model", CHANNELS, "--json"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert!(shown.contains(&format!(
        "model hash     {}",
        json["model_hash"].as_str().unwrap()
    )));
    assert_eq!(json["channels"].as_array().unwrap().len(), 5);
    assert_eq!(json["channels"][0]["name"], "enc_L");
    assert_eq!(json["edited"], false);
    assert!(json["alarms"][0]["alarm_log_odds_24_h"].as_f64().unwrap() > 0.0);

    let folder = TempDir::new().unwrap();
    let path = folder.path().join("model.toml");
    let name = path.display().to_string();
    let show = ["learn", "--show", "--model", &name];
    let shipped = fs::read_to_string(root().join(CHANNELS)).unwrap();
    let changed = shipped.replacen("widened = 1.0", "widened = 1.2", 1);
    assert_ne!(changed, shipped);
    fs::write(&path, &changed).unwrap();
    assert!(refused(&show).contains("write hash = \"edited\""));
    let stored = shipped
        .lines()
        .find(|line| line.starts_with("hash = "))
        .unwrap();
    fs::write(&path, changed.replacen(stored, "hash = \"edited\"", 1)).unwrap();
    assert!(text(&show).contains(", edited by hand\n"));
}
