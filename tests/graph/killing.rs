//! Each service is killed once: it comes back, the graph goes on, nothing is left behind.

use std::process::Command;

use vigil_blocks::{DetectionBelief, FaultBelief};
use vigil_cycle::Topic;

use crate::harness::{
    HealthWatch, ModeWatch, RunningGraph, config_with, drain, eventually, machine, unique,
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

#[test]
fn while_a_service_is_replaced_nobody_drives_on_with_a_stuck_wheel() {
    let _machine = machine();
    let options = ["--duration", "60", "--inject", "stuck:RM@2"];
    let mut graph = RunningGraph::start("replaced", &options);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    let mut seen = ModeWatch::new(&observed, &graph.setup);
    eventually("RM_STUCK is named", || {
        seen.poll().filter(|mode| mode == "RM_STUCK")
    });
    // Each alone; then another while the new detector arms. The robot drives on, and it does arm.
    let mut replace = |service: &str| {
        eventually("all services run", || health.all_running().then_some(()));
        let before = health.poll()[service];
        kill(before.pid);
        eventually("it is restarted and works", || {
            let now = health.poll()[service];
            (now.header.epoch != before.header.epoch && now.cycles > 50).then_some(())
        });
    };
    replace("identifier");
    replace("supervisor");
    replace("detector");
    replace("supervisor");
    let mut detections = observed
        .receiver::<DetectionBelief>(Topic::Detection)
        .unwrap();
    eventually("the new detector raises its alarm", || {
        let mut raised = None;
        drain(detections.as_mut(), |belief| {
            raised = (belief.alarm != 0).then_some(());
        });
        raised
    });
    replace("detector");
    replace("identifier");
    graph.interrupt();
    let actions = graph.finish().events("action");
    let since = actions.iter().skip_while(|action| action.1 == "go_on");
    let since: Vec<&str> = since.map(|action| action.1.as_str()).collect();
    assert!(
        !since.is_empty() && !since.contains(&"go_on"),
        "{actions:?}"
    );
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
