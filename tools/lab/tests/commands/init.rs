//! `vigil init`: from a log alone to a graph that loads.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

fn lab(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    command.current_dir(folder).args(arguments);
    command.output().unwrap()
}

/// Runs it, which must go well.
fn done(folder: &Path, arguments: &[&str]) -> String {
    let output = lab(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// A minute of a differential robot: wheels of 0.1 m, 0.5 m apart.
fn write_log(folder: &Path) {
    let mut text = "time,cmd_lin,cmd_ang,gyro_z,wheel_vel_left,wheel_vel_right,mood\n".to_owned();
    // Some noise, the same each time.
    let mut state = 1_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24) - 0.5
    };
    for i in 0..3000 {
        let t_s = f64::from(i) * 0.02;
        let (v, w) = (0.4 * (0.3 * t_s).sin(), 0.8 * (0.17 * t_s).sin());
        let [left, right] = [v - 0.25 * w, v + 0.25 * w].map(|speed| speed / 0.1 + 0.1 * noise());
        let (gyro, mood) = (w + 0.02 * noise(), noise());
        text += &format!("{t_s},{v},{w},{gyro},{left},{right},{mood}\n");
    }
    fs::write(folder.join("drive.csv"), text).unwrap();
}

#[test]
fn a_log_becomes_a_graph_that_loads() {
    let home = TempDir::new().unwrap();
    let at = home.path();
    write_log(at);
    let said: Value = serde_json::from_str(&done(
        at,
        &["init", "my_robot", "--from", "drive.csv", "--json"],
    ))
    .unwrap();
    let unsure = said["unsure"].to_string();
    assert!(
        unsure.contains("of drive.csv nothing was made of mood"),
        "{unsure}"
    );
    // The commands that it names are the ones that lead on; those of other programs are not run.
    let next: Vec<&str> = said["next"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_str)
        .collect();
    for command in &next[..2] {
        let words: Vec<&str> = command.split(' ').skip(1).collect();
        done(at, &words);
    }
    assert_eq!(
        next[2..],
        [
            "vigil check --config my_robot/graph.toml",
            "scripts/up --config my_robot/graph.toml"
        ]
    );
    let setup = vigil_setup::load_graph(&at.join("my_robot/graph.toml"), |_| {}).unwrap();
    assert_eq!(
        (setup.file.graph.name.as_str(), setup.file.graph.rate_hz),
        ("my-robot", 50.0)
    );
    let leaves = setup.tree.nodes().iter().map(|node| node.name.as_str());
    let leaves: Vec<&str> = leaves.collect();
    assert!(
        ["enc_L", "enc_R", "yaw_rate", "drive_L"]
            .iter()
            .all(|leaf| leaves.contains(leaf)),
        "{leaves:?}"
    );
    // What was corrected by hand is not written over.
    let again = lab(at, &["init", "my_robot", "--from", "drive.csv"]);
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("my_robot/graph.toml exists"));
}

#[test]
fn a_description_becomes_a_graph_that_can_be_recorded_from() {
    let home = TempDir::new().unwrap();
    let robot = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../config/robots/kobuki.toml"
    );
    let said = done(home.path(), &["init", "mine", "--robot", robot]);
    assert!(
        said.contains("vigil record --config mine/graph.toml --out mine/frames.csv.gz"),
        "{said}"
    );
    let missing =
        vigil_setup::load_graph(&home.path().join("mine/graph.toml"), |_| {}).unwrap_err();
    // Only the model is missing.
    assert!(
        missing
            .problems
            .iter()
            .all(|problem| problem.to_string().contains("model.toml")),
        "{missing}"
    );
}

#[test]
fn a_name_without_letters_and_a_log_that_is_none_are_refused() {
    let home = TempDir::new().unwrap();
    for (arguments, reason) in [
        (
            ["init", "___", "--from", "drive.csv"],
            "needs a letter or digit",
        ),
        (["init", "mine", "--from", "nowhere"], "nowhere"),
        (["init", "mine", "--robot", "nowhere.toml"], "nowhere.toml"),
    ] {
        let output = lab(home.path(), &arguments);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(said.contains(reason), "{said}");
    }
    assert_eq!(fs::read_dir(home.path()).unwrap().count(), 0);
}
