//! Each service is killed once: it comes back, the graph goes on, nothing is left behind.

use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

use vigil_blocks::{FaultBelief, RecoveryKind};
use vigil_cycle::Topic;

use crate::harness::{
    ActionWatch, HealthWatch, ModeWatch, RunningGraph, Summary, config_with, drain, eventually,
    machine, unique,
};

#[test]
fn a_restarted_simulator_goes_on_with_its_broken_rover() {
    let _machine = machine();
    let options = ["--duration", "60", "--inject", "encoder:LF:zero@1"];
    let mut graph = RunningGraph::start("resume", &options);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    let mut seen = ModeWatch::new(&observed, &graph.setup);
    let mut is_named = || {
        eventually("LF_ENC is named", || {
            seen.poll().filter(|mode| mode == "LF_ENC")
        })
    };
    is_named();
    eventually("all services run", || health.all_running().then_some(()));
    let before = health.poll()["sensor-sim"];
    kill(before.pid);
    let epoch = eventually("it is restarted", || {
        let epoch = health.poll()["sensor-sim"].header.epoch;
        (epoch != before.header.epoch).then_some(epoch)
    });
    let mut frames = observed.receiver::<FaultBelief>(Topic::Diagnosis).unwrap();
    eventually("the fault is named from the new simulator's frames", || {
        let mut named = None;
        drain(frames.as_mut(), |belief| {
            let name = graph.setup.tree.nodes().get(belief.mode as usize);
            if name.is_some_and(|n| n.name == "LF_ENC") && belief.cause.frame_epoch >= epoch {
                named = Some(());
            }
        });
        named
    });
    assert!(graph.is_alive());
    graph.interrupt();
    let injected: Vec<String> = graph
        .finish()
        .events("injected")
        .into_iter()
        .map(|e| e.1)
        .collect();
    assert_eq!(injected, ["encoder:LF:zero", "encoder:LF:zero"]);
}

/// Kills these services at once, and waits until each works again.
fn replace(health: &mut HealthWatch, services: &[&str]) {
    eventually("all services run", || health.all_running().then_some(()));
    let before = health.poll().clone();
    services.iter().for_each(|name| kill(before[*name].pid));
    eventually("they are restarted and work", || {
        let now = health.poll();
        let works = |name: &&str| {
            let is_new = now[*name].header.epoch != before[*name].header.epoch;
            is_new && now[*name].cycles > 50
        };
        services.iter().all(works).then_some(())
    });
}

/// What was decided in this summary since the first action that is not to go on.
fn decided_since(summary: &Summary) -> Vec<String> {
    let actions = summary.events("action").into_iter().map(|event| event.1);
    let since = actions.skip_while(|action| action == "go_on");
    since.collect()
}

/// Sets of services that die together beside a stuck wheel, one after the other.
const DEATHS: [&[&str]; 5] = [
    &["supervisor"],
    &["detector"],
    &["identifier", "supervisor"],
    &["detector", "identifier"],
    &["detector", "identifier", "supervisor"],
];

#[test]
fn while_services_are_replaced_nobody_drives_on_with_a_stuck_wheel_nor_calls_for_help() {
    replaced_beside_a_stuck_wheel("config/rover.toml".into(), "replaced", &DEATHS);
}

#[test]
fn the_same_holds_where_yaw_rate_and_currents_are_measured_too() {
    replaced_beside_a_stuck_wheel("config/rover-all.toml".into(), "replaced-all", &DEATHS[3..]);
}

fn replaced_beside_a_stuck_wheel(config: PathBuf, name: &str, deaths: &[&[&str]]) {
    let _machine = machine();
    let options = ["--duration", "90", "--inject", "stuck:RM@2"];
    let mut graph = RunningGraph::start_with(config, name, &options);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    let mut actions = ActionWatch::new(&observed);
    actions.wait_for(RecoveryKind::Compensate, Duration::from_millis(500));
    for services in deaths {
        println!("{services:?} die");
        replace(&mut health, services);
        // The robot drives: a detector that was replaced arms, and raises its own alarm.
        actions.wait_for(RecoveryKind::Compensate, Duration::from_secs(4));
    }
    graph.interrupt();
    let summary = graph.finish();
    let since = decided_since(&summary);
    assert!(
        !since.is_empty() && !since.contains(&"go_on".to_owned()),
        "{since:?}"
    );
    assert!(summary.events("latched").is_empty(), "{since:?}");
    let told = summary.events("fault").into_iter().map(|event| event.1);
    let told: Vec<String> = told.filter(|what| what.contains("STUCK")).collect();
    assert_eq!(told, ["RM_STUCK is active"]);
}

#[test]
fn a_call_for_help_stands_while_services_are_replaced_and_is_told_once() {
    let _machine = machine();
    let faults = ["--inject", "stuck:RM@2", "--inject", "stuck:RF@3"];
    let mut graph = RunningGraph::start("called", &[&["--duration", "90"][..], &faults].concat());
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    let mut actions = ActionWatch::new(&observed);
    actions.wait_for(RecoveryKind::CallForHelp, Duration::ZERO);
    for services in [
        &["supervisor"][..],
        &["supervisor", "detector", "identifier"],
    ] {
        replace(&mut health, services);
        actions.wait_for(RecoveryKind::CallForHelp, Duration::ZERO);
    }
    graph.interrupt();
    let summary = graph.finish();
    let since = decided_since(&summary);
    assert!(!since.contains(&"go_on".to_owned()), "{since:?}");
    assert_eq!(since.last().map(String::as_str), Some("call_for_help"));
    assert_eq!(summary.events("latched").len(), 1);
    assert!(summary.events("released").is_empty());
}

pub fn kill(pid: u32) {
    let status = Command::new("kill")
        .args(["-9", &pid.to_string()])
        .status()
        .unwrap();
    assert!(status.success());
}

#[test]
fn each_service_killed_once_comes_back_and_nothing_is_left() {
    let _machine = machine();
    let mut graph = RunningGraph::start("kill", &["--duration", "60"]);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    let services = ["sensor-sim", "detector", "identifier", "supervisor"];
    for service in services {
        eventually("all services run", || health.all_running().then_some(()));
        let before = health.poll()[service];
        kill(before.pid);
        let back = eventually("it is restarted", || {
            let now = health.poll()[service];
            (now.header.epoch != before.header.epoch && now.cycles > 10).then_some(now)
        });
        assert_ne!(back.pid, before.pid);
        let actions = health.poll()["supervisor"].cycles;
        eventually("actions go out again", || {
            (health.poll()["supervisor"].cycles > actions + 10).then_some(())
        });
    }
    assert!(graph.is_alive());
    graph.interrupt();
    let summary = graph.finish();
    for service in services {
        assert_eq!(summary.service(service, "restarts"), 1, "{service}");
    }
    assert_eq!(
        summary.events("diagnosis"),
        [],
        "a restart is no fault of the rover"
    );
}

#[test]
fn a_restarted_service_runs_on_what_the_launcher_has_read() {
    let _machine = machine();
    let folder = std::env::temp_dir().join(unique("read-once"));
    let config = config_with(&folder, |text| text);
    let mut graph = RunningGraph::start_with(config.clone(), "read-once", &["--duration", "60"]);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    eventually("all services run", || health.all_running().then_some(()));
    let text = std::fs::read_to_string(&config).unwrap();
    let edited = text.replace("rate_hz = 100.0", "rate_hz = 50.0");
    assert_ne!(edited, text);
    std::fs::write(&config, edited).unwrap();
    for service in ["detector", "supervisor"] {
        let before = health.poll()[service];
        kill(before.pid);
        let back = eventually("it is restarted", || {
            let now = health.poll()[service];
            (now.header.epoch != before.header.epoch && now.cycles > 10).then_some(now)
        });
        assert_eq!(back.period_ns, 10_000_000, "{service}");
    }
    assert!(graph.is_alive());
    graph.interrupt();
    graph.finish();
    let _ = std::fs::remove_dir_all(folder);
}
