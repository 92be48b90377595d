//! Driving without a fault: who cries wolf?

use std::error::Error;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_setup::schema::{DriveSegment, Simulator};

use crate::simulated::{Chain, Conditions, Rover, SENSOR_SETS};

/// Length of one run, s. Noise, soil and drive are drawn anew for each.
pub const RUN_S: f64 = 120.0;
/// Frames per second.
const RATE_HZ: f64 = 20.0;
/// Time that a command lasts, s.
const COMMAND_S: std::ops::Range<f64> = 3.0..10.0;
/// So long after a new command an alarm counts as near it, s.
const SOON_S: f64 = 1.5;
/// Factor on the sensor noise.
const NOISE_SCALE: std::ops::Range<f64> = 0.5..2.0;
/// Relative scatter of the friction.
const SCATTER_MAX: f64 = 0.12;

/// One nominal run.
#[derive(Debug, Clone)]
pub struct Nominal {
    /// Its seed.
    pub seed: u64,
    /// Factor on the sensor noise.
    pub noise_scale: f64,
    /// Relative scatter of the friction.
    pub scatter: f64,
    /// Instants at which the command changes, s.
    pub changes_s: Vec<f64>,
    /// Alarms that rose, for each set of sensors.
    pub alarms: [Vec<Alarm>; SENSOR_SETS.len()],
}

/// An alarm, and what was driven.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alarm {
    /// When it rose, s.
    pub t_s: f64,
    /// Executed curvature then, 1/m.
    pub curvature_1_m: f64,
    /// Executed speed then, m/s.
    pub speed_m_s: f64,
}

/// Drives one run over the whole range of commands.
///
/// # Errors
/// A world that cannot be made.
pub fn drive_nominal(rover: &Rover, seed: u64) -> Result<Nominal, Box<dyn Error>> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0x5eed_0f00);
    let (noise_scale, scatter) = (
        rng.random_range(NOISE_SCALE),
        rng.random_range(0.0..SCATTER_MAX),
    );
    let limit = rover.model.command.curvature_max_1_m;
    let [slowest, fastest] = rover.model.command.speed_range_m_s;
    let mut drive = Vec::new();
    let mut total_s = 0.0;
    let mut changes_s = Vec::new();
    while total_s < RUN_S {
        let segment = DriveSegment {
            duration_s: rng.random_range(COMMAND_S),
            curvature_1_m: rng.random_range(-limit..limit),
            speed_m_s: rng.random_range(slowest..fastest),
        };
        changes_s.push(total_s);
        total_s += segment.duration_s;
        drive.push(segment);
    }
    let conditions = Conditions {
        simulator: Simulator {
            friction_scatter: scatter,
            noise_scale,
            ..Simulator::default()
        },
        drive,
        rate_hz: RATE_HZ,
        seed,
    };
    let mut alarms = [const { Vec::new() }; SENSOR_SETS.len()];
    let mut chains = Vec::new();
    for (sensors, _) in SENSOR_SETS {
        chains.push((Chain::new(rover, sensors, seed)?, false));
    }
    conditions.drive(rover, RUN_S, &[], |t_s, frame| {
        for ((chain, stands), alarms) in chains.iter_mut().zip(&mut alarms) {
            let alarm = chain.take(frame);
            if alarm && !*stands {
                let [curvature_1_m, speed_m_s, ..] = frame.command;
                alarms.push(Alarm {
                    t_s,
                    curvature_1_m,
                    speed_m_s,
                });
            }
            *stands = alarm;
        }
    })?;
    Ok(Nominal {
        seed,
        noise_scale,
        scatter,
        changes_s,
        alarms,
    })
}

impl Nominal {
    /// Alarms of a set of sensors soon after a new command.
    #[must_use]
    pub fn soon_after_a_command(&self, set: usize) -> usize {
        let soon = |alarm: &&Alarm| {
            let since_s = |change_s: &f64| alarm.t_s - change_s;
            self.changes_s
                .iter()
                .map(since_s)
                .any(|s| (0.0..SOON_S).contains(&s))
        };
        self.alarms[set].iter().filter(soon).count()
    }
}

/// Share of the time that lies soon after a new command.
#[must_use]
pub fn share_soon(runs: &[Nominal]) -> f64 {
    let changes: usize = runs.iter().map(|run| run.changes_s.len()).sum();
    SOON_S * changes as f64 / (RUN_S * runs.len() as f64)
}
