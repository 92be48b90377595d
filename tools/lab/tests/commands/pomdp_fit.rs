//! `vigil pomdp fit` as a user runs it.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

use super::workplace::root;

const RECOVERY: &str = "config/rover.recovery.toml";
const HEAD: &str = "{\"format\":\"vigil-missions\",\"version\":1}\n";
/// Two steps of evidence for what is wrong, and one of which nobody knows what was.
const MISSION: &str = "{\"actions\":[\"go_on\",\"go_on\",\"go_on\"],\
    \"observations\":[\"STUCK_NEW\",\"STUCK_NEW\",\"none\"],\
    \"states\":[null,\"STUCK_NEW\",\"STUCK_NEW\",null]}\n";

fn vigil(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    let command = command.arg("pomdp").args(arguments).current_dir(root());
    command.output().unwrap()
}

fn missions(folder: &Path, lines: &str) -> String {
    let path = folder.join("missions.jsonl");
    fs::write(&path, format!("{HEAD}{lines}")).unwrap();
    path.display().to_string()
}

#[test]
fn what_an_action_shows_is_counted_and_written() {
    let folder = TempDir::new().unwrap();
    let missions = missions(folder.path(), MISSION);
    let out = folder.path().join("fitted.toml");
    let out = out.to_str().unwrap();
    let arguments = [
        "fit",
        RECOVERY,
        "--missions",
        &missions,
        "--prior-strength",
        "0",
    ];
    let output = vigil(&[&arguments[..], &["--json", "--out", out]].concat());
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&document["missions"], &document["steps"]),
        (&1.into(), &2.into())
    );
    let chances = document["chances"].as_array().unwrap();
    let sees = chances
        .iter()
        .find(|chance| chance["key"] == "go_on: says something");
    let sees = sees.unwrap();
    assert_eq!(
        (&sees["count"], &sees["visits"]),
        (&2.0.into(), &2.0.into())
    );
    assert_eq!(sees["fitted"], 1.0);
    let shown = String::from_utf8(vigil(&arguments).stdout).unwrap();
    assert!(
        shown.contains("go_on: says something") && shown.contains("2 of 2"),
        "{shown}"
    );
    // What was written makes a model.
    assert_eq!(vigil(&["generate", out]).status.code(), Some(0));
}

#[test]
fn what_cannot_be_counted_is_refused() {
    let folder = TempDir::new().unwrap();
    let unknown = MISSION.replace("\"STUCK_NEW\",\"STUCK_NEW\",null]", "null,null,null]");
    let unknown = missions(folder.path(), &unknown);
    let nowhere = folder.path().join("nowhere.toml");
    let purpose = folder.path().join("purpose.toml");
    fs::write(&purpose, "model = \"weather\"").unwrap();
    let paper = folder.path().join("paper.toml");
    fs::write(&paper, "model = \"navigation\"").unwrap();
    let [nowhere, purpose, paper] = [&nowhere, &purpose, &paper].map(|it| it.to_str().unwrap());
    for (file, wanted) in [
        (RECOVERY, "no step with known states"),
        (nowhere, "cannot be read"),
        (purpose, "unknown variant `weather`"),
        (paper, "allowed are models of exceptions and recovery"),
    ] {
        let output = vigil(&["fit", file, "--missions", &unknown]);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(wanted), "{said}");
    }
}
