//! The main job: a wheel sticks, the graph says so and acts.

use crate::harness::{RunningGraph, Summary, binary, eventually, machine, root, shared_machine};

/// What must hold when RM sticks in a running graph.
fn assert_told_and_obeyed(summary: &Summary) {
    let injected = summary.events("injected");
    assert_eq!(injected.len(), 1);
    assert_eq!(injected[0].1, "stuck:RM");
    let alarms = summary.events("alarm");
    assert!(
        !alarms.is_empty() && alarms[0].0 > injected[0].0,
        "alarms: {alarms:?}"
    );
    let diagnoses = summary.events("diagnosis");
    let (_, last) = diagnoses.last().unwrap();
    assert_eq!(last, "RM_STUCK", "diagnoses: {diagnoses:?}");
    assert!(
        diagnoses.iter().all(|(t, _)| *t > injected[0].0),
        "diagnoses: {diagnoses:?}"
    );
    let named = diagnoses
        .iter()
        .find(|(_, what)| what == "RM_STUCK")
        .unwrap()
        .0;
    let acted = |(t, what): &(f64, String)| *t >= injected[0].0 && !what.starts_with("go_on");
    let actions = summary.events("action");
    assert!(
        actions.iter().any(acted),
        "named at {named}, actions: {actions:?}"
    );
    let (_, action) = actions.last().unwrap();
    assert!(!action.starts_with("go_on"), "last action: {action}");
    assert_eq!(summary.events("obeys").last().unwrap().1, *action);
}

#[test]
fn a_stuck_wheel_is_detected_named_and_acted_upon() {
    let _machine = shared_machine();
    let graph = RunningGraph::start("stuck", &["--duration", "9", "--inject", "stuck:RM@3"]);
    let summary = graph.finish();
    assert_told_and_obeyed(&summary);
    let services = summary.json["services"].as_object().unwrap();
    let pids: std::collections::BTreeSet<u64> = services
        .values()
        .map(|s| s["pid"].as_u64().unwrap())
        .collect();
    assert_eq!(pids.len(), 4, "four processes");
    for (name, service) in services {
        assert_eq!(service["core"], service["core_wanted"], "{name}");
        assert_eq!(service["pinned"], true, "{name} is where it was put");
    }
    assert!(summary.json["end_to_end_us"]["n"].as_u64().unwrap() > 800);
}

#[test]
fn a_stuck_wheel_is_named_at_1_khz_too() {
    let _machine = machine();
    let options = [
        "--rate",
        "1000",
        "--duration",
        "8",
        "--inject",
        "stuck:RM@3",
    ];
    assert_told_and_obeyed(&RunningGraph::start("khz", &options).finish());
}

#[test]
fn with_every_channel_a_servo_that_slips_is_named_with_its_angle() {
    let _machine = shared_machine();
    let config = root().join("config/rover-all.toml");
    let options = ["--duration", "9", "--inject", "steer-jump:RF:0.2@3"];
    let summary = RunningGraph::start_with(config, "servo", &options).finish();
    let diagnoses = summary.events("diagnosis");
    assert_eq!(diagnoses.last().unwrap().1, "RF_STEER", "{diagnoses:?}");
    let sizes = summary.events("size");
    let (_, size) = sizes.last().expect("the angle is told");
    assert!(size.contains("RF_STEER"), "{sizes:?}");
    // Nothing that the rover can do remedies it.
    let actions = summary.events("action");
    assert_eq!(actions.last().unwrap().1, "call_for_help", "{actions:?}");
}

#[test]
fn without_a_fault_nothing_is_said() {
    let _machine = machine();
    let summary = RunningGraph::start("quiet", &["--duration", "12"]).finish();
    assert_eq!(summary.events("alarm"), []);
    assert_eq!(summary.events("diagnosis"), []);
    assert_eq!(summary.service("detector", "lost"), 0);
}

#[test]
fn a_fault_injected_at_run_time_is_named_and_its_end_is_seen() {
    let _machine = shared_machine();
    let mut graph = RunningGraph::start("inject", &["--duration", "40"]);
    let name = graph.setup.file.graph.name.clone();
    let observed = graph.observe();
    let mut health = crate::harness::HealthWatch::new(&observed);
    eventually("all services run", || health.all_running().then_some(()));
    let inject = |spec: &str| {
        binary("vigil")
            .args(["inject", "--graph", &name, spec])
            .status()
            .unwrap()
            .code()
    };
    assert_eq!(inject("encoder:LF:zero"), Some(0));
    assert_eq!(
        inject("encoder:XX:zero"),
        Some(2),
        "a wheel that does not exist"
    );
    let mut seen = crate::harness::ModeWatch::new(&observed, &graph.setup);
    eventually("LF_ENC is named", || {
        seen.poll().filter(|mode| mode == "LF_ENC")
    });
    assert_eq!(inject("clear:LF"), Some(0));
    eventually("the rover is nominal again", || {
        seen.poll().filter(|mode| mode == "ND")
    });
    assert!(graph.is_alive());
    graph.interrupt();
    let summary = graph.finish();
    assert_eq!(summary.events("restored").len(), 1);
}
