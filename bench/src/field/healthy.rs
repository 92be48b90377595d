//! Healthy runs of the simulated rover as a file of frames, every channel in it.

use std::error::Error;
use std::fs::File;
use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use vigil_blocks::SensorFrame;
use vigil_recording::frames::{Field, fields};
use vigil_sensor_sim::{EffectiveCommand, World};
use vigil_setup::graph_file::Simulator;

use super::course::{Range, course};
use super::ground::stream;
use crate::simulated::Rover;

/// Runs, their length, s, and rate, Hz.
const RUNS: u64 = 15;
const RUN_S: f64 = 20.0;
const RATE_HZ: f64 = 20.0;
/// Seed of the first run; the others follow it. No scenario has one of these.
const FIRST_SEED: u64 = 90_000;

/// Writes runs of random drives, forward and in reverse, on level ground like that learned on.
///
/// # Errors
/// A world that cannot be driven, a file that cannot be written.
pub fn record(rover: &Rover, path: &Path) -> Result<(), Box<dyn Error>> {
    let robot = &rover.robot;
    let columns: Vec<(String, Field)> = fields(robot);
    let mut out = GzEncoder::new(File::create(path)?, Compression::best());
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    writeln!(out, "run,t,{}", names.join(","))?;
    for run in 0..RUNS {
        let seed = FIRST_SEED + run;
        let range = Range {
            command: &rover.model.command,
            robot,
            graph: &[],
        };
        let drive = course("reversals", range, RUN_S, &mut stream(seed, 1))?;
        let mut world = World::new(robot, &Simulator::default(), &drive, RATE_HZ, seed)?;
        let mut frame = SensorFrame::default();
        for k in 1..=(RUN_S * RATE_HZ) as u64 {
            world.step(1.0 / RATE_HZ, EffectiveCommand::as_planned(world.planned()));
            world.measure(&mut frame);
            write!(out, "{run},{:.2}", k as f64 / RATE_HZ)?;
            for (name, field) in &columns {
                let value = field.get(&frame).ok_or_else(|| format!("no {name}"))?;
                write!(out, ",{value:.4}")?;
            }
            writeln!(out)?;
        }
    }
    out.finish()?.sync_all()?;
    Ok(())
}
