//! The page "Your robot in 30 minutes", followed word by word on the Kobuki's data.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

use super::workplace::{data, root, workplace_of};

fn page() -> String {
    fs::read_to_string(root().join("docs/your-robot.md")).unwrap()
}

/// Every command of the page's blocks that needs no publisher, its program first.
fn commands(page: &str) -> Vec<Vec<String>> {
    let blocks = page.split("```").skip(1).step_by(2);
    let is_followed = |block: &&str| {
        block.starts_with("sh") && !block.starts_with("sh not run: needs a publisher")
    };
    let blocks = blocks.filter(is_followed);
    // The first line of a block says what the block is.
    let lines = blocks.flat_map(|block| block.lines().skip(1));
    let lines = lines.map(str::trim);
    let is_command = |line: &&str| line.contains(' ') && !line.contains(", ");
    let words = |line: &str| line.split(' ').map(str::to_owned).collect();
    lines.filter(is_command).map(words).collect()
}

/// The page's file of labels.
fn labels(page: &str) -> String {
    let start = page.find("run,mode,onset_s").unwrap();
    let rest = &page[start..];
    rest[..rest.find("```").unwrap()].to_owned()
}

/// Runs a command of the page in `folder`, with the programs of this build instead of the released
/// ones.
fn follow(command: &[String], folder: &Path) -> Output {
    let vigil = Path::new(env!("CARGO_BIN_EXE_vigil-lab")).with_file_name("vigil");
    let (program, more) = match command[0].as_str() {
        "target/release/vigil" => (vigil, Vec::new()),
        // All that this script does but build and say where the default graph is.
        "scripts/up" => {
            let script = fs::read_to_string(root().join("scripts/up")).unwrap();
            let last = script.lines().last().unwrap();
            assert_eq!(last, "exec \"$root/target/release/vigil\" run \"$@\"");
            let graph = format!("t{}-your-robot", std::process::id());
            let more = ["--json", "--no-blackbox", "--graph", &graph].map(str::to_owned);
            (vigil.with_file_name("vigil-launcher"), more.to_vec())
        }
        other => panic!("what is {other}?"),
    };
    assert!(
        program.exists(),
        "{} is not built: run `cargo build --workspace`",
        program.display()
    );
    let mut command_of_page = Command::new(program);
    command_of_page.args(&command[1..]).args(more);
    command_of_page.env_remove("VIGIL_CONFIG");
    command_of_page.current_dir(folder).output().unwrap()
}

/// First alarm of every run of the verdicts, s, and the mode at its end.
fn verdicts(file: &Path) -> BTreeMap<String, (Option<f64>, String)> {
    let text = fs::read_to_string(file).unwrap();
    let mut found = BTreeMap::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let (alarm, mode) = found
            .entry(cells[0].to_owned())
            .or_insert((None, String::new()));
        if alarm.is_none() && cells[3] == "1" {
            *alarm = Some(cells[1].parse().unwrap());
        }
        cells[4].clone_into(mode);
    }
    found
}

#[test]
fn the_page_names_every_step() {
    let page = page();
    let commands = commands(&page);
    let names: Vec<&str> = commands
        .iter()
        .map(|command| match command[0].as_str() {
            "target/release/vigil" => command[1].as_str(),
            program => program,
        })
        .collect();
    let wanted = [
        "import",
        "init",
        "import",
        "learn",
        "learn",
        "diagnose",
        "evaluate",
        "check",
        "scripts/up",
    ];
    assert_eq!(names, wanted);
    assert_eq!(labels(&page).lines().count(), 5);
}

/// What the page says of a step, besides that it succeeds.
fn check_step(command: &[String], output: &Output) {
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let step = command[1].as_str();
    // Check says with its code whether this machine may run a graph: not the page's affair.
    let codes: &[i32] = if step == "check" { &[0, 1] } else { &[0] };
    let code = output.status.code().unwrap();
    assert!(
        codes.contains(&code),
        "{command:?}: {code} {printed} {errors}"
    );
    match (step, command[2].as_str()) {
        ("learn", "--show") => assert!(
            printed.contains("of each run    the first 60 s"),
            "{printed}"
        ),
        ("learn", _) => {
            assert!(
                errors.contains("less than 600 s"),
                "a short log is told: {errors}"
            );
            check_isolability(&printed);
            for tyre in ["LEFT_TYRE", "RIGHT_TYRE"] {
                let said = format!("{tyre}: recognized by the turns of");
                assert!(printed.contains(&said), "{printed}");
            }
        }
        ("evaluate", _) => {
            let score: Value = serde_json::from_slice(&output.stdout).unwrap();
            assert_eq!(score["false_alarms"]["alarms"], 0);
        }
        ("check", _) => assert!(printed.contains("kobuki"), "{printed}"),
        _ => {}
    }
}

/// The lines of the page are among those printed, but for their last digits: every word is.
fn check_isolability(printed: &str) {
    let page = page();
    let example = page
        .split("```")
        .find(|block| block.contains("faults put into"));
    let words = |text: &str| -> Vec<String> {
        let words = text.split_whitespace();
        let is_name = |word: &&str| word.chars().all(|c| c.is_alphabetic() || c == '_');
        words.filter(is_name).map(str::to_owned).collect()
    };
    let lines: Vec<Vec<String>> = printed.lines().map(words).collect();
    for line in example.unwrap().trim().lines().map(words) {
        let found = lines.iter().any(|of| of.starts_with(&line));
        assert!(found, "{line:?} is not printed: {printed}");
    }
}

/// The recording, played through the real processes: the alarm of the run with a taped wheel.
fn check_replay(output: &Output) {
    let lines = String::from_utf8_lossy(&output.stdout).into_owned();
    let summary: Value = serde_json::from_str(lines.lines().last().unwrap()).unwrap();
    assert_eq!(summary["ended"], "end-of-recording", "{lines}");
    let events = summary["events"].as_array().unwrap();
    let alarms = events.iter().filter(|event| event["event"] == "alarm");
    assert!(alarms.count() > 0, "{lines}");
}

#[test]
fn the_page_can_be_followed_on_the_kobukis_data() {
    let Some(data) = data() else {
        return;
    };
    let folder = workplace_of("kobuki_wheel_fault", &data);
    fs::write(folder.path().join("labels.csv"), labels(&page())).unwrap();
    for command in commands(&page()) {
        let output = follow(&command, folder.path());
        check_step(&command, &output);
        if command[0] == "scripts/up" {
            check_replay(&output);
        }
    }
    let found = verdicts(&folder.path().join("verdicts.csv"));
    assert_eq!(found.len(), 4);
    assert_eq!(
        found["0"],
        (None, "ND".to_owned()),
        "the run without a fault"
    );
    // The first two end where nothing was learned from; of the third nothing was.
    for (run, name) in [("1", "LEFT_TYRE"), ("2", "RIGHT_TYRE"), ("3", "MULTIPLE")] {
        let (alarm_s, mode) = &found[run];
        assert!(
            alarm_s.is_some_and(|t_s| t_s < 40.0),
            "run {run}: {alarm_s:?}"
        );
        assert_eq!(mode, name, "run {run}");
    }
}
