//! The page "Your robot in 30 minutes", followed word by word on the Kobuki's data.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn page() -> String {
    fs::read_to_string(root().join("docs/your-robot.md")).unwrap()
}

/// The page's commands to `vigil`, without the program's name.
fn commands(page: &str) -> Vec<Vec<String>> {
    let lines = page.lines();
    let arguments = lines.filter_map(|line| line.strip_prefix("target/release/vigil "));
    arguments
        .map(|line| line.split(' ').map(str::to_owned).collect())
        .collect()
}

/// The page's file of labels.
fn labels(page: &str) -> String {
    let start = page.find("run,mode,onset_s").unwrap();
    let rest = &page[start..];
    rest[..rest.find("```").unwrap()].to_owned()
}

fn follow(arguments: &[String], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil"));
    command
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// A folder that looks like the project's, with the unpacked log in it.
fn workplace(data: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::os::unix::fs::symlink(
        root().join("config").canonicalize().unwrap(),
        folder.path().join("config"),
    )
    .unwrap();
    let packed = Path::new(data).join("real/kobuki_wheel_fault.tar.xz");
    let mut tar = Command::new("tar");
    tar.arg("-xJf").arg(&packed).arg("-C").arg(folder.path());
    assert!(tar.status().unwrap().success(), "{}", packed.display());
    folder
}

/// First alarm of every run of the verdicts, s.
fn first_alarms(verdicts: &Path) -> BTreeMap<String, Option<f64>> {
    let text = fs::read_to_string(verdicts).unwrap();
    let mut found = BTreeMap::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let alarm = found.entry(cells[0].to_owned()).or_insert(None);
        if alarm.is_none() && cells[3] == "1" {
            *alarm = Some(cells[1].parse().unwrap());
        }
    }
    found
}

#[test]
fn the_page_names_every_step() {
    let names: Vec<String> = commands(&page())
        .into_iter()
        .map(|mut c| c.remove(0))
        .collect();
    let wanted = ["import", "learn", "learn", "diagnose", "evaluate", "check"];
    assert_eq!(names, wanted);
    assert_eq!(labels(&page()).lines().count(), 5);
}

#[test]
fn the_page_can_be_followed_on_the_kobukis_data() {
    let Ok(data) = std::env::var("VIGIL_DATA") else {
        eprintln!("SKIPPED: VIGIL_DATA is not set");
        return;
    };
    let folder = workplace(&data);
    fs::write(folder.path().join("labels.csv"), labels(&page())).unwrap();
    let mut score = None;
    for arguments in commands(&page()) {
        // Whether this machine may run a graph is not the page's affair.
        if arguments[0] == "check" {
            continue;
        }
        let output = follow(&arguments, folder.path());
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments:?}: {errors}");
        if arguments[..2] == ["learn", "--show"] {
            let shown = String::from_utf8_lossy(&output.stdout);
            assert!(shown.contains("of each run    the first 40 s"), "{shown}");
        } else if arguments[0] == "learn" {
            assert!(
                errors.contains("less than 600 s"),
                "a short log is told: {errors}"
            );
        }
        if arguments[0] == "evaluate" {
            score = Some(serde_json::from_slice::<Value>(&output.stdout).unwrap());
        }
    }
    let alarms = first_alarms(&folder.path().join("verdicts.csv"));
    assert_eq!(alarms.len(), 4);
    assert_eq!(alarms["0"], None, "the run without a fault");
    for run in ["1", "2", "3"] {
        let first_s = alarms[run].unwrap_or(f64::INFINITY);
        assert!(first_s < 40.0, "run {run}: {first_s} s");
    }
    assert!(score.is_some());
}
