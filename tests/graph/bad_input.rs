//! Bad input is refused with one precise message and exit code 2, before anything starts.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Output};

use flate2::bufread::GzDecoder;

use crate::harness::{RunningGraph, binary, eventually, launch, root, shared_machine, unique};

/// A copy of `config/` in which one text is replaced.
fn changed(folder: &Path, file: &str, from: &str, to: &str) {
    let copy = |name: &str| {
        let target = folder.join(name);
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        let text = fs::read_to_string(root().join("config").join(name)).unwrap();
        let text = if name == file {
            assert!(text.contains(from), "{file} does not contain '{from}'");
            text.replacen(from, to, 1)
        } else {
            text
        };
        fs::write(target, text).unwrap();
    };
    for name in [
        "rover.toml",
        "rover.pomdp",
        "rover.policy.json",
        "robots/rover.toml",
        "trees/rover.toml",
        "models/rover.toml",
    ] {
        copy(name);
    }
}

fn assert_refused(output: &Output, expected: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(output.stdout.is_empty(), "nothing on standard output");
    for part in expected {
        assert!(message.contains(part), "'{part}' is not in: {message}");
    }
}

/// File, text in it, what replaces it, and what the message names.
const BAD: [(&str, &str, &str, &[&str]); 13] = [
    (
        "rover.toml",
        "rate_hz = 100.0",
        "rate_hz = 0.0",
        &["rover.toml:6", "rate_hz", "1 to"],
    ),
    (
        "rover.toml",
        "seed = 1",
        "seeds = 1",
        &["rover.toml:7", "unknown field `seeds`"],
    ),
    (
        "rover.toml",
        "core = 0,",
        "core = 99,",
        &["services.sensor-sim.core", "99 does not"],
    ),
    (
        "rover.toml",
        "false_alarm_interval_h = 24.0",
        "form = \"chi2\"",
        &["rover.toml:", "`chi2`", "learned-bias"],
    ),
    (
        "rover.toml",
        "priority = 55",
        "priority = 99",
        &["priority", "0 to 90"],
    ),
    (
        "rover.toml",
        "models/rover.toml",
        "models/no.toml",
        &["models/no.toml", "cannot be"],
    ),
    (
        "rover.toml",
        "filter = \"multiple-hypothesis\"",
        "filter = \"x\"",
        &["unknown variant `x`", "multiple-hypothesis"],
    ),
    (
        "robots/rover.toml",
        "mass_kg = 14.2",
        "mass_kg = nan",
        &["robots/rover.toml", "mass_kg"],
    ),
    (
        "trees/rover.toml",
        "\"LSS\"",
        "\"RSS\"",
        &["trees/rover.toml:8", "no node 'LSS'"],
    ),
    (
        "models/rover.toml",
        "robot = \"",
        "robot = \"no-",
        &["models/rover.toml", "was changed or cut short"],
    ),
    (
        "models/rover.toml",
        "interval_s = ",
        "interval_s = x",
        &["models/rover.toml", "line "],
    ),
    (
        "rover.pomdp",
        "states: ND ",
        "states: FINE ",
        &["rover.pomdp:", "'ND', wanted is a state"],
    ),
    (
        "rover.toml",
        "stop = { kind",
        "halt = { kind",
        &["[supervisor.actions]", "'halt'"],
    ),
];

#[test]
fn every_bad_configuration_names_file_line_key_and_what_is_allowed() {
    for (i, (file, from, to, expected)) in BAD.into_iter().enumerate() {
        let folder = std::env::temp_dir().join(unique(&format!("bad{i}")));
        changed(&folder, file, from, to);
        let output = launch(&folder.join("rover.toml"), "bad", &[]);
        fs::remove_dir_all(&folder).unwrap();
        assert_refused(&output, expected);
    }
}

#[test]
fn all_problems_are_reported_at_once() {
    let folder = std::env::temp_dir().join(unique("many"));
    changed(
        &folder,
        "rover.toml",
        "rate_hz = 100.0\nseed = 1",
        "rate_hz = 1e9\nseed = 1",
    );
    let path = folder.join("rover.toml");
    let text = fs::read_to_string(&path)
        .unwrap()
        .replace("ring_s = 3.0", "ring_s = 300.0");
    fs::write(&path, text).unwrap();
    let output = launch(&path, "many", &[]);
    fs::remove_dir_all(&folder).unwrap();
    assert_refused(&output, &["graph.rate_hz", "identifier.ring_s"]);
}

#[test]
fn bad_options_and_recordings_are_refused() {
    let config = root().join("config/rover.toml");
    let frames = std::env::temp_dir().join(unique("frames.csv"));
    let frames_text = frames.display().to_string();
    assert_refused(
        &launch(&config, "o1", &["--inject", "stuck:XX@1"]),
        &["XX", "LF LM LR"],
    );
    assert_refused(
        &launch(&config, "o2", &["--inject", "stuck:RM"]),
        &["stuck:RM"],
    );
    assert_refused(
        &launch(&config, "o3", &["--replay", &frames_text]),
        &["frames.csv"],
    );
    fs::write(&frames, "run,t,x\n0,0.05,1\n").unwrap();
    let missing = ["frames.csv", "yaw", "cmd_curv"];
    assert_refused(
        &launch(&config, "o4", &["--replay", &frames_text]),
        &missing,
    );
    let rover = "tests/data/rover/learn_frames.csv.gz";
    let replay =
        |options: &[&str]| launch(&config, "o5", &[&["--replay", rover], options].concat());
    assert_refused(&replay(&["--runs", "0,99999"]), &[rover, "no run 99999"]);
    assert_refused(&replay(&["--rate", "100"]), &["--rate", "--speed"]);
    assert_refused(
        &replay(&["--inject", "stuck:RM@1"]),
        &["--inject", "simulator"],
    );
    // The header and two rows of that recording, the second row broken.
    let file = fs::File::open(root().join(rover)).unwrap();
    let lines = BufReader::new(GzDecoder::new(BufReader::new(file)))
        .lines()
        .map(Result::unwrap);
    let mut lines: Vec<String> = lines.take(3).collect();
    let (before, _) = lines[2].rsplit_once(',').unwrap();
    lines[2] = format!("{before},NaN");
    fs::write(&frames, lines.join("\n")).unwrap();
    assert_refused(
        &launch(&config, "o6", &["--replay", &frames_text]),
        &["frames.csv", "row 2", "NaN"],
    );
    fs::remove_file(&frames).unwrap();
}

#[test]
fn a_second_graph_of_the_same_name_is_refused_and_the_first_goes_on() {
    let _machine = shared_machine();
    let mut first = RunningGraph::start("twice", &["--duration", "30"]);
    let observed = first.observe();
    let mut health = crate::harness::HealthWatch::new(&observed);
    eventually("all services run", || health.all_running().then_some(()));
    let second = launch(&root().join("config/rover.toml"), "twice", &[]);
    assert_refused(&second, &[&first.setup.file.graph.name, "running"]);
    let cycles = health.poll()["supervisor"].cycles;
    eventually("the first goes on", || {
        (health.poll()["supervisor"].cycles > cycles).then_some(())
    });
    assert!(first.is_alive());
    first.interrupt();
    let summary = first.finish();
    for name in ["sensor-sim", "detector", "identifier", "supervisor"] {
        assert_eq!(summary.service(name, "restarts"), 0);
    }
}

/// The words of `scripts/up`, on a machine without Rust.
fn up(words: &[&str]) -> Output {
    let mut command = Command::new(root().join("scripts/up"));
    let command = command.args(words).env("PATH", "/usr/bin:/bin");
    command.env("CARGO_HOME", "/nonexistent").output().unwrap()
}

#[test]
fn help_and_misspelt_options_need_no_build() {
    let help = up(&["--duration", "5", "--help"]);
    assert_eq!(help.status.code(), Some(0), "{help:?}");
    let mut launcher = binary("vigil-launcher");
    let launcher = launcher.arg("--help").env_remove("VIGIL_CONFIG");
    let launcher = launcher.env_remove("COLUMNS");
    let launcher = launcher.output().unwrap();
    let help = String::from_utf8_lossy(&help.stdout);
    let launcher = String::from_utf8_lossy(&launcher.stdout);
    assert!(
        help.ends_with(launcher.as_ref()),
        "write it anew: env -u COLUMNS target/debug/vigil-launcher --help </dev/null 2>/dev/null \
         >scripts/up.help"
    );
    for wrong in ["--duratoin", "--durat", "--sources=external"] {
        let refused = up(&[wrong, "5"]);
        assert_eq!(refused.status.code(), Some(2), "{refused:?}");
        let message = String::from_utf8_lossy(&refused.stderr);
        assert!(message.contains("unknown option --"), "{message}");
    }
    for right in ["--duration=5", "--rate", "--keep-awake"] {
        let help = up(&[right, "--help"]);
        assert_eq!(help.status.code(), Some(0), "{help:?}");
    }
}
