//! The page "More robots that ship", followed on public logs.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::workplace::{commands, data, root, workplace_of};

/// Unpacks a log and follows its section; the verdicts, or nothing without `VIGIL_DATA`.
fn followed(section: &str, log: &str) -> Option<(String, String)> {
    let folder = workplace_of(log, &data()?);
    let page = fs::read_to_string(root().join("docs/more-robots.md")).unwrap();
    let mut sections = page.split("\n## ").skip(1);
    let own = sections.find(|text| text.starts_with(section)).unwrap();
    let commands = commands(own);
    let names: Vec<&str> = commands.iter().map(|words| words[0].as_str()).collect();
    assert_eq!(names, ["import", "learn", "diagnose"]);
    let vigil = Path::new(env!("CARGO_BIN_EXE_vigil-lab")).with_file_name("vigil");
    let mut printed = String::new();
    for words in &commands {
        let mut command = Command::new(&vigil);
        let output = command.args(words).current_dir(folder.path()).output();
        let output = output.unwrap();
        assert!(output.status.success(), "{words:?}: {output:?}");
        printed += &String::from_utf8_lossy(&output.stdout);
    }
    let verdicts = folder.path().join(commands[2].last().unwrap());
    Some((printed, fs::read_to_string(verdicts).unwrap()))
}

/// Runs with an alarm.
fn alarmed(verdicts: &str) -> usize {
    let rows = verdicts.lines().skip(1).map(|line| line.split(','));
    let alarms = rows.filter_map(|mut cells| {
        let run = cells.next()?;
        (cells.nth(2)? == "1").then_some(run)
    });
    alarms.collect::<std::collections::BTreeSet<_>>().len()
}

#[test]
fn a_husky_is_learned_from_its_log_and_healthy_in_it() {
    let Some((printed, verdicts)) = followed("Husky", "husky_boreal") else {
        return;
    };
    for wanted in [
        "husky at 6.5 Hz",
        "SNOW/pro_09.csv",
        "yaw_rate",
        "current_R",
    ] {
        assert!(printed.contains(wanted), "{wanted}: {printed}");
    }
    assert_eq!(alarmed(&verdicts), 0);
}

#[test]
fn a_robotino_is_learned_from_its_log_and_healthy_in_it() {
    let Some((printed, verdicts)) = followed("Robotino", "robotino_slip") else {
        return;
    };
    for wanted in ["robotino at 32 Hz", "learned from 432 runs", "drive_C"] {
        assert!(printed.contains(wanted), "{wanted}: {printed}");
    }
    assert!(alarmed(&verdicts) <= 1, "{}", alarmed(&verdicts));
}
