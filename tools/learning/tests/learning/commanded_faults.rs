//! Declared faults whose effect depends on the command.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_learning::channel_learning::{LabelledRun, Log, learn};
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::{Model, Monitor, Observer, components};
use vigil_robot::learned::channels::Channels;

const RATE_HZ: f64 = 50.0;
const ONSET_S: f64 = 20.0;
const NOISE: f64 = 0.05;

/// A boat with one command, whose rudders pull to either side as it drives ahead or back.
fn robot() -> Description {
    toml::from_str(
        r#"
name = "boat"
kinematics = "none"
command = [{ name = "v", unit = "m/s", limit = 1.0 }]
measured = { pose = false, wheel_rates = false, steer = false }
polynomial_order = 1
channel = [{ name = "speed" }, { name = "sway" }, { name = "roll" }]
fault = [{ name = "port" }, { name = "starboard" }]
"#,
    )
    .unwrap()
}

/// A run at a speed; from the onset on it is pushed aside by `pull` times that speed.
fn run(id: u32, speed: impl Fn(f64) -> f64, pull: f64) -> Run {
    let mut rng = Pcg64Mcg::seed_from_u64(u64::from(id));
    let mut frames = Vec::new();
    for i in 0..(40.0 * RATE_HZ) as u64 {
        let t_s = i as f64 / RATE_HZ;
        let v = speed(t_s);
        let pulled = if t_s >= ONSET_S { pull * v } else { 0.0 };
        let mut frame = SensorFrame::default();
        frame.header.t_capture_ns = (t_s * 1e9) as u64;
        (frame.header.seq, frame.run_id) = (i, u64::from(id) + 1);
        frame.set_command(0, v);
        for (channel, mean) in [v, pulled, 0.5 * pulled.abs()].into_iter().enumerate() {
            frame.set_channel(channel, mean + NOISE * rng.sample::<f64, _>(StandardNormal));
        }
        frames.push(frame);
    }
    Run { id, frames }
}

/// A constant speed for each run, ahead and back.
fn speed_of(id: u32) -> f64 {
    let size = 0.4 + 0.15 * f64::from(id % 4);
    if id.is_multiple_of(2) { size } else { -size }
}

fn learned(robot: &Description) -> Model {
    let healthy: Vec<Run> = (100..120)
        .map(|id| run(id, |t_s| (0.3 * t_s + f64::from(id)).sin(), 0.0))
        .collect();
    let faults = [("port", 0.3), ("starboard", -0.3)];
    let runs: Vec<(Run, &str)> = (0..24)
        .map(|id| {
            let (fault, pull) = faults[(id / 12) as usize];
            (run(id, |_| speed_of(id), pull), fault)
        })
        .collect();
    let labelled = runs.iter().map(|(run, fault)| LabelledRun {
        run,
        fault,
        onset_s: ONSET_S,
    });
    let labelled: Vec<LabelledRun<'_>> = labelled.collect();
    let log = Log {
        labelled: &labelled,
        ..Log::of_healthy(&healthy)
    };
    let (model, report) = learn(&log, robot).unwrap();
    assert!(
        report.faults.iter().all(|fit| fit.is_used),
        "{:?}",
        report.faults
    );
    model
}

#[test]
fn faults_that_pull_one_way_ahead_and_the_other_way_back_are_told_apart() {
    let robot = robot();
    let model = learned(&robot);
    let parts = components(&robot);
    for (id, pull, expected) in [
        (200, 0.3, "port"),
        (201, 0.3, "port"),
        (202, -0.3, "starboard"),
        (203, -0.3, "starboard"),
    ] {
        let mut monitor = Monitor::new(&model, &robot, Channels::PoseEncoders, 1.0).unwrap();
        let mut observer = Observer::new(&robot);
        for frame in &run(id, |_| speed_of(id), pull).frames {
            if observer.push(frame).complete {
                monitor.step(observer.history(), observer.orders());
            }
        }
        let beliefs = monitor.beliefs().iter().zip(&parts);
        let best = beliefs.max_by(|a, b| a.0.p.total_cmp(&b.0.p)).unwrap();
        assert_eq!(best.1.name, expected, "{id}: {:?}", best.0);
        assert!(best.0.p > 0.9, "{id}: {:?}", best.0);
    }
}
