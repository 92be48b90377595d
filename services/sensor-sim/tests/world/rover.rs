//! The reference rover and ways to drive it.

use std::path::Path;

use vigil_blocks::SensorFrame;
use vigil_robot::{Description, Fault, FaultKind};
use vigil_sensor_sim::{EffectiveCommand, World};
use vigil_setup::graph_file::{DriveSegment, Simulator};

pub const NAMES: [&str; 6] = ["LF", "LM", "LR", "RF", "RM", "RR"];

pub fn robot() -> Description {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/robots/rover.toml");
    vigil_setup::load_robot(&path).unwrap()
}

pub fn even_soil() -> Simulator {
    Simulator {
        friction_scatter: 0.0,
        ..Simulator::default()
    }
}

pub fn segment(duration_s: f64, curvature_1_m: f64, speed_m_s: f64) -> DriveSegment {
    DriveSegment {
        duration_s,
        curvature_1_m,
        speed_m_s,
    }
}

/// A world on even soil that drives one curvature at 0.2 m/s.
pub fn steady(curvature_1_m: f64, rate_hz: f64) -> World {
    let drive = [segment(1e6, curvature_1_m, 0.2)];
    World::new(&robot(), &even_soil(), &drive, rate_hz, 1).unwrap()
}

pub fn fault(kind: FaultKind, wheel: usize) -> Fault {
    Fault { kind, wheel }
}

/// Drives as planned for `steps` steps at `rate_hz`.
pub fn drive(world: &mut World, rate_hz: f64, steps: usize) {
    for _ in 0..steps {
        let command = EffectiveCommand::as_planned(world.planned());
        world.step(1.0 / rate_hz, command);
    }
}

pub fn measure(world: &mut World) -> SensorFrame {
    let mut frame = SensorFrame::default();
    world.measure(&mut frame);
    frame
}

/// Every number of a frame that must always be finite.
pub fn all_finite(frame: &SensorFrame) -> bool {
    let arrays: [&[f64]; 3] = [&frame.command, &frame.channel, &frame.planned_pose];
    arrays.concat().iter().all(|value| value.is_finite())
}
