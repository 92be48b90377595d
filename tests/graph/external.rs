//! A publisher outside the graph in the place of sensor-sim.

use std::fs;

use vigil_blocks::SensorFrame;
use vigil_cycle::clock::sleep_until;
use vigil_cycle::{Clock, Monotonic, Stamp, Topic};
use vigil_recording::frames;

use crate::harness::{RunningGraph, config_with, launch, root, shared_machine, unique};

#[test]
fn an_external_publisher_drives_the_graph() {
    let _machine = shared_machine();
    let folder = std::env::temp_dir().join(unique("external"));
    let path = config_with(&folder, |text| {
        text.replace("\"simulator\"", "\"external\"")
    });
    let refused = launch(&path, "external", &["--inject", "stuck:RM@1"]);
    assert_eq!(
        refused.status.code(),
        Some(2),
        "a real robot cannot be broken"
    );

    let mut graph = RunningGraph::start_with(path, "external", &["--duration", "3"]);
    let observed = graph.observe();
    let mut sensor = observed.sender::<SensorFrame>(Topic::Sensor).unwrap();
    let recording = root().join("tests/data/rover/learn_frames.csv.gz");
    let runs = frames::read(&recording, &graph.setup.robot).unwrap();
    let (mut at_ns, period_ns) = (Monotonic.now_ns(), graph.setup.period_ns());
    // The recording goes round for as long as the graph lives: each round is a run of its own.
    for (n, frame) in runs[0].frames.iter().cycle().enumerate() {
        if !graph.is_alive() {
            break;
        }
        *sensor.block() = *frame;
        sensor.block().run_id = 1 + (n / runs[0].frames.len()) as u64;
        let stamp = Stamp {
            t_schedule_ns: at_ns,
            t_capture_ns: frame.header.t_capture_ns,
        };
        sensor.send(stamp, &Monotonic).unwrap();
        at_ns += period_ns;
        sleep_until(at_ns);
    }
    drop((sensor, observed));
    fs::remove_dir_all(&folder).unwrap();
    let summary = graph.finish();
    assert_eq!(summary.json["ended"], "duration");
    assert!(summary.json["services"].get("sensor-sim").is_none());
    assert!(summary.service("supervisor", "cycles") > 200);
    let first = &summary.events("action")[0];
    assert!(first.0.abs() < 1.0 && first.1 == "go_on", "{first:?}");
}
