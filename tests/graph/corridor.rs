//! The paper's two stories through the four processes.

use std::fs;

use crate::harness::{RunningGraph, Summary, binary, shared_machine};

/// Decisions, symptoms, outcomes and the goal, in order, from the first decision on.
fn story(summary: &Summary) -> Vec<String> {
    let events = summary.json["events"].as_array().unwrap();
    let text = |event: &serde_json::Value, key: &str| event[key].as_str().unwrap().to_owned();
    let told = events
        .iter()
        .filter_map(|event| match event["event"].as_str()? {
            "action" => Some(text(event, "what")),
            "outcome" => Some(text(event, "what")),
            "goal" => Some("goal".to_owned()),
            _ => None,
        });
    told.collect()
}

fn assert_fired(summary: &Summary, first: &str) {
    let fired = summary.events("symptoms");
    assert_eq!(fired[0].1, first, "{fired:?}");
}

#[test]
fn a_blocked_corridor_is_tried_and_gone_round_live() {
    let _machine = shared_machine();
    let config = "config/corridor-obstacle.toml".into();
    let summary = RunningGraph::start_with(config, "obstacle", &["--duration", "40"]).finish();
    let told = story(&summary);
    let ends = ["NP", "alternative path", "FP", "goal"].map(str::to_owned);
    assert!(told.ends_with(&ends), "{told:?}");
    assert_fired(&summary, "EPM");
    assert_eq!(summary.events("alarm"), []);
    let obeyed: Vec<String> = summary
        .events("obeys")
        .into_iter()
        .map(|(_, w)| w)
        .collect();
    let decided = summary.events("action");
    let decided: Vec<String> = decided.into_iter().map(|(_, w)| w).collect();
    assert_eq!(obeyed, decided);
    assert!(!decided.contains(&"SH".to_owned()), "{decided:?}");
    assert_each_decision_is_weighed(&summary);
    assert_makes_a_mission(&summary);
}

/// What a decision was weighed from stands beside it.
fn assert_each_decision_is_weighed(summary: &Summary) {
    let events = summary.json["events"].as_array().unwrap();
    let of_supervisor = events.iter().filter(|e| e["service"] == "supervisor");
    let names: Vec<&str> = of_supervisor.filter_map(|e| e["event"].as_str()).collect();
    let decisions = names.iter().filter(|name| **name == "action").count();
    let pairs = names.windows(2).filter(|two| *two == ["action", "weighed"]);
    assert!(decisions > 1, "{names:?}");
    assert_eq!(pairs.count(), decisions, "{names:?}");
}

/// The steps of a run are a mission to learn from.
fn assert_makes_a_mission(summary: &Summary) {
    let folder = tempfile::tempdir().unwrap();
    let [run, missions] = ["run.json", "missions.jsonl"].map(|name| folder.path().join(name));
    fs::write(&run, summary.json.to_string()).unwrap();
    let mut command = binary("vigil-lab");
    command.args(["pomdp", "missions", "--model", "config/corridor.pomdp"]);
    let status = command.arg(&run).arg("--out").arg(&missions).status();
    assert!(status.unwrap().success());
    let mut command = binary("vigil-lab");
    let learn = ["pomdp", "learn", "config/corridor.pomdp", "--unchecked"];
    command.args(learn).arg("--missions").arg(&missions);
    let options = ["--iterations", "1", "--episodes", "2", "--out"];
    let learned = folder.path().join("learned.pomdp");
    assert!(
        command
            .args(options)
            .arg(learned)
            .output()
            .unwrap()
            .status
            .success()
    );
    let text = fs::read_to_string(&missions).unwrap();
    let lines: Vec<serde_json::Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let [head, mission] = &lines[..] else {
        panic!("one mission: {text}");
    };
    assert_eq!(head["format"], "vigil-missions");
    let (mut actions, mut observations) = (Vec::new(), Vec::new());
    let events = summary.json["events"].as_array().unwrap();
    for event in events.iter().filter(|event| event["event"] == "step") {
        actions.push(event["step"]["action"].clone());
        observations.push(event["step"]["observation"].clone());
    }
    assert!(observations.contains(&"EPM".into()), "{observations:?}");
    assert_eq!(mission["actions"], serde_json::Value::from(actions));
    assert_eq!(
        mission["observations"],
        serde_json::Value::from(observations)
    );
}

#[test]
fn people_in_a_corridor_are_waited_for_and_passed_live() {
    let _machine = shared_machine();
    let config = "config/corridor-people.toml".into();
    let summary = RunningGraph::start_with(config, "people", &["--duration", "40"]).finish();
    let told = story(&summary);
    let ends = ["GO", "blockage overtaken", "FP", "goal"].map(str::to_owned);
    assert!(told.ends_with(&ends), "{told:?}");
    assert!(!told.contains(&"SH".to_owned()), "{told:?}");
    assert_fired(&summary, "EPM");
    assert_eq!(summary.events("alarm"), []);
}
