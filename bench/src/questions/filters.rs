//! Which filter is worth its time?
//!
//! Distance to the exact belief, delay and misses at rare faults, nanoseconds per particle.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::filters::{Kind, Model, build};
use vigil_bench::matched::{HEAD, Outcome, compare, particles_for};
use vigil_bench::rare::{STEP_S, Scenario, rare_faults};
use vigil_bench::recorded::Recorded;
use vigil_bench::{percentile, quantile, speed};
use vigil_evaluation::cases::{HiddenMarkov, JumpLinear, Planar};
use vigil_identifier::risks;
use vigil_inference::filter::Filter;
use vigil_inference::lanes::{self, linear::LaneLookAhead};

const COUNTS: [usize; 6] = [32, 100, 1_000, 10_000, 100_000, 1_000_000];
/// Simulated runs per cell of the rare faults.
const RUNS: u64 = 100;
/// Filters and particles on simulated and recorded runs.
const SIMULATED: [(Kind, usize); 20] = [
    (Kind::Bootstrap, 32),
    (Kind::Bootstrap, 100),
    (Kind::Bootstrap, 1_000),
    (Kind::Bootstrap, 10_000),
    (Kind::Raised, 32),
    (Kind::Raised, 100),
    (Kind::Raised, 1_000),
    (Kind::Adaptive, 1_000),
    (Kind::Risk, 100),
    (Kind::Risk, 1_000),
    (Kind::Hierarchical, 100),
    (Kind::Hierarchical, 1_000),
    (Kind::RaisedHierarchical, 32),
    (Kind::RaisedHierarchical, 100),
    (Kind::RaisedHierarchical, 1_000),
    (Kind::Coarse, 100),
    (Kind::Fine, 100),
    (Kind::LookAhead, 32),
    (Kind::Merged, 0),
    (Kind::Sequences, 0),
];
/// What is compared run by run, at equal numbers of particles.
const PAIRS: [(Kind, Kind); 4] = [
    (Kind::Hierarchical, Kind::Bootstrap),
    (Kind::RaisedHierarchical, Kind::Raised),
    (Kind::RaisedHierarchical, Kind::Coarse),
    (Kind::RaisedHierarchical, Kind::Fine),
];

/// Answers the question.
pub fn run() -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new("filters")?;
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/data/filters");
    archive
        .say("Distance to the exact belief: mean over steps of `Σ|p - q|` and of `KL(exact|p)`.");
    archive.say("Time: one step, p50; per particle for the sampled filters.\n");

    let nodes = [vec![1, 2, 3], vec![4, 5, 6], (7..13).collect()];
    exact_cases(&mut archive, &folder, &nodes)?;
    let speeds = speed::rows(&folder)?;
    archive.say("## Time per particle: thirteen modes, pose and wheel rates\n");
    speed::report(&mut archive, &speeds);
    archive.store("speed.json", &json!(speeds))?;

    simulated_runs(&mut archive, &folder, &nodes)?;
    recorded_runs(&mut archive)?;
    archive.close()?;
    Ok(())
}

/// The cases with exact answers.
fn exact_cases(
    archive: &mut Archive,
    folder: &Path,
    nodes: &[Vec<usize>],
) -> Result<(), Box<dyn Error>> {
    let hidden = HiddenMarkov::read(&folder.join("case1_hmm13.json"))?;
    let steps: Vec<_> = hidden.observations.iter().zip(&hidden.filter).collect();
    let rows = distances::<_, 0>(&hidden, (nodes, &risks_of_thirteen()?), &steps);
    report(archive, "thirteen modes, no continuous state", &rows);
    archive.store("hidden-markov.json", &json!(rows))?;

    let jump = JumpLinear::read(&folder.join("case3_jmls3_full.json"))?;
    let observations: Vec<_> = jump.observations().collect();
    let steps: Vec<_> = observations.iter().zip(&jump.filter).collect();
    let mut rows = distances::<_, 3>(&jump, (&[vec![1, 2]], &[1.0; 3]), &steps);
    let seen: Vec<_> = observations
        .iter()
        .map(|z| lanes::linear::Observation {
            state: z.pose,
            rates: z.wheels,
        })
        .collect();
    let on_lanes: Vec<_> = seen.iter().zip(&jump.filter).collect();
    let linear = jump.linear_model()?;
    for count in [32, 100, 1_000, 10_000, 100_000] {
        let make = |seed| -> Box<dyn Filter<Observation = _>> {
            Box::new(LaneLookAhead::new(linear.clone(), count, seed))
        };
        rows.push(row("look-ahead, lanes", Some(count), make, &on_lanes));
    }
    report(archive, "three modes that move a pose", &rows);
    archive.store("jump-linear.json", &json!(rows))?;
    Ok(())
}

/// Rare faults in simulated runs.
fn simulated_runs(
    archive: &mut Archive,
    folder: &Path,
    nodes: &[Vec<usize>],
) -> Result<(), Box<dyn Error>> {
    let (planar, _) = Planar::read(folder)?;
    let risk = risks_of_thirteen()?;
    let mut cells = Vec::new();
    for with_wheels in [true, false] {
        for p_fault in [1e-3, 1e-5, 1e-6] {
            let scenario = Scenario {
                p_fault,
                with_wheels,
                runs: RUNS,
            };
            eprintln!("simulating p(fault) = {p_fault:e}, wheel rates: {with_wheels}");
            let found = rare_faults(&planar, (nodes, &risk), &scenario, &SIMULATED);
            let title = format!("{RUNS} simulated faults of p = {p_fault:e} per step");
            matched_table(archive, &title, with_wheels, STEP_S, &found);
            let raw: Vec<Value> = found.iter().map(Outcome::json).collect();
            cells.push(json!({"p_fault": p_fault, "wheels": with_wheels, "cells": raw}));
        }
    }
    archive.store("simulated.json", &json!(cells))?;
    Ok(())
}

/// Risk of each of thirteen modes: nominal, six stuck wheels, six broken encoders.
fn risks_of_thirteen() -> Result<Vec<f64>, Box<dyn Error>> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let decision = vigil_setup::load_decision(&root.join("config/rover.pomdp"))?;
    let wheels = ["LF", "LM", "LR", "RF", "RM", "RR"];
    let mut names = vec!["ND".to_owned()];
    for kind in ["STUCK", "ENC"] {
        names.extend(wheels.iter().map(|wheel| format!("{wheel}_{kind}")));
    }
    let modes: Vec<(&str, f64)> = names.iter().map(|name| (name.as_str(), 0.0)).collect();
    Ok(risks(&decision, &modes, usize::MAX)?)
}

/// Recorded runs that the model was not learned from.
fn recorded_runs(archive: &mut Archive) -> Result<(), Box<dyn Error>> {
    // Hundreds of tracks a step would take hours here.
    let wanted = SIMULATED.iter().copied();
    let wanted: Vec<_> = wanted
        .filter(|(kind, _)| *kind != Kind::Sequences)
        .collect();
    let recorded = Recorded::read(&PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(".."))?;
    let mut cells = Vec::new();
    for with_wheels in [true, false] {
        for p_fault in [1e-3, 1e-5, 1e-6] {
            let runs = recorded.runs(with_wheels);
            eprintln!("recorded runs, p(fault) = {p_fault:e}, wheel rates: {with_wheels}");
            let found = recorded.outcomes(p_fault, with_wheels, &wanted);
            let title =
                format!("{runs} recorded runs, the filters expect p = {p_fault:e} per step");
            matched_table(archive, &title, with_wheels, recorded.step_s(), &found);
            let raw: Vec<Value> = found.iter().map(Outcome::json).collect();
            cells.push(json!({"p_fault": p_fault, "wheels": with_wheels, "cells": raw}));
        }
    }
    archive.store("recorded.json", &json!(cells))?;
    Ok(())
}

/// Every filter at every number of particles against the exact beliefs.
fn distances<M: Model<N>, const N: usize>(
    model: &M,
    (nodes, risk): (&[Vec<usize>], &[f64]),
    steps: &[(&<M as Model<N>>::Seen, &impl AsRef<[f64]>)],
) -> Vec<Value>
where
    <M as Model<N>>::Seen: Sized,
{
    let mut rows = Vec::new();
    for kind in Kind::ALL {
        for count in COUNTS.into_iter().filter(|&count| kind.is_sensible(count)) {
            let sampled = kind.is_sampled().then_some(count);
            let make = |seed| -> Box<dyn Filter<Observation = _>> {
                build::<M, N>(kind, model, (nodes, risk), count, seed)
            };
            rows.push(row(kind.name(), sampled, make, steps));
            if sampled.is_none() {
                break;
            }
        }
    }
    rows
}

/// One filter against the exact beliefs, over several seeds.
fn row<Z>(
    name: &str,
    count: Option<usize>,
    make: impl Fn(u64) -> Box<dyn Filter<Observation = Z>>,
    steps: &[(&Z, &impl AsRef<[f64]>)],
) -> Value {
    eprintln!("{name}, {} particles", count.unwrap_or(0));
    let seeds = match count {
        None => 1,
        Some(1_000_000..) => 1,
        Some(100_000..) => 3,
        Some(_) => 20,
    };
    let (mut l1, mut kl, mut times_ns) = (0.0, 0.0, Vec::new());
    for seed in 0..seeds {
        let mut filter = make(seed);
        for (z, exact) in steps {
            let started = Instant::now();
            filter.step(z);
            times_ns.push(started.elapsed().as_nanos() as f64);
            let (d, k) = distance(filter.posterior(), exact.as_ref());
            (l1, kl) = (l1 + d, kl + k);
        }
    }
    let n = (seeds as usize * steps.len()) as f64;
    let [p50, p99] = [0.5, 0.99].map(|q| quantile(&mut times_ns, q));
    json!({
        "filter": name, "particles": count, "l1": l1 / n, "kl": kl / n, "step_ns_p50": p50,
        "step_ns_p99": p99, "seeds": seeds, "samples": times_ns.len(),
    })
}

/// `Σ|p - q|` and `KL(q|p)`; a mode that the filter holds impossible counts as 1e-12.
fn distance(p: &[f64], q: &[f64]) -> (f64, f64) {
    let pairs = || p.iter().zip(q);
    let l1 = pairs().map(|(p, q)| (p - q).abs()).sum();
    let kl = pairs()
        .filter(|(_, q)| **q > 0.0)
        .map(|(p, q)| q * (q / p.max(1e-12)).ln());
    (l1, kl.sum())
}

fn report(archive: &mut Archive, title: &str, rows: &[Value]) {
    archive.say(&format!("## {title}\n"));
    archive
        .say("| filter | particles | L1 | KL | step p50, us | p99 | ns per particle p50 | p99 |");
    archive.say("|---|---|---|---|---|---|---|---|");
    for row in rows {
        let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
        let [p50, p99] = [number("step_ns_p50"), number("step_ns_p99")];
        let samples = row["samples"].as_u64().unwrap_or(0);
        let tail = |ns: f64, digits: usize| percentile(0.99, samples, format!("{ns:.digits$}"));
        let (particles, each) = match row["particles"].as_f64() {
            Some(count) => (
                format!("{count}"),
                format!("{:.1} | {}", p50 / count, tail(p99 / count, 1)),
            ),
            None => ("-".into(), "- | -".into()),
        };
        archive.say(&format!(
            "| {} | {particles} | {:.4} | {:.2e} | {:.2} | {} | {each} |",
            row["filter"].as_str().unwrap_or("?"),
            number("l1"),
            number("kl"),
            p50 * 1e-3,
            tail(p99 * 1e-3, 2),
        ));
    }
    archive.say("");
}

fn matched_table(
    archive: &mut Archive,
    title: &str,
    with_wheels: bool,
    step_s: f64,
    found: &[Outcome],
) {
    let sensors = if with_wheels {
        "pose and wheel rates"
    } else {
        "pose"
    };
    archive.say(&format!("## {title}, {sensors}\n"));
    for line in HEAD {
        archive.say(line);
    }
    for outcome in found {
        archive.say(&outcome.row(step_s));
    }
    archive.say("");
    let with = |kind: Kind, count| {
        let mut all = found.iter();
        all.find(|o| o.name == kind.name() && o.count == Some(count))
    };
    for (a, b) in PAIRS {
        for count in [100, 1_000] {
            if let (Some(a), Some(b)) = (with(a, count), with(b, count)) {
                archive.say(&compare(a, b, step_s));
            }
        }
    }
    if let Some(level) = with(Kind::Bootstrap, 10_000).map(Outcome::leaf_share) {
        archive.say(&particles_for(found, level));
    }
    archive.say("");
}
