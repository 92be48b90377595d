//! A model learned on one soil, on others.
//!
//! The learned model belongs to soil of shear modulus 0.2. On stiffer soil a stuck wheel bends the
//! path less: the sign stays, the size does not. What must stay is that the fault is seen, and that
//! no wrong wheel is named with confidence.

mod report;

pub use report::{Figures, figures};

use std::error::Error;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_evaluation::scoring::Taxonomy;
use vigil_robot::Injection;
use vigil_setup::schema::Simulator;

use crate::simulated::{Chain, Conditions, Rover, SENSOR_SETS, Said, constant};

/// Soils: how many times stiffer than the one learned on.
pub const STIFFER: [f64; 4] = [1.0, 3.0, 4.0, 5.0];
/// Shear modulus of the soil learned on.
const LEARNED_MODULUS: f64 = 0.2;
/// Spread of the modulus from run to run, relative, either way: as in the runs learned from.
const MODULUS_SPREAD: f64 = 0.1;
/// Friction from run to run.
const FRICTION: std::ops::Range<f64> = 0.6..0.7;
const RADII_M: [f64; 12] = [
    1.0, -1.0, 1.5, -1.5, 2.0, -2.0, 4.0, -4.0, 6.0, -6.0, 10.0, -10.0,
];
const SPEEDS_M_S: [f64; 3] = [0.1, 0.2, 0.3];
const RATE_HZ: f64 = 20.0;
/// Times after the onset at which the diagnosis is judged, s.
pub const JUDGED_S: [f64; 3] = [2.0, 5.0, 10.0];
/// Probability above which a wrong name counts as confident.
const CONFIDENT: f64 = 0.9;

/// One run to drive.
#[derive(Debug, Clone)]
pub struct Job {
    /// How many times stiffer the soil is than the one learned on.
    pub stiffer: f64,
    /// The fault as `--inject` takes it, and the leaf that names it; `None` for a nominal run.
    pub fault: Option<(String, String)>,
    /// Signed radius, m.
    pub radius_m: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Seed of the world.
    pub seed: u64,
}

/// Every wheel stuck in every turn at every speed on every soil, with `seeds` worlds each, from
/// `first_seed` on; nominal runs; and encoder faults of every kind and wheel.
#[must_use]
pub fn jobs(rover: &Rover, seeds: u64, first_seed: u64) -> Vec<Job> {
    let mut jobs = Vec::new();
    let mut add = |stiffer, fault: Option<(String, String)>, radius_m, speed_m_s| {
        for _ in 0..seeds {
            let seed = first_seed + jobs.len() as u64;
            jobs.push(Job {
                stiffer,
                fault: fault.clone(),
                radius_m,
                speed_m_s,
                seed,
            });
        }
    };
    for stiffer in STIFFER {
        for (r, radius_m) in RADII_M.into_iter().enumerate() {
            for (v, speed_m_s) in SPEEDS_M_S.into_iter().enumerate() {
                add(stiffer, None, radius_m, speed_m_s);
                for (w, wheel) in rover.robot.wheels.iter().enumerate() {
                    let name = &wheel.name;
                    let stuck = (format!("stuck:{name}"), format!("{name}_STUCK"));
                    add(stiffer, Some(stuck), radius_m, speed_m_s);
                    // One kind of broken encoder per wheel, turn and speed, each as often.
                    let kind = ["zero", "frozen", "noise"][(r + v + w) % 3];
                    let broken = (format!("encoder:{name}:{kind}"), format!("{name}_ENC"));
                    if (r + w) % 2 == 0 {
                        add(stiffer, Some(broken), radius_m, speed_m_s);
                    }
                }
            }
        }
    }
    jobs
}

/// What became of a run with one set of sensors.
#[derive(Debug, Clone)]
pub struct Run {
    /// The run.
    pub job: Job,
    /// Name of the set of sensors.
    pub sensors: &'static str,
    /// An alarm stood before the onset, or at any time of a nominal run.
    pub false_alarm: bool,
    /// Time from onset to alarm, s.
    pub delay_s: Option<f64>,
    /// What was said at each of [`JUDGED_S`].
    pub judged: [Judged; JUDGED_S.len()],
}

/// A diagnosis, judged.
#[derive(Debug, Clone, Default)]
pub struct Judged {
    /// The mode and its probability.
    pub mode: String,
    /// Its probability.
    pub p_mode: f64,
    /// The right leaf.
    pub leaf: bool,
    /// The right side.
    pub side: bool,
    /// Unknown.
    pub unknown: bool,
    /// A fault that is not there, with more than 0.9.
    pub wrong: bool,
}

impl Judged {
    fn new(said: Said, truth: &str, taxonomy: &Taxonomy) -> Self {
        let covers = taxonomy.covers(&said.mode, truth);
        let side = taxonomy.side(truth);
        Self {
            leaf: said.mode == truth,
            side: side.is_some() && taxonomy.side(&said.mode) == side,
            unknown: said.mode == "UNKNOWN",
            wrong: said.names_a_fault(CONFIDENT) && !covers,
            p_mode: said.p_mode,
            mode: said.mode,
        }
    }
}

/// Drives one run through both sets of sensors.
///
/// # Errors
/// A world that cannot be made.
pub fn drive(rover: &Rover, taxonomy: &Taxonomy, job: &Job) -> Result<Vec<Run>, Box<dyn Error>> {
    let mut rng = Pcg64Mcg::seed_from_u64(job.seed ^ 0x0050_1150);
    let spread = rng.random_range(1.0 - MODULUS_SPREAD..1.0 + MODULUS_SPREAD);
    let simulator = Simulator {
        friction: rng.random_range(FRICTION),
        shear_modulus: LEARNED_MODULUS * spread / job.stiffer,
        ..Simulator::default()
    };
    let onset_s = rng.random_range(3.0..5.0);
    let changes = match &job.fault {
        None => Vec::new(),
        Some((spec, _)) => vec![(Injection::parse_change(spec, &rover.robot)?, onset_s)],
    };
    let conditions = Conditions {
        simulator,
        drive: constant(1.0 / job.radius_m, job.speed_m_s),
        rate_hz: RATE_HZ,
        seed: job.seed,
    };
    let mut chains = Vec::new();
    for (sensors, name) in SENSOR_SETS {
        let run = Run {
            job: job.clone(),
            sensors: name,
            false_alarm: false,
            delay_s: None,
            judged: std::array::from_fn(|_| Judged::default()),
        };
        chains.push((Chain::new(rover, sensors, job.seed)?, run));
    }
    let mut due_s = [onset_s; JUDGED_S.len()];
    due_s
        .iter_mut()
        .zip(JUDGED_S)
        .for_each(|(due, after)| *due += after);
    let duration_s = onset_s + JUDGED_S[2] + 2.0 / RATE_HZ;
    conditions.drive(rover, duration_s, &changes, |t_s, frame| {
        for (chain, run) in &mut chains {
            let alarm = chain.take(frame);
            let Some((_, truth)) = &job.fault else {
                run.false_alarm |= alarm;
                continue;
            };
            if t_s < onset_s {
                run.false_alarm |= alarm;
            } else if alarm && run.delay_s.is_none() {
                run.delay_s = Some(t_s - onset_s);
            }
            for (judged, due_s) in run.judged.iter_mut().zip(due_s) {
                if judged.mode.is_empty() && t_s >= due_s {
                    *judged = Judged::new(chain.said(), truth, taxonomy);
                }
            }
        }
    })?;
    Ok(chains.into_iter().map(|(_, run)| run).collect())
}

impl Run {
    /// Head of [`Self::line`].
    pub const HEAD: &'static str = "stiffer,fault,radius_m,speed_m_s,seed,sensors,false_alarm,\
        delay_s,mode_2s,p_2s,mode_5s,p_5s,mode_10s,p_10s";

    /// The run as a line of CSV.
    #[must_use]
    pub fn line(&self) -> String {
        let job = &self.job;
        let judged: Vec<String> = self
            .judged
            .iter()
            .map(|judged| format!("{},{:.4}", judged.mode, judged.p_mode))
            .collect();
        format!(
            "{},{},{},{},{},{},{},{},{}",
            job.stiffer,
            job.fault.as_ref().map_or("", |(spec, _)| spec),
            job.radius_m,
            job.speed_m_s,
            job.seed,
            self.sensors,
            u8::from(self.false_alarm),
            self.delay_s
                .map_or(String::new(), |delay_s| format!("{delay_s:.3}")),
            judged.join(","),
        )
    }
}
