//! Time per particle: a plain filter and the lanes at each level, in turn, in one process.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use serde_json::{Value, json};
use vigil_evaluation::cases::Planar;
use vigil_inference::lanes::{LaneFilter, Level, Observation, PlanarModel, PlanarParameters};

use crate::archive::Archive;
use crate::naive::Naive;
use crate::percentile;

/// Particles, and how often the 200 steps are repeated.
const SIZES: [(usize, usize); 4] = [(1_000, 200), (10_000, 30), (100_000, 7), (1_000_000, 3)];

/// Of this many particles the posteriors are compared.
const COMPARED_MIN: usize = 100_000;

const SEED: u64 = 20_020_701;

/// All rows, on the planar case in `data`.
///
/// # Errors
/// A file that cannot be read, or a model that is not one.
pub fn rows(data: &Path) -> Result<Vec<Value>, Box<dyn Error>> {
    let (Planar { parameters }, observations) = Planar::read(data)?;
    let mut rows = Vec::new();
    for (count, repetitions) in SIZES {
        eprintln!("timing {count} particles");
        rows.extend(measure(&parameters, &observations, count, repetitions)?);
    }
    Ok(rows)
}

/// A filter under test.
enum Contender {
    Naive(Box<Naive>),
    Lanes(Box<LaneFilter>),
}

impl Contender {
    fn name(&self) -> String {
        match self {
            Self::Naive(_) => "naive".to_owned(),
            Self::Lanes(filter) => format!("lanes {:?}", filter.level()).to_lowercase(),
        }
    }

    fn step(&mut self, z: &Observation) {
        match self {
            Self::Naive(filter) => drop(filter.step(z)),
            Self::Lanes(filter) => drop(std::hint::black_box(filter.step(z))),
        }
    }

    fn posterior(&self) -> &[f64] {
        match self {
            Self::Naive(filter) => filter.posterior(),
            Self::Lanes(filter) => filter.posterior(),
        }
    }
}

/// All that can run here.
fn contenders(
    rover: &PlanarParameters,
    count: usize,
    seed: u64,
) -> Result<Vec<Contender>, Box<dyn Error>> {
    let model = PlanarModel::new(rover)?;
    let naive = Contender::Naive(Box::new(Naive::new(rover, count, seed)?));
    let lanes = |level| LaneFilter::new(model.clone(), count, seed).at_level(level);
    let levels = Level::ALL.into_iter().filter_map(lanes);
    let levels = levels.map(|filter| Contender::Lanes(Box::new(filter)));
    Ok([naive].into_iter().chain(levels).collect())
}

/// Rows of one number of particles; the contenders take turns, one run of all steps each.
fn measure(
    rover: &PlanarParameters,
    observations: &[Observation],
    count: usize,
    repetitions: usize,
) -> Result<Vec<Value>, Box<dyn Error>> {
    let names: Vec<String> = contenders(rover, count, SEED)?
        .iter()
        .map(Contender::name)
        .collect();
    let mut times_ns = vec![Vec::new(); names.len()];
    let mut distances = vec![0.0; names.len()];
    for repetition in 0..repetitions {
        let mut first = Vec::new();
        let all = contenders(rover, count, SEED + repetition as u64)?;
        for (i, mut contender) in all.into_iter().enumerate() {
            let mut posteriors = Vec::with_capacity(observations.len());
            for z in observations {
                let start = Instant::now();
                contender.step(z);
                times_ns[i].push(start.elapsed().as_nanos() as f64);
                posteriors.push(contender.posterior().to_vec());
            }
            if i == 0 {
                first = posteriors;
            } else {
                distances[i] += distance(&first, &posteriors) / repetitions as f64;
            }
        }
    }
    for times in &mut times_ns {
        times.sort_by(f64::total_cmp);
    }
    let at = |i: usize, share: f64| times_ns[i][(times_ns[i].len() as f64 * share) as usize];
    let naive_ns = at(0, 0.5);
    let row = |i: usize| {
        json!({
            "filter": names[i],
            "particles": count,
            "step_us_p50": at(i, 0.5) / 1e3,
            "step_us_p99": at(i, 0.99) / 1e3,
            "step_us_max": times_ns[i].last().map(|t| t / 1e3),
            "ns_per_particle_p50": at(i, 0.5) / count as f64,
            "ns_per_particle_p99": at(i, 0.99) / count as f64,
            "ratio": naive_ns / at(i, 0.5),
            "l1_to_naive": (i > 0 && count >= COMPARED_MIN).then_some(distances[i]),
            "samples": times_ns[i].len(),
        })
    };
    Ok((0..names.len()).map(row).collect())
}

/// Mean over the steps of `Σ_k |a_k - b_k|`.
fn distance(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let steps = a.iter().zip(b);
    let sums = steps.map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>());
    sums.sum::<f64>() / a.len() as f64
}

/// Writes the table of the rows.
pub fn report(archive: &mut Archive, rows: &[Value]) {
    archive.say("Time of one step, per particle and as a whole; ratio of medians to the naive");
    archive.say("filter's; mean L1 distance of the mode posteriors from its. Systematic");
    archive.say("resampling in every step.\n");
    archive
        .say("| filter | particles | ns/particle p50 | p99 | step us p50 | p99 | ratio | L1 | n |");
    archive.say("|---|---|---|---|---|---|---|---|---|");
    for row in rows {
        let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
        let samples = row["samples"].as_u64().unwrap_or(0);
        let tail = |key: &str| percentile(0.99, samples, format!("{:.2}", number(key)));
        let distance = row["l1_to_naive"].as_f64();
        archive.say(&format!(
            "| {} | {} | {:.2} | {} | {:.2} | {} | {:.1} | {} | {} |",
            row["filter"].as_str().unwrap_or_default(),
            row["particles"],
            number("ns_per_particle_p50"),
            tail("ns_per_particle_p99"),
            number("step_us_p50"),
            tail("step_us_p99"),
            number("ratio"),
            distance.map_or("-".to_owned(), |d| format!("{d:.4}")),
            row["samples"],
        ));
    }
}
