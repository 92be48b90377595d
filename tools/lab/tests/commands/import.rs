//! `vigil import`: a log is looked at, described, and imported by its description.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

use super::workplace::root;

fn run(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    command.current_dir(folder).arg("import").args(arguments);
    command.output().unwrap()
}

fn json(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_published_page_of_logs_is_up_to_date() {
    let output = run(&root(), &["--reference"]);
    let page = String::from_utf8(output.stdout).unwrap();
    let published = fs::read_to_string(root().join("docs/log-description.md")).unwrap();
    assert!(
        published == page,
        "make it anew: cargo run -p vigil-lab -- import --reference > docs/log-description.md"
    );
    for part in [
        "| `rate_hz` | Hz | 1 to 1000 | required |",
        "## `[[source]]`\n",
        "## `[source.device_clock]`, `[source.time]`\n",
        "- `hold`: The last sample",
        "| `delay_s` | s | -1 to 1 | 0 |",
    ] {
        assert!(page.contains(part), "{part}\n{page}");
    }
}

#[test]
fn a_log_is_looked_at_described_and_imported() {
    let folder = TempDir::new().unwrap();
    let mut text = "t_ms,v_cmd,omega_cmd,gyro_z,wheel_vel_left,wheel_vel_right\n".to_owned();
    for i in 0..2000 {
        let t_s = f64::from(i) * 0.02;
        let (v, w) = (0.4 * (0.3 * t_s).sin(), 0.8 * (0.17 * t_s).sin());
        // A wheel radius of 0.1 m, the wheels 0.5 m apart; the gyro is positive to the right.
        let [left, right] = [v - 0.25 * w, v + 0.25 * w].map(|speed| speed / 0.1);
        text += &format!("{},{v},{w},{},{left},{right}\n", 20 * i, -w);
    }
    fs::write(folder.path().join("drive.csv"), text).unwrap();
    let look = json(&run(folder.path(), &["--look", "drive.csv", "--json"]));
    assert_eq!(look["tables"][0]["rows"], 2000);
    let rate_hz = look["tables"][0]["rate_hz"].as_f64().unwrap();
    assert!((rate_hz - 50.0).abs() < 1e-6, "{rate_hz}");
    assert_eq!(look["tables"][0]["columns"][3]["name"], "gyro_z");

    let suggest = ["--suggest", "drive.csv", "--out", "mine", "--json"];
    let suggestion = json(&run(folder.path(), &suggest));
    let unsure = suggestion["unsure"].to_string();
    assert!(
        unsure.contains("taken as positive to the right"),
        "{unsure}"
    );
    // What was corrected by hand is not written over.
    assert_eq!(run(folder.path(), &suggest).status.code(), Some(2));

    let import = [
        "--log",
        "mine-log.toml",
        "--from",
        ".",
        "--out",
        "frames.csv",
        "--json",
    ];
    let imported = json(&run(folder.path(), &import));
    // The last may lie beyond the last row by the rounding of its time.
    let frames = imported["runs"][0]["frames"].as_u64().unwrap();
    assert!((1999..=2000).contains(&frames), "{frames}");
    let agreements = imported["agreements"].as_array().unwrap();
    assert_eq!(agreements.len(), 4);
    for agreement in agreements {
        let ratio = agreement["ratio"].as_f64().unwrap();
        assert!((ratio - 1.0).abs() < 0.02, "{agreement}");
    }
}
