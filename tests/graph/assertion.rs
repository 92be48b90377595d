//! A service whose assertion fails ends; the robot stops; the second time the graph ends.

use vigil_cycle::failure::Failure;
use vigil_cycle::topic::ServiceName;
use vigil_setup::GraphArgs;

use crate::harness::{Summary, binary, root, shared_machine, unique};

/// What the assertion that fails on purpose leaves in the timeline: text and place.
const TEXT: &str = "an assertion fails because a test wants it (shared/cycle/src/live.rs:";

/// Runs a test's graph in which this service fails an assertion soon after each of its starts,
/// until the launcher ends it.
fn fail(test: &str, service: ServiceName, options: &[&str]) -> String {
    let name = unique(&format!("fails-{test}"));
    let output = binary("vigil-launcher")
        .env("VIGIL_FAILS", service.as_str())
        .args(["--no-blackbox", "--rate", "500", "--duration", "60"])
        .args(["--graph", &name])
        .args(options)
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{text}\n{told}");
    let args = GraphArgs {
        config: root().join("config/rover.toml"),
        graph: Some(name),
        ..GraphArgs::default()
    };
    let domain = args.load().unwrap().domain().unwrap();
    assert!(domain.residue().is_empty(), "nothing is left behind");
    assert_eq!(Failure::take(&domain.failure_file(service)), None);
    text
}

#[test]
fn an_assertion_that_fails_twice_ends_the_graph_whichever_service_it_is() {
    let _machine = shared_machine();
    for service in ServiceName::ALL {
        let name = service.as_str();
        let json = serde_json::from_str(&fail("twice", service, &["--json"])).unwrap();
        let summary = Summary { json };
        assert_eq!(summary.json["ended"], "gave-up", "{name}");
        let gave_up = summary.json["gave_up"].as_str().unwrap();
        let reason = "the same assertion failed again (shared/cycle/src/live.rs:";
        assert!(
            gave_up.starts_with(name) && gave_up.contains(reason),
            "{gave_up}"
        );
        assert_eq!(summary.service(name, "restarts"), 1, "{name}");
        let failures = summary.events("assertion");
        assert_eq!(failures.len(), 2, "{failures:?}");
        let work = match service {
            ServiceName::SensorSim => "at the frame due at ",
            _ => "at input ",
        };
        for (_, what) in &failures {
            assert!(what.contains(TEXT) && what.contains(work), "{what}");
        }
    }
}

#[test]
fn the_robot_stops_when_the_supervisors_assertion_fails() {
    let _machine = shared_machine();
    let summary = Summary {
        json: serde_json::from_str(&fail("stops", ServiceName::Supervisor, &["--json"])).unwrap(),
    };
    let [first, second] = [0, 1].map(|i| summary.events("assertion")[i].0);
    let stops = summary.events("safe-stop");
    let expired = |(t_s, what): &(f64, String)| {
        (first..second).contains(t_s) && what == "the action has expired"
    };
    assert!(stops.iter().any(expired), "{first} {second} {stops:?}");
}

#[test]
fn people_read_the_assertion_in_the_timeline_too() {
    let _machine = shared_machine();
    let text = fail("read", ServiceName::Detector, &[]);
    let told = |line: &str| line.contains("detector    assertion") && line.contains(TEXT);
    assert_eq!(text.lines().filter(|line| told(line)).count(), 2, "{text}");
    assert!(
        text.contains("given up: detector: exit status: 70"),
        "{text}"
    );
}
