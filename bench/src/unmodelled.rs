//! Disturbances that no model contains, through detector and identifier.

mod grid;
mod nominal;
mod outcome;
mod report;

pub use grid::{Cell, cells};
pub use nominal::{Nominal, RUN_S, drive_nominal, share_soon};
pub use outcome::{Run, Verdict};
pub use report::{Band, Totals, bands, by_kind, excluded, totals};

use std::error::Error;

use vigil_robot::Injection;
use vigil_setup::schema::Simulator;

use crate::noncentrality::{self, Follower};
use crate::simulated::{Chain, Conditions, Rover, SENSOR_SETS, constant, weaving};

/// Noncentrality over [`WINDOW_S`] below which a cell is not judged.
pub const NONCENTRALITY_MIN: f64 = 25.0;
/// Time after the onset over which noncentrality adds up, and within which a detection counts, s.
pub const WINDOW_S: f64 = 2.0;
/// Times after the onset at which the diagnosis is judged, s; the first counts from the detection.
pub const JUDGED_S: [f64; 3] = [2.0, 5.0, 10.0];
/// Rate at which noncentrality is computed, Hz: the interval of the model.
const FOLLOW_HZ: f64 = 20.0;

/// Runs one cell with one seed at a rate, with both sets of sensors.
///
/// # Errors
/// A cell that cannot be driven.
pub fn run_cell(
    rover: &Rover,
    cell: &Cell,
    rate_hz: f64,
    seed: u64,
) -> Result<Vec<Run>, Box<dyn Error>> {
    let change = Injection::parse_change(&cell.spec, &rover.robot)?;
    // Onsets spread over 3 to 5 s, the same with and without noise.
    let onset_s = 3.0 + 2.0 * ((seed as f64 * 0.618_033_988_75) % 1.0);
    let drive = match cell.weaves {
        true => weaving(cell.curvature_1_m, cell.speed_m_s),
        false => constant(cell.curvature_1_m, cell.speed_m_s),
    };
    let conditions = |noise_scale, rate_hz| Conditions {
        simulator: Simulator {
            noise_scale,
            ..Simulator::default()
        },
        drive: drive.clone(),
        rate_hz,
        seed,
    };
    let follow = |changes: &[(vigil_robot::injection::Change, f64)]| {
        let mut follower = Follower::new(rover);
        let silent = conditions(0.0, FOLLOW_HZ);
        let take = |_, frame: &_| follower.take(frame);
        silent.drive(rover, onset_s + WINDOW_S, changes, take)?;
        Ok::<_, Box<dyn Error>>(follower)
    };
    let (healthy, faulty) = (follow(&[])?, follow(&[(change, onset_s)])?);
    let first = (onset_s * FOLLOW_HZ).ceil() as usize;
    let last = first + (WINDOW_S * FOLLOW_HZ) as usize;
    let noncentrality = noncentrality::between(&healthy, &faulty, first, last);

    let mut chains = Vec::new();
    for (sensors, name) in SENSOR_SETS {
        let chain = Chain::new(rover, sensors, seed)?;
        chains.push((chain, Run::new(cell, name, rate_hz, seed, onset_s)));
    }
    let duration_s = onset_s + JUDGED_S[2] + 2.0 / rate_hz;
    let conditions = conditions(1.0, rate_hz);
    let world = conditions.drive(rover, duration_s, &[(change, onset_s)], |t_s, frame| {
        for (chain, run) in &mut chains {
            let alarm = chain.take(frame);
            run.take(t_s, alarm, || chain.said());
        }
    })?;
    let runs = chains.into_iter().zip(noncentrality);
    Ok(runs
        .map(|((_, mut run), noncentrality)| {
            run.noncentrality = noncentrality;
            run.unsolved = world.unsolved();
            run
        })
        .collect())
}
