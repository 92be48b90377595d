//! Questions of the bench that start processes, asked briefly: what they measure is there.

use serde_json::Value;

use crate::harness::{binary, machine};

/// The figures of a question's result.
fn figures(arguments: &[&str]) -> Value {
    let output = binary("vigil-bench")
        .args(arguments)
        .arg("--json")
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let mut run: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(run["raw"], serde_json::json!([]), "something is archived");
    run["figures"].take()
}

/// Each carrier's row of `peers`, for blocks of `bytes`.
fn carriers(bytes: &str) -> Vec<Value> {
    let brief = "peers --rate 100 --seconds 1.5 --rounds 1 --load idle --bytes";
    let arguments: Vec<&str> = brief.split(' ').chain([bytes]).collect();
    serde_json::from_value(figures(&arguments)["peers.json"].take()).unwrap()
}

#[test]
fn a_black_box_in_each_state_is_measured_against_the_same_rounds_without_it() {
    let _machine = machine();
    let brief = "blackbox --rate 100 --seconds 2 --rounds 1";
    let found = figures(&brief.split(' ').collect::<Vec<_>>());
    for state in ["off", "on", "stopped", "killed"] {
        let found = &found["blackbox.json"]["states"][state];
        // One instant a period.
        let cycles = found["cycles"].as_u64().unwrap();
        assert!((199..=201).contains(&cycles), "{state}: {cycles}");
        let figure = |name: &str| found[name].as_f64().unwrap();
        assert!(figure("p50_us") > 0.0 && figure("p99_us") >= figure("p50_us"));
        let is_there = figure("memory_bytes") > 0.0 && figure("ring_bytes") > 0.0;
        assert_eq!(is_there, state != "off", "{state}");
        let ratio = found["p50_over_off"]["mean"].as_f64().unwrap();
        assert_eq!(state == "off", ratio == 1.0, "{state}: {ratio}");
    }
}

#[test]
fn every_carrier_hands_blocks_through_four_stages() {
    let _machine = machine();
    let rows = carriers("4096");
    let names: Vec<&str> = rows.iter().filter_map(|r| r["carrier"].as_str()).collect();
    let all = ["futex", "shared-memory", "datagram", "pipe", "queue"];
    assert_eq!(names, all);
    for row in &rows {
        let n = |part: &str| row[part]["n"].as_u64().unwrap_or(0);
        // One instant a period after the warm-up, whether answered in time or not; most of them by
        // all stages.
        assert!((50..=101).contains(&n("end_to_end_us")), "{row}");
        assert!(2 * n("hand_over_us") > n("end_to_end_us"), "{row}");
        let p50 = |part: &str| row[part]["p50"].as_f64().unwrap();
        assert!(p50("hand_over_us") > 0.0, "{row}");
        assert!(p50("end_to_end_us") >= p50("hand_over_us"), "{row}");
    }
}

#[test]
fn what_a_carrier_cannot_do_is_a_row_with_its_reason() {
    let _machine = machine();
    let rows = carriers("1000");
    let shared = rows.iter().find(|row| row["carrier"] == "shared-memory");
    let failed = shared.unwrap()["failed"].as_str().unwrap();
    assert!(failed.contains("no block of 1000 bytes"), "{failed}");
    let failed = rows.iter().filter(|row| row["failed"].is_string()).count();
    assert_eq!(failed, 1);
}
