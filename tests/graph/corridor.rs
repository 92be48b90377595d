//! The paper's two stories through the four processes.

use crate::harness::{RunningGraph, Summary, machine};

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
    let _machine = machine();
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
}

#[test]
fn people_in_a_corridor_are_waited_for_and_passed_live() {
    let _machine = machine();
    let config = "config/corridor-people.toml".into();
    let summary = RunningGraph::start_with(config, "people", &["--duration", "40"]).finish();
    let told = story(&summary);
    let ends = ["GO", "blockage overtaken", "FP", "goal"].map(str::to_owned);
    assert!(told.ends_with(&ends), "{told:?}");
    assert!(!told.contains(&"SH".to_owned()), "{told:?}");
    assert_fired(&summary, "EPM");
    assert_eq!(summary.events("alarm"), []);
}
