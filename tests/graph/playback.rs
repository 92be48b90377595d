//! Recorded frames from an independent physics engine through the live graph.

use std::collections::BTreeMap;
use std::fs;

use crate::harness::{RunningGraph, machine, root};

/// Labels of the recorded runs: run -> mode.
fn labels() -> BTreeMap<u32, String> {
    let text = fs::read_to_string(root().join("tests/data/rover/learn_runs.csv")).unwrap();
    let columns: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let at = |name: &str| columns.iter().position(|c| *c == name).unwrap();
    let (run, mode) = (at("run"), at("mode"));
    text.lines()
        .skip(1)
        .map(|line| line.split(',').collect::<Vec<_>>())
        .map(|row| (row[run].parse().unwrap(), row[mode].to_owned()))
        .collect()
}

#[test]
fn stuck_wheels_of_recorded_runs_are_named_live() {
    let _machine = machine();
    let labels = labels();
    // One run of each stuck wheel, and a nominal one between them.
    let mut runs: Vec<u32> = ["LF", "LM", "LR", "RF", "RM", "RR"]
        .iter()
        .map(|w| {
            *labels
                .iter()
                .find(|(_, m)| **m == format!("{w}_STUCK"))
                .unwrap()
                .0
        })
        .collect();
    runs.insert(3, *labels.iter().find(|(_, mode)| *mode == "ND").unwrap().0);
    let list = runs
        .iter()
        .map(ToString::to_string)
        .collect::<Vec<_>>()
        .join(",");
    let frames = "tests/data/rover/learn_frames.csv.gz";
    let options = ["--replay", frames, "--runs", &list, "--speed", "20"];
    let summary = RunningGraph::start("playback", &options).finish();
    assert_eq!(summary.json["ended"], "end-of-recording");

    assert_eq!(summary.events("end-of-recording").len(), 1);
    let events = summary.json["events"].as_array().unwrap();
    let mut named: BTreeMap<u32, String> = BTreeMap::new();
    let mut run = 0;
    for event in events {
        let what = event["what"].as_str().unwrap();
        match event["event"].as_str().unwrap() {
            "run" => run = what.parse().unwrap(),
            "diagnosis" => {
                named.insert(run, what.to_owned());
            }
            _ => {}
        }
    }
    let right = runs.iter().filter(|run| match labels[run].as_str() {
        "ND" => !named.contains_key(run),
        mode => named.get(run).is_some_and(|name| name == mode),
    });
    assert!(right.count() >= 6, "named: {named:?}");
}
