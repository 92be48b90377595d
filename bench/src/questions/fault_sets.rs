//! How long does the exact belief over all 4096 sets of twelve faults take per step?

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::json;
use vigil_bench::archive::Archive;
use vigil_bench::{percentile, quantile};
use vigil_inference::fault_sets::{Component, FaultSets};

const WHEELS: usize = 6;
const STEPS: usize = 10_000;

/// Answers the question.
pub fn run() -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new("fault-sets")?;
    let component = Component {
        prior: 0.0,
        birth: 1e-6,
        death: 1e-3,
    };
    let mut belief = FaultSets::new(&[component; 2 * WHEELS])?;
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut times_us = Vec::with_capacity(STEPS);
    for _ in 0..STEPS {
        let body: [f64; 1 << WHEELS] = std::array::from_fn(|_| -9.0 * rng.random::<f64>());
        let wheels: [[f64; 4]; WHEELS] =
            std::array::from_fn(|_| std::array::from_fn(|_| -9.0 * rng.random::<f64>()));
        let started = Instant::now();
        belief.predict();
        let evidence = belief.update_wheels(&body, &wheels);
        times_us.push(started.elapsed().as_nanos() as f64 * 1e-3);
        black_box((&belief, evidence.ok_or("a step was impossible")?));
    }
    let [p50, p99, max] = [0.5, 0.99, 1.0].map(|q| quantile(&mut times_us, q));
    archive.say("Prediction and update of 4096 sets, one core, us per step:\n");
    archive.say(&format!(
        "p50 {p50:.1}, p99 {}, max {max:.1} (n = {STEPS})",
        percentile(0.99, STEPS as u64, format!("{p99:.1}"))
    ));
    let raw = json!({"n": STEPS, "p50_us": p50, "p99_us": p99, "max_us": max});
    archive.store("fault-sets.json", &raw)?;
    archive.close()?;
    Ok(())
}
