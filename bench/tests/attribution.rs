//! Stalls of known origin in the real graph: the report says whose they were.

#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::process::Command;

use serde_json::Value;

#[test]
fn a_stopped_stage_is_vigils_own_and_a_kept_core_the_machines() {
    let output = Command::new(env!("CARGO_BIN_EXE_vigil-bench"))
        .arg("attribution")
        .args(["--rate", "100", "--stalls", "4", "--length-us", "60000"])
        .args(["--load", "idle", "--json"])
        .output()
        .expect("the program starts");
    let said = String::from_utf8_lossy(&output.stderr);
    if said.contains("may not") {
        eprintln!("SKIPPED: real-time priority is not permitted; nothing is attributed: {said}");
        return;
    }
    assert!(output.status.success(), "{said}");
    let rows: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    let origins: Vec<&str> = rows.iter().filter_map(|r| r["origin"].as_str()).collect();
    assert_eq!(origins, ["vigil", "machine"]);
    for (row, right, wrong) in [(&rows[0], "ours", "machine"), (&rows[1], "machine", "ours")] {
        assert_eq!((&row["stalls"], &row["unseen"]), (&4.into(), &0.into()));
        let within = |key: &str| row["missed_within"][key].as_u64().unwrap();
        // 60 ms are six periods. What the machine itself does meanwhile adds some of its own.
        assert!(within(right) >= 4 * 4, "{row}");
        assert!(within(wrong) < within(right), "{row}");
    }
}
