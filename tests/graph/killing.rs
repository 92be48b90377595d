//! Each service is killed once: it comes back, the graph goes on, nothing is left behind.

use std::process::Command;

use crate::harness::{HealthWatch, Running, eventually, machine};

#[test]
fn each_service_killed_once_comes_back_and_nothing_is_left() {
    let _machine = machine();
    let mut graph = Running::start("kill", &["--duration", "60"]);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    let services = ["sensor-sim", "detector", "identifier", "supervisor"];
    for service in services {
        eventually("all services run", || health.all_running().then_some(()));
        let before = health.poll()[service];
        let status = Command::new("kill")
            .args(["-9", &before.pid.to_string()])
            .status()
            .unwrap();
        assert!(status.success());
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
