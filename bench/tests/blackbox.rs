//! The black box beside a graph, in each of its states, for real.

use std::process::Command;

use vigil_bench::results::Run;

#[test]
fn each_state_is_measured_against_the_same_rounds_without_a_black_box() {
    let program = env!("CARGO_BIN_EXE_vigil-bench");
    let beside = std::path::Path::new(program).with_file_name("vigil-blackbox");
    assert!(
        beside.exists(),
        "build the workspace: {beside:?} is missing"
    );
    let output = Command::new(program)
        .args([
            "blackbox",
            "--rate",
            "100",
            "--seconds",
            "2",
            "--rounds",
            "1",
            "--json",
        ])
        .output()
        .expect("the program starts");
    assert!(output.status.success(), "{output:?}");
    let run: Run = serde_json::from_slice(&output.stdout).unwrap();
    assert!(run.raw.is_empty(), "nothing is archived: {:?}", run.raw);
    let document = &run.figures["blackbox.json"];
    for state in ["off", "on", "stopped", "killed"] {
        let found = &document["states"][state];
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
