//! How long detection takes at equal false-alarm rate, by size of the fault, against the bound.

#![allow(missing_docs)]

use std::error::Error;

use nalgebra::SVector;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde_json::json;
use vigil_bench::archive::Archive;
use vigil_inference::ages::Ages;
use vigil_inference::constant::Constant;

/// Steps between false alarms to which every detector is set.
const BETWEEN_ALARMS: f64 = 1e4;
/// Probability per step that a fault appears, as the detectors know it.
const BIRTH: f64 = 1e-3;
const RUNS: u64 = 1000;
const CALIBRATION_RUNS: u64 = 400;
const STEPS_MAX: usize = 20_000;
/// Squared distance of the faulty from the nominal residual, in one step.
const SIZES: [f64; 8] = [0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 20.0];

#[derive(Clone, Copy)]
enum Detector {
    Ages { bias_sd: f64 },
    Constant { tau_squared: f64 },
}

impl Detector {
    fn name(self) -> String {
        match self {
            Self::Ages { bias_sd } => format!("learned bias, sd {bias_sd}"),
            Self::Constant { tau_squared } => format!("constant likelihood, tau^2 {tau_squared}"),
        }
    }

    /// Steps until the log-odds exceed `alarm` on residuals with a bias of squared size `lambda`;
    /// None if they never do.
    fn run(self, lambda: f64, alarm: f64, seed: u64, steps_max: usize) -> Option<usize> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let bias = SVector::from([lambda.sqrt(), 0.0, 0.0]);
        let mut residual =
            || SVector::<f64, 3>::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal)) + bias;
        let steps = match self {
            Self::Ages { bias_sd } => {
                let mut filter = Ages::<3>::new(bias_sd);
                (0..steps_max).position(|_| {
                    filter.step(&residual(), BIRTH);
                    filter.log_odds() > alarm
                })
            }
            Self::Constant { tau_squared } => {
                let mut filter = Constant::default();
                (0..steps_max).position(|_| {
                    filter.step(residual().norm_squared(), tau_squared, BIRTH, 0.0);
                    filter.log_odds() > alarm
                })
            }
        };
        steps.map(|step| step + 1)
    }

    /// Log-odds at which nominal residuals alarm once in [`BETWEEN_ALARMS`] steps, by bisection.
    fn calibrate(self) -> f64 {
        let limit = 10 * BETWEEN_ALARMS as usize;
        let mean = |alarm| {
            let steps = |seed| {
                self.run(0.0, alarm, 10_000_000 + seed, limit)
                    .unwrap_or(limit)
            };
            (0..CALIBRATION_RUNS).map(steps).sum::<usize>() as f64 / CALIBRATION_RUNS as f64
        };
        let (mut low, mut high) = (-4.0, 8.0);
        for _ in 0..12 {
            let middle = 0.5 * (low + high);
            if mean(middle) < BETWEEN_ALARMS {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new("detection")?;
    archive
        .say("White residual of 3 dimensions; mean delay in steps (share missed in 20000 steps)");
    archive.say("at one false alarm in 10000 steps; bound: 2 ln(10000) / size (Lorden).\n");
    let header = SIZES.map(|size| size.to_string()).join(" | ");
    archive.say(&format!("| size of the fault | {header} |"));
    archive.say(&format!("|---|{}", "---|".repeat(SIZES.len())));
    let mut raw = Vec::new();
    let detectors = [
        Detector::Ages { bias_sd: 1.0 },
        Detector::Ages { bias_sd: 0.5 },
        Detector::Constant { tau_squared: 5.0 },
        Detector::Constant { tau_squared: 7.0 },
    ];
    for detector in detectors {
        let alarm = detector.calibrate();
        let mut row = format!("| {} |", detector.name());
        for lambda in SIZES {
            let found: Vec<usize> = (0..RUNS)
                .filter_map(|seed| detector.run(lambda, alarm, seed, STEPS_MAX))
                .collect();
            let missed = RUNS as usize - found.len();
            let mean = found.iter().sum::<usize>() as f64 / found.len().max(1) as f64;
            let bound = 2.0 * BETWEEN_ALARMS.ln() / lambda;
            row.push_str(&match missed {
                0 => format!(" {mean:.1} ({:.2}x) |", mean / bound),
                _ => format!(
                    " {mean:.1} ({:.0} % missed) |",
                    100.0 * missed as f64 / RUNS as f64
                ),
            });
            raw.push(json!({
                "detector": detector.name(), "alarm_log_odds": alarm, "lambda": lambda,
                "mean_delay_steps": mean, "missed": missed, "runs": RUNS, "bound_steps": bound,
            }));
        }
        archive.say(&row);
    }
    archive.store("detection.json", &json!(raw))?;
    println!("archived in {}", archive.close()?.display());
    Ok(())
}
