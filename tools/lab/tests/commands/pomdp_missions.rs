//! `vigil pomdp missions` as a user sees it.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};
use tempfile::TempDir;

use super::workplace::root;

fn missions(folder: &Path, runs: &[Value]) -> (Output, String) {
    let out = folder.join("missions.jsonl");
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    command.current_dir(root());
    command.args(["pomdp", "missions", "--model", "config/navigation.pomdp"]);
    for (at, run) in runs.iter().enumerate() {
        let path = folder.join(format!("run{at}.json"));
        fs::write(&path, run.to_string()).unwrap();
        command.arg(path);
    }
    let output = command.arg("--json").arg("--out").arg(&out).output();
    let output = output.unwrap();
    (output, fs::read_to_string(&out).unwrap_or_default())
}

fn step(number: u64, belief: u32, action: &str, observation: Option<&str>) -> Value {
    let step = json!({
        "number": number,
        "belief": belief,
        "action": action,
        "observation": observation,
    });
    json!({"t_s": 1.0, "service": "supervisor", "event": "step", "what": "", "step": step})
}

fn run(events: &[Value]) -> Value {
    json!({"schema_version": 1, "graph": "corridor", "events": events})
}

#[test]
fn a_mission_ends_where_the_belief_begins_anew() {
    let folder = TempDir::new().unwrap();
    let restart = |service| json!({"t_s": 2.0, "service": service, "event": "restarted"});
    let first = run(&[
        step(1, 0, "FP", Some("none")),
        step(2, 0, "FP", Some("EPM")),
        // Another's restart changes nothing.
        restart("detector"),
        step(3, 0, "NP", None),
        // What follows is of no known belief.
        step(4, 0, "NP", Some("none")),
        step(5, 1, "FP", Some("none")),
        // Number 6 was overwritten.
        step(7, 1, "FP", Some("none")),
        restart("supervisor"),
        step(1, 1, "FP", Some("EPM")),
    ]);
    // No number follows the last one.
    let last = step(u64::MAX, 2, "FP", Some("none"));
    let second = run(&[step(1, 1, "FP", Some("none")), last]);
    let (output, text) = missions(folder.path(), &[first, second]);
    assert!(output.status.success(), "{output:?}");
    let found: Vec<Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(found[0]["policy"], "runs of corridor");
    let mission = |actions: &[&str], observations: &[&str]| {
        json!({
            "actions": actions,
            "observations": observations,
        })
    };
    assert_eq!(
        found[1..],
        [
            mission(&["FP", "FP"], &["none", "EPM"]),
            mission(&["FP"], &["none"]),
            mission(&["FP"], &["EPM"]),
            mission(&["FP"], &["none"]),
        ]
    );
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    let counts = ["runs", "missions", "steps", "left_out"];
    assert_eq!(
        counts.map(|key| document[key].as_u64().unwrap()),
        [2, 4, 5, 4]
    );
}

#[test]
fn what_is_no_run_or_of_another_model_is_refused_and_nothing_is_written() {
    let folder = TempDir::new().unwrap();
    for (runs, said) in [
        (
            vec![json!({"schema_version": 1, "graph": "rover"})],
            "missing field `events`",
        ),
        (
            vec![json!({"schema_version": 2, "graph": "rover", "events": []})],
            "schema_version 2",
        ),
        (vec![run(&[])], "no step"),
        (
            vec![run(&[step(1, 0, "FLY", Some("none"))])],
            "'FLY' is no action",
        ),
        (
            vec![run(&[step(1, 0, "FP", Some("SUN"))])],
            "'SUN' is no observation",
        ),
    ] {
        let (output, text) = missions(folder.path(), &runs);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{errors}");
        assert!(errors.contains(said) && text.is_empty(), "{errors}");
    }
}
