//! The chains of processes and threads, run for real: every carrier hands on every block.
#![cfg(test)]

use std::process::Command;

use serde_json::Value;
use vigil_bench::results::Run;

const CARRIERS: [&str; 5] = ["futex", "shared-memory", "datagram", "pipe", "queue"];

/// The rows of a result.
fn rows(printed: &[u8]) -> Vec<Value> {
    let mut run: Run = serde_json::from_slice(printed).unwrap();
    serde_json::from_value(run.figures["peers.json"].take()).unwrap()
}

#[test]
fn every_carrier_hands_blocks_through_four_stages() {
    let output = Command::new(env!("CARGO_BIN_EXE_vigil-bench"))
        .arg("peers")
        .args(["--rate", "100", "--seconds", "1.5", "--rounds", "1"])
        .args(["--bytes", "4096", "--load", "idle", "--json"])
        .output()
        .expect("the program starts");
    assert!(output.status.success(), "{output:?}");
    let rows = rows(&output.stdout);
    let carriers: Vec<&str> = rows.iter().filter_map(|r| r["carrier"].as_str()).collect();
    assert_eq!(carriers, CARRIERS);
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
    let output = Command::new(env!("CARGO_BIN_EXE_vigil-bench"))
        .arg("peers")
        .args(["--rate", "100", "--seconds", "1", "--rounds", "1"])
        .args(["--bytes", "1000", "--load", "idle", "--json"])
        .output()
        .expect("the program starts");
    let rows = rows(&output.stdout);
    let shared = rows.iter().find(|row| row["carrier"] == "shared-memory");
    let failed = shared.unwrap()["failed"].as_str().unwrap();
    assert!(failed.contains("no block of 1000 bytes"), "{failed}");
    let failed = rows.iter().filter(|row| row["failed"].is_string()).count();
    assert_eq!(failed, 1);
}
