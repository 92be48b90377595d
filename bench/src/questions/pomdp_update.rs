//! How fast is a belief update?
//!
//! The sparse tracker beside a plain dense loop, on the same trajectories, in turn. Reads the
//! public POMDP files that VIGIL_DATA names.

use std::error::Error;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::{percentile, quantile};
use vigil_decision::{Evidence, Pomdp, Tracker};

use super::Json;

const FILES: [&str; 16] = [
    "tiger.95",
    "tiger.aaai",
    "cheng.D3-5",
    "1d",
    "1d.noisy",
    "paint95-zmdp",
    "web-ad",
    "bridge-repair",
    "network",
    "shuttle95-zmdp",
    "4x3.95",
    "cheese.95",
    "mini-hall2",
    "tiger-grid",
    "hallway",
    "machine",
];
/// Updates of one trajectory.
const STEPS: usize = 1_000;
/// How often each trajectory is gone through.
const ROUNDS: usize = 40;
/// Readings of the clock alone.
const READINGS: usize = 10_000;

/// Answers the question.
pub fn run(args: &Json) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build measures nothing: use scripts/bench".into());
    }
    let data = std::env::var_os("VIGIL_DATA")
        .ok_or("VIGIL_DATA is not set: it names the folder that holds pomdp/*.pomdp")?;
    let mut rows = Vec::new();
    for name in FILES {
        let path = PathBuf::from(&data).join(format!("pomdp/{name}.pomdp"));
        let text =
            std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        rows.push(measure(name, &text)?);
    }
    let clock = clock_ns();
    let document = json!({ "steps": STEPS, "rounds": ROUNDS, "clock_ns": clock, "rows": rows });
    if args.json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("pomdp-update")?;
    say(&mut archive, &rows, clock);
    archive.store("pomdp-update.json", &document)?;
    archive.close()?;
    Ok(())
}

/// The plain loops: every state, every successor, likely or not.
struct Dense {
    states: usize,
    observations: usize,
    /// T[a][s][s'].
    transition: Vec<f64>,
    /// Z[a][z][s'].
    observation: Vec<f64>,
    belief: Vec<f64>,
    next: Vec<f64>,
}

impl Dense {
    fn new(model: &Pomdp) -> Self {
        let (n, k) = (model.states().len(), model.observations().len());
        let mut transition = vec![0.0; model.actions().len() * n * n];
        let mut observation = Vec::new();
        for a in 0..model.actions().len() {
            for s in 0..n {
                for &(to, p) in model.successors(s, a) {
                    transition[(a * n + s) * n + to] = p;
                }
            }
            for z in 0..k {
                observation.extend_from_slice(model.likelihood(a, z));
            }
        }
        Self {
            states: n,
            observations: k,
            transition,
            observation,
            belief: model.start().to_vec(),
            next: vec![0.0; n],
        }
    }

    /// Row by row, so that the compiler can take several successors at a time.
    fn update(&mut self, action: usize, observation: usize) -> f64 {
        let n = self.states;
        self.next.fill(0.0);
        let matrix = &self.transition[action * n * n..][..n * n];
        for (b, row) in self.belief.iter().zip(matrix.chunks_exact(n)) {
            for (next, p) in self.next.iter_mut().zip(row) {
                *next += b * p;
            }
        }
        let likelihood = &self.observation[(action * self.observations + observation) * n..][..n];
        let mut sum = 0.0;
        for (next, l) in self.next.iter_mut().zip(likelihood) {
            *next *= l;
            sum += *next;
        }
        for (b, next) in self.belief.iter_mut().zip(&self.next) {
            *b = next / sum;
        }
        sum
    }
}

/// An index by its weight.
fn draw(rng: &mut Pcg64Mcg, weights: impl Iterator<Item = (usize, f64)>) -> Option<usize> {
    let mut left: f64 = rng.random();
    let mut last = None;
    for (index, weight) in weights.filter(|(_, weight)| *weight > 0.0) {
        last = Some(index);
        left -= weight;
        if left < 0.0 {
            break;
        }
    }
    last
}

/// Actions drawn evenly and observations drawn from the model: each can follow.
fn trajectory(model: &Pomdp) -> Option<Vec<(usize, usize)>> {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut state = draw(&mut rng, model.start().iter().copied().enumerate())?;
    let step = |_| {
        let action = rng.random_range(0..model.actions().len());
        state = draw(&mut rng, model.successors(state, action).iter().copied())?;
        let z = (0..model.observations().len()).map(|z| (z, model.likelihood(action, z)[state]));
        Some((action, draw(&mut rng, z)?))
    };
    (0..STEPS).map(step).collect()
}

fn clock_ns() -> f64 {
    let mut readings: Vec<f64> = (0..READINGS)
        .map(|_| Instant::now().elapsed().as_nanos() as f64)
        .collect();
    quantile(&mut readings, 0.5)
}

fn measure(name: &str, text: &str) -> Result<Value, Box<dyn Error>> {
    let started = Instant::now();
    let model = Pomdp::parse(text).map_err(|e| format!("{name}: {e}"))?;
    let load_ms = started.elapsed().as_secs_f64() * 1e3;
    let steps = trajectory(&model).ok_or_else(|| format!("{name}: a row without weight"))?;
    let mut times = [const { Vec::new() }; 2];
    let (mut distance, mut support) = (0.0_f64, 0);
    for _ in 0..ROUNDS {
        let mut dense = Dense::new(&model);
        for &(action, z) in &steps {
            let started = Instant::now();
            black_box(dense.update(black_box(action), black_box(z)));
            times[0].push(started.elapsed().as_nanos() as f64);
        }
        let mut tracker = Tracker::new(&model);
        for &(action, z) in &steps {
            let started = Instant::now();
            let evidence = black_box(tracker.update(&model, black_box(action), black_box(z)));
            times[1].push(started.elapsed().as_nanos() as f64);
            support += tracker.support().len();
            if evidence == Evidence::Impossible {
                return Err(format!("{name}: an observation that can be was refused").into());
            }
        }
        let pairs = tracker.belief().iter().zip(&dense.belief);
        distance = pairs.fold(distance, |most, (b, d)| most.max((b - d).abs()));
    }
    let [dense, sparse] = times.each_mut().map(|times| {
        let mean = times.iter().sum::<f64>() / times.len() as f64;
        let [p50, p999] = [0.5, 0.999].map(|q| quantile(times, q));
        json!({ "p50_ns": p50, "p999_ns": p999, "mean_ns": mean })
    });
    let number = |value: &Value, key: &str| value[key].as_f64().unwrap_or(f64::NAN);
    Ok(json!({
        "file": name,
        "states": model.states().len(),
        "actions": model.actions().len(),
        "observations": model.observations().len(),
        "load_ms": load_ms,
        "support_mean": support as f64 / (ROUNDS * STEPS) as f64,
        "dense": dense,
        "sparse": sparse,
        "ratio_p50": number(&dense, "p50_ns") / number(&sparse, "p50_ns"),
        "distance_max": distance,
    }))
}

fn say(archive: &mut Archive, rows: &[Value], clock: f64) {
    archive.say(&format!(
        "{STEPS} updates of one random trajectory, {ROUNDS} times; each update timed, ns, the \
         clock's {clock:.0} ns"
    ));
    archive.say("included. Dense: a plain loop over all of T, row by row, in double precision.");
    archive.say("Sparse: the tracker. Ratio of the medians; support: states that the belief does");
    archive.say(
        "not rule out, mean; distance: of the two beliefs at the end, largest of all states.\n",
    );
    archive.say(
        "| file | S/A/O | load ms | support | dense p50 | p99.9 | sparse p50 | p99.9 | ratio | \
         distance |",
    );
    archive.say("|---|---|---|---|---|---|---|---|---|---|");
    for row in rows {
        let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
        let (dense, sparse) = (&row["dense"], &row["sparse"]);
        let tail = |of: &Value| {
            let ns = format!("{:.0}", number(&of["p999_ns"]));
            percentile(0.999, (ROUNDS * STEPS) as u64, ns)
        };
        archive.say(&format!(
            "| {} | {}/{}/{} | {:.2} | {:.1} | {:.0} | {} | {:.0} | {} | {:.1} | {:.1e} |",
            row["file"].as_str().unwrap_or_default(),
            row["states"],
            row["actions"],
            row["observations"],
            number(&row["load_ms"]),
            number(&row["support_mean"]),
            number(&dense["p50_ns"]),
            tail(dense),
            number(&sparse["p50_ns"]),
            tail(sparse),
            number(&row["ratio_p50"]),
            number(&row["distance_max"]),
        ));
    }
}
