//! How fast is the look-ahead filter on a linear 13-mode model?
//!
//! The lanes at each level and the generic filter, on the same model and the same observations, in
//! turn.

use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::{percentile, quantile};
use vigil_evaluation::cases::Planar;
use vigil_inference::filter::Filter;
use vigil_inference::lanes::Level;
use vigil_inference::lanes::linear::{LaneLookAhead, LinearModel, LinearParameters, Observation};
use vigil_inference::look_ahead::LookAhead;

const WHEELS: usize = 6;
type Rover = LinearModel<3, 3, WHEELS>;
type Seen = Observation<3, WHEELS>;

const SIZES: [usize; 3] = [32, 100, 1_000];
/// Enough for what shrinks in a quiet drive to become as small as it gets.
const STEPS: usize = 1_000;
/// Runs of all steps: the lanes', the generic filter's.
const ROUNDS: usize = 40;
const ROUNDS_GENERIC: usize = 2;
/// Each with whether modes change.
const DRIVES: [(&str, bool); 2] = [("faults come and go", true), ("nominal", false)];
/// Of so many particles of the generic filter the belief is the yardstick.
const YARDSTICK: usize = 10_000;

/// Answers the question.
pub fn run() -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build measures nothing: use scripts/bench".into());
    }
    let model = rover()?;
    let mut rows = Vec::new();
    for (name, changes) in DRIVES {
        let run = drive(&model, changes)?;
        let mut generic = LookAhead::<_, 3>::new(model.clone(), YARDSTICK, 1);
        let drive = Drive {
            name,
            yardstick: beliefs(&mut generic, &run),
            run,
        };
        for count in SIZES {
            rows.extend(measure(&model, &drive, count));
        }
    }
    let mut archive = Archive::new("look-ahead")?;
    say(&mut archive, &rows);
    archive.store("look-ahead.json", &json!({ "steps": STEPS, "rows": rows }))?;
    archive.close()?;
    Ok(())
}

/// The rover of the planar case, its heading taken as small: 13 modes, a pose, six wheels.
fn rover() -> Result<Rover, Box<dyn Error>> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/filters");
    let (Planar { parameters: p }, _) = Planar::read(&data)?;
    let variances =
        |sd: &[f64; 3]| Matrix3::from_diagonal(&Vector3::from(*sd).map(|sd: f64| sd * sd));
    let rates = p.wheel_rates.iter();
    let rates = rates.map(|row| std::array::from_fn(|w| row[w])).collect();
    Ok(LinearModel::new(LinearParameters {
        motion: SMatrix::identity(),
        shift: p.motion.clone(),
        motion_noise: variances(&p.motion_sd),
        observe: SMatrix::identity(),
        offset: vec![[0.0; 3]; p.initial.len()],
        sensor_noise: variances(&p.pose_sd),
        rates,
        rate_sd: [p.wheel_rate_sd; WHEELS],
        start: p.start,
        start_covariance: variances(&p.start_sd),
        initial: p.initial,
        transition: p.transition,
    })?)
}

/// A simulated drive, and the belief that it should lead to.
struct Drive {
    name: &'static str,
    run: Vec<Seen>,
    yardstick: Vec<Vec<f64>>,
}

/// Observations of a drive that begins in nominal mode, and stays there unless it `changes`.
fn drive(model: &Rover, changes: bool) -> Result<Vec<Seen>, Box<dyn Error>> {
    let p = model.parameters();
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let mut normal = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
    let mut chain = Pcg64Mcg::seed_from_u64(6);
    let (mut mode, mut state) = (0, SVector::from(p.start));
    let mut run = Vec::with_capacity(STEPS);
    for _ in 0..STEPS {
        let mut left: f64 = chain.random();
        let next = p.transition[mode].iter().position(|p| {
            left -= p;
            left < 0.0
        });
        if changes {
            mode = next.ok_or("a row of the chain is not a distribution")?;
        }
        state += Vector3::from(p.shift[mode]);
        state += Vector3::from_fn(|i, _| normal(p.motion_noise[(i, i)].sqrt()));
        run.push(Observation {
            state: std::array::from_fn(|i| state[i] + normal(p.sensor_noise[(i, i)].sqrt())),
            rates: std::array::from_fn(|w| p.rates[mode][w] + normal(p.rate_sd[w])),
        });
    }
    Ok(run)
}

fn beliefs(filter: &mut impl Filter<Observation = Seen>, run: &[Seen]) -> Vec<Vec<f64>> {
    let step = |z| {
        filter.step(z);
        filter.posterior().to_vec()
    };
    run.iter().map(step).collect()
}

/// A filter under test; its times in us, and its distances to the yardstick.
struct Contender {
    name: String,
    rounds: usize,
    make: Box<dyn Fn(u64) -> Box<dyn Filter<Observation = Seen>>>,
    times: Vec<f64>,
    distance: f64,
}

fn contenders(model: &Rover, count: usize) -> Vec<Contender> {
    let contender = |name, rounds, make| Contender {
        name,
        rounds,
        make,
        times: Vec::with_capacity(rounds * STEPS),
        distance: 0.0,
    };
    type Make = Box<dyn Fn(u64) -> Box<dyn Filter<Observation = Seen>>>;
    let generic = model.clone();
    let make: Make =
        Box::new(move |seed| Box::new(LookAhead::<_, 3>::new(generic.clone(), count, seed)));
    let mut all = vec![contender("generic".to_owned(), ROUNDS_GENERIC, make)];
    for level in Level::ALL {
        let filter = LaneLookAhead::new(model.clone(), count, 0).at_level(level);
        if filter.is_none() {
            continue;
        }
        let model = model.clone();
        let make: Make = Box::new(move |seed| {
            let filter = LaneLookAhead::new(model.clone(), count, seed);
            Box::new(filter.clone().at_level(level).unwrap_or(filter))
        });
        let name = format!("lanes {level:?}").to_lowercase();
        all.push(contender(name, ROUNDS, make));
    }
    all
}

/// Rows of one number of particles; the contenders take turns, one run of all steps each.
fn measure(model: &Rover, drive: &Drive, count: usize) -> Vec<Value> {
    let mut all = contenders(model, count);
    for round in 0..ROUNDS {
        for contender in all.iter_mut().filter(|c| round < c.rounds) {
            let mut filter = (contender.make)(round as u64);
            for (z, exact) in drive.run.iter().zip(&drive.yardstick) {
                let started = Instant::now();
                black_box(filter.step(black_box(z)));
                contender
                    .times
                    .push(started.elapsed().as_nanos() as f64 * 1e-3);
                let pairs = filter.posterior().iter().zip(exact);
                contender.distance += pairs.map(|(p, q)| (p - q).abs()).sum::<f64>();
            }
        }
    }
    let generic = all
        .first_mut()
        .map_or(f64::NAN, |c| quantile(&mut c.times, 0.5));
    let rows = all.iter_mut().map(|contender| {
        let [p50, p99, p999] = [0.5, 0.99, 0.999].map(|q| quantile(&mut contender.times, q));
        json!({
            "drive": drive.name,
            "filter": contender.name,
            "particles": count,
            "step_us_p50": p50,
            "step_us_p99": p99,
            "step_us_p999": p999,
            "ns_per_particle_p50": p50 * 1e3 / count as f64,
            "ratio": generic / p50,
            "l1_to_generic_10000": contender.distance / contender.times.len() as f64,
            "samples": contender.times.len(),
        })
    });
    rows.collect()
}

fn say(archive: &mut Archive, rows: &[Value]) {
    archive.say("13 modes, 3 dimensions, a pose and six wheel rates. Time of one step; ratio of");
    archive.say("medians to the generic look-ahead filter's (one Kalman filter per particle, in");
    archive.say(&format!(
        "double precision); mean L1 distance to its belief with {YARDSTICK}"
    ));
    archive.say("particles. The lanes round the number of particles up to a multiple of 16.\n");
    archive.say(
        "| drive | filter | particles | step us p50 | p99 | p99.9 | ns/particle | ratio | L1 | n |",
    );
    archive.say("|---|---|---|---|---|---|---|---|---|---|");
    for row in rows {
        let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
        let samples = row["samples"].as_u64().unwrap_or(0);
        let tail = |q: f64, key: &str| percentile(q, samples, format!("{:.2}", number(key)));
        archive.say(&format!(
            "| {} | {} | {} | {:.2} | {} | {} | {:.1} | {:.1} | {:.4} | {} |",
            row["drive"].as_str().unwrap_or_default(),
            row["filter"].as_str().unwrap_or_default(),
            row["particles"],
            number("step_us_p50"),
            tail(0.99, "step_us_p99"),
            tail(0.999, "step_us_p999"),
            number("ns_per_particle_p50"),
            number("ratio"),
            number("l1_to_generic_10000"),
            row["samples"],
        ));
    }
}
