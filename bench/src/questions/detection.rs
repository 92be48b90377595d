//! How long does detection take at equal false-alarm rate, by size of the fault, beside the bound?

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use nalgebra::{SVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_inference::ages::Ages;
use vigil_inference::constant::Constant;
use vigil_inference::windowed::Windowed;

/// Steps between false alarms to which every detector is set.
const BETWEEN_ALARMS: f64 = 1e4;
/// Probability per step that a fault appears, as the detectors know it: far below one in the steps
/// between false alarms, or the log-odds rise with time alone.
const BIRTH: f64 = 1e-6;
/// Runs per cell; their seeds begin at 0.
const RUNS: u64 = 2000;
/// Nominal runs per threshold, of seeds that no cell uses.
const CALIBRATION_RUNS: u64 = 3000;
const CALIBRATION_SEED: u64 = 10_000_000;
const CALIBRATION_STEPS: usize = 20_000;
/// Steps after the onset beyond which a fault counts as missed.
const STEPS_MAX: usize = 20_000;
/// Squared distance of the faulty from the nominal residual, in one step.
const SIZES: [f64; 8] = [0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 20.0];
/// Sizes for which the filter that knows the size is fast enough.
const SIZES_KNOWN: [f64; 2] = [1.0, 2.0];
/// Nominal steps before the fault: none is the worst case, a filter without any evidence yet.
const ONSETS: [usize; 2] = [0, 1000];

#[derive(Clone, Copy)]
enum Detector {
    Ages { bias_sd: f64 },
    Constant { tau_squared: f64 },
    Windowed10 { tau_squared: f64 },
    Windowed40 { tau_squared: f64 },
    Known { lambda: f64 },
}

/// A detector at work.
enum Filter {
    Ages(Box<Ages<3>>),
    Constant(Constant, f64),
    Windowed10(Box<Windowed<3, 10>>, f64),
    Windowed40(Box<Windowed<3, 40>>, f64),
    Known(Box<Known>),
}

/// The best that a filter can do that knows the size of the fault, but not its direction: every
/// onset on its own (the last 80), the marginal likelihood ratio over all directions.
struct Known {
    sums: [Vector3<f64>; 80],
    step: usize,
    bias: f64,
    log_odds: f64,
}

impl Known {
    fn step(&mut self, residual: &Vector3<f64>) {
        let steps = self.sums.len();
        self.sums[self.step % steps] = Vector3::zeros();
        self.step += 1;
        let known = self.step.min(steps);
        let mut odds = 0.0;
        for age in 1..=known {
            let sum = &mut self.sums[(self.step - age) % steps];
            *sum += residual;
            // Mean of exp(b·S - n|b|²/2) over the sphere: sinh(|b||S|) / (|b||S|).
            let x = self.bias * sum.norm();
            let even = 0.5 * (1.0 - (-2.0 * x).exp()) / x.max(1e-12);
            odds += even * (x - 0.5 * age as f64 * self.bias * self.bias).exp();
        }
        self.log_odds = (BIRTH * odds).ln();
    }
}

impl Filter {
    /// Log-odds after one more residual.
    fn step(&mut self, residual: &Vector3<f64>) -> f64 {
        match self {
            Self::Ages(filter) => {
                filter.step(residual, BIRTH);
                filter.log_odds()
            }
            Self::Constant(filter, tau_squared) => {
                filter.step(residual.norm_squared(), *tau_squared, BIRTH, 0.0);
                filter.log_odds()
            }
            Self::Windowed10(filter, tau_squared) => {
                filter.step(residual, *tau_squared, BIRTH, 0.0);
                filter.log_odds()
            }
            Self::Windowed40(filter, tau_squared) => {
                filter.step(residual, *tau_squared, BIRTH, 0.0);
                filter.log_odds()
            }
            Self::Known(filter) => {
                filter.step(residual);
                filter.log_odds
            }
        }
    }
}

fn noise(rng: &mut Pcg64Mcg) -> Vector3<f64> {
    SVector::from_fn(|_, _| rng.sample(StandardNormal))
}

impl Detector {
    fn name(self) -> String {
        match self {
            Self::Ages { bias_sd } => format!("learned bias, sd {bias_sd}"),
            Self::Constant { tau_squared } => format!("constant, tau^2 {tau_squared}"),
            Self::Windowed10 { tau_squared } => format!("windowed 10, tau^2 {tau_squared}"),
            Self::Windowed40 { tau_squared } => format!("windowed 40, tau^2 {tau_squared}"),
            Self::Known { lambda } => format!("yardstick: every onset, size {lambda} known"),
        }
    }

    fn filter(self) -> Filter {
        match self {
            Self::Ages { bias_sd } => Filter::Ages(Box::new(Ages::new(bias_sd))),
            Self::Constant { tau_squared } => Filter::Constant(Constant::default(), tau_squared),
            Self::Windowed10 { tau_squared } => Filter::Windowed10(Box::default(), tau_squared),
            Self::Windowed40 { tau_squared } => Filter::Windowed40(Box::default(), tau_squared),
            Self::Known { lambda } => Filter::Known(Box::new(Known {
                sums: [Vector3::zeros(); 80],
                step: 0,
                bias: lambda.sqrt(),
                log_odds: f64::NEG_INFINITY,
            })),
        }
    }

    /// Steps from the onset until the log-odds exceed `alarm` on residuals with a bias of squared
    /// size `lambda`: `Some(None)` if they never do, `None` if they do before the onset.
    fn run(self, lambda: f64, onset: usize, alarm: f64, seed: u64) -> Option<Option<usize>> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let bias = Vector3::new(lambda.sqrt(), 0.0, 0.0);
        let mut filter = self.filter();
        if (0..onset).any(|_| filter.step(&noise(&mut rng)) > alarm) {
            return None;
        }
        let steps = (0..STEPS_MAX).position(|_| filter.step(&(noise(&mut rng) + bias)) > alarm);
        Some(steps.map(|step| step + 1))
    }

    /// Log-odds at which nominal residuals alarm once in [`BETWEEN_ALARMS`] steps, by bisection
    /// over the records of nominal runs: all steps until alarm or end, by the number of alarms.
    fn calibrate(self) -> f64 {
        let records: Vec<Vec<(usize, f64)>> = (0..CALIBRATION_RUNS)
            .map(|run| {
                let mut rng = Pcg64Mcg::seed_from_u64(CALIBRATION_SEED + run);
                let mut filter = self.filter();
                let mut records = Vec::new();
                let mut highest = f64::NEG_INFINITY;
                for step in 1..=CALIBRATION_STEPS {
                    let log_odds = filter.step(&noise(&mut rng));
                    if log_odds > highest {
                        highest = log_odds;
                        records.push((step, log_odds));
                    }
                }
                records
            })
            .collect();
        let between = |alarm: f64| {
            let first = |run: &Vec<(usize, f64)>| {
                run.iter()
                    .find(|record| record.1 > alarm)
                    .map(|record| record.0)
            };
            let found: Vec<Option<usize>> = records.iter().map(first).collect();
            let steps: usize = found.iter().map(|s| s.unwrap_or(CALIBRATION_STEPS)).sum();
            steps as f64 / found.iter().flatten().count().max(1) as f64
        };
        let (mut low, mut high) = (-14.0, 8.0);
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            if between(middle) < BETWEEN_ALARMS {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }

    /// Cell of the table and its raw figures.
    fn cell(self, lambda: f64, onset: usize, alarm: f64) -> (String, Value) {
        let all: Vec<Option<usize>> = (0..RUNS)
            .filter_map(|seed| self.run(lambda, onset, alarm, seed))
            .collect();
        let missed = all.iter().filter(|steps| steps.is_none()).count();
        // A missed fault counts with the steps for which it was watched.
        let steps = |found: &Option<usize>| found.unwrap_or(STEPS_MAX) as f64;
        let runs = all.len() as f64;
        let mean = all.iter().map(steps).sum::<f64>() / runs;
        let square = all.iter().map(|found| (steps(found) - mean).powi(2));
        let error = (square.sum::<f64>() / runs / (runs - 1.0)).sqrt();
        let bound = 2.0 * BETWEEN_ALARMS.ln() / lambda;
        let ratio = mean / bound;
        let shown = match missed {
            0 => format!("{mean:.1} ({ratio:.2}x)"),
            _ => {
                let share = 100.0 * missed as f64 / runs;
                format!(">{mean:.0} (>{ratio:.1}x, {share:.1} % missed)")
            }
        };
        let raw = json!({
            "detector": self.name(), "alarm_log_odds": alarm, "lambda": lambda,
            "nominal_steps_before": onset, "mean_delay_steps": mean,
            "standard_error_steps": error, "missed": missed, "runs": all.len(),
            "bound_steps": bound, "ratio_to_bound": ratio,
        });
        (shown, raw)
    }

    /// Time of one step, us.
    fn step_us(self) -> f64 {
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let residuals: Vec<Vector3<f64>> = (0..1000).map(|_| noise(&mut rng)).collect();
        let mut filter = self.filter();
        let began = Instant::now();
        for _ in 0..100 {
            for residual in &residuals {
                black_box(filter.step(residual));
            }
        }
        began.elapsed().as_secs_f64() * 10.0
    }
}

const DETECTORS: [Detector; 6] = [
    Detector::Ages { bias_sd: 1.0 },
    Detector::Ages { bias_sd: 0.5 },
    Detector::Constant { tau_squared: 5.0 },
    Detector::Constant { tau_squared: 7.0 },
    Detector::Windowed10 { tau_squared: 5.0 },
    Detector::Windowed40 { tau_squared: 5.0 },
];

/// Answers the question.
pub fn run() -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new("detection")?;
    archive.say("White residual of 3 dimensions; mean delay in steps at one false alarm in 10000");
    archive.say("steps, and its ratio to the bound 2 ln(10000) / size (Lorden; asymptotic). 2000");
    archive
        .say("runs a cell, thresholds from other runs. A fault not seen in 20000 steps is missed");
    archive.say("and counts with those. The fault begins with the filter or after 1000 steps.\n");
    let header = SIZES.map(|size| size.to_string()).join(" | ");
    archive.say(&format!("| detector | us a step | before | {header} |"));
    archive.say(&format!("|---|---|---|{}", "---|".repeat(SIZES.len())));
    let mut raw = Vec::new();
    let known = SIZES_KNOWN.map(|lambda| Detector::Known { lambda });
    for detector in DETECTORS.into_iter().chain(known) {
        let (alarm, step_us) = (detector.calibrate(), detector.step_us());
        for onset in ONSETS {
            let mut row = format!("| {} | {step_us:.2} | {onset} |", detector.name());
            for lambda in SIZES {
                if matches!(detector, Detector::Known { lambda: known } if known != lambda) {
                    row.push_str(" |");
                    continue;
                }
                let (shown, cell) = detector.cell(lambda, onset, alarm);
                row.push_str(&format!(" {shown} |"));
                raw.push(cell);
            }
            archive.say(&row);
        }
    }
    archive.store("detection.json", &json!(raw))?;
    archive.close()?;
    Ok(())
}
