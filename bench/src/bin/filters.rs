//! Which filter is worth its time: distance to the exact belief, delay and misses at rare faults,
//! nanoseconds per particle.

#![allow(missing_docs)]

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::filters::{Kind, Model, build};
use vigil_bench::rare::{Cell, Scenario, rare_faults};
use vigil_evaluation::cases::{HiddenMarkov, JumpLinear, Planar};

const COUNTS: [usize; 5] = [32, 100, 1_000, 10_000, 100_000];
/// Simulated runs per cell of the rare faults.
const RUNS: u64 = 60;

fn main() -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new("filters")?;
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/data/filters");
    archive
        .say("Distance to the exact belief: mean over steps of `Σ|p - q|` and of `KL(exact|p)`.");
    archive.say("Time: one step, p50; per particle for the sampled filters.\n");

    let hidden = HiddenMarkov::read(&folder.join("case1_hmm13.json"))?;
    let nodes = [vec![1, 2, 3], vec![4, 5, 6], (7..13).collect()];
    let steps: Vec<_> = hidden.observations.iter().zip(&hidden.filter).collect();
    let rows = distances::<_, 0>(&hidden, &nodes, &steps);
    report(&mut archive, "thirteen modes, no continuous state", &rows);
    archive.store("hidden-markov.json", &json!(rows))?;

    let jump = JumpLinear::read(&folder.join("case3_jmls3_full.json"))?;
    let observations: Vec<_> = jump.observations().collect();
    let steps: Vec<_> = observations.iter().zip(&jump.filter).collect();
    let rows = distances::<_, 3>(&jump, &[vec![1, 2]], &steps);
    report(&mut archive, "three modes that move a pose", &rows);
    archive.store("jump-linear.json", &json!(rows))?;

    let (planar, _) = Planar::read(&folder)?;
    let mut cells = Vec::new();
    for with_wheels in [true, false] {
        for p_fault in [1e-3, 1e-5, 1e-6] {
            let scenario = Scenario {
                p_fault,
                with_wheels,
                runs: RUNS,
            };
            eprintln!("simulating p(fault) = {p_fault}, wheels: {with_wheels}");
            let found = rare_faults(&planar, &nodes, &scenario);
            rare_table(&mut archive, &scenario, &found);
            let raw: Vec<Value> = found.iter().map(Cell::json).collect();
            cells.push(json!({"p_fault": p_fault, "wheels": with_wheels, "cells": raw}));
        }
    }
    archive.store("rare-faults.json", &json!(cells))?;
    let folder = archive.close()?;
    println!("archived in {}", folder.display());
    Ok(())
}

/// Every filter at every number of particles against the exact beliefs.
fn distances<M: Model<N>, const N: usize>(
    model: &M,
    nodes: &[Vec<usize>],
    steps: &[(&<M as Model<N>>::Seen, &impl AsRef<[f64]>)],
) -> Vec<Value>
where
    <M as Model<N>>::Seen: Sized,
{
    let mut rows = Vec::new();
    for kind in Kind::ALL {
        for count in COUNTS.into_iter().filter(|&count| kind.is_sensible(count)) {
            eprintln!("{} with {count}", kind.name());
            let seeds = if count >= 100_000 { 3 } else { 20 };
            let seeds = if kind.is_sampled() { seeds } else { 1 };
            let (mut l1, mut kl, mut times_ns) = (0.0, 0.0, Vec::new());
            for seed in 0..seeds {
                let mut filter = build::<M, N>(kind, model, nodes, count, seed);
                for (z, exact) in steps {
                    let started = Instant::now();
                    filter.step(z);
                    times_ns.push(started.elapsed().as_nanos() as f64);
                    let (d, k) = distance(filter.posterior(), exact.as_ref());
                    (l1, kl) = (l1 + d, kl + k);
                }
            }
            let n = (seeds as usize * steps.len()) as f64;
            let [p50, p99] = [0.5, 0.99].map(|q| vigil_bench::quantile(&mut times_ns, q));
            rows.push(json!({
                "filter": kind.name(), "particles": kind.is_sampled().then_some(count),
                "l1": l1 / n, "kl": kl / n, "step_ns_p50": p50, "step_ns_p99": p99, "seeds": seeds,
            }));
            if !kind.is_sampled() {
                break;
            }
        }
    }
    rows
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
    archive.say("| filter | particles | L1 | KL | step, us | ns per particle |");
    archive.say("|---|---|---|---|---|---|");
    for row in rows {
        let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
        let step_ns = number("step_ns_p50");
        let (particles, each) = match row["particles"].as_f64() {
            Some(count) => (format!("{count}"), format!("{:.1}", step_ns / count)),
            None => ("-".into(), "-".into()),
        };
        archive.say(&format!(
            "| {} | {particles} | {:.4} | {:.2e} | {:.2} | {each} |",
            row["filter"].as_str().unwrap_or("?"),
            number("l1"),
            number("kl"),
            step_ns * 1e-3,
        ));
    }
    archive.say("");
}

fn rare_table(archive: &mut Archive, scenario: &Scenario, cells: &[Cell]) {
    let sensors = if scenario.with_wheels {
        "pose and wheel rates"
    } else {
        "pose"
    };
    let (runs, p) = (scenario.runs, scenario.p_fault);
    archive.say(&format!(
        "## {runs} faults of p = {p:e} per step, {sensors}\n"
    ));
    archive.say(
        "| filter | particles | missed | false alarms | mean delay, steps | leaf right | side \
         right |",
    );
    archive.say("|---|---|---|---|---|---|---|");
    for cell in cells {
        archive.say(&cell.row());
    }
    archive.say("");
}
