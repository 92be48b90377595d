//! The yardstick: the particle filter as one writes it first. A vector of structs in double
//! precision, normal draws and mode draws from the usual crates, one loop after the other.
//!
//! Not a straw man: it allocates nothing per step, its draws are the ziggurat's, it resamples
//! systematically in linear time. It only takes no thought of vectors.

use rand::distr::Distribution;
use rand::distr::weighted::WeightedIndex;
use rand::{RngExt, SeedableRng};
use rand_distr::Normal;
use rand_pcg::Pcg64;
use vigil_inference::angle::wrap;
use vigil_inference::lanes::{Observation, PlanarParameters};

#[derive(Debug, Clone, Copy)]
struct Particle {
    mode: usize,
    x: f64,
    y: f64,
    theta: f64,
}

/// The filter.
#[derive(Debug)]
pub struct Naive {
    model: PlanarParameters,
    next_mode: Vec<WeightedIndex<f64>>,
    noise: [Normal<f64>; 3],
    particles: Vec<Particle>,
    others: Vec<Particle>,
    weights: Vec<f64>,
    posterior: Vec<f64>,
    rng: Pcg64,
}

impl Naive {
    /// A filter of `count` particles.
    ///
    /// # Errors
    /// A model that is not one.
    pub fn new(
        model: &PlanarParameters,
        count: usize,
        seed: u64,
    ) -> Result<Self, Box<dyn std::error::Error>> {
        let mut rng = Pcg64::seed_from_u64(seed);
        let initial = WeightedIndex::new(&model.initial)?;
        let mut particles = Vec::new();
        for _ in 0..count {
            let mut at = model.start;
            for (at, sd) in at.iter_mut().zip(model.start_sd) {
                *at += Normal::new(0.0, sd)?.sample(&mut rng);
            }
            particles.push(Particle {
                mode: initial.sample(&mut rng),
                x: at[0],
                y: at[1],
                theta: at[2],
            });
        }
        let rows = model.transition.iter().map(WeightedIndex::new);
        Ok(Self {
            next_mode: rows.collect::<Result<_, _>>()?,
            noise: [
                Normal::new(0.0, model.motion_sd[0])?,
                Normal::new(0.0, model.motion_sd[1])?,
                Normal::new(0.0, model.motion_sd[2])?,
            ],
            others: particles.clone(),
            particles,
            weights: vec![0.0; count],
            posterior: vec![0.0; model.initial.len()],
            rng,
            model: model.clone(),
        })
    }

    /// Posterior of the modes before resampling.
    #[must_use]
    pub fn posterior(&self) -> &[f64] {
        &self.posterior
    }

    /// One step; returns the log-evidence without constants, and the effective sample size.
    pub fn step(&mut self, z: &Observation) -> (f64, f64) {
        let m = &self.model;
        for p in &mut self.particles {
            p.mode = self.next_mode[p.mode].sample(&mut self.rng);
            let (sin, cos) = p.theta.sin_cos();
            let [dx, dy, turn] = m.motion[p.mode];
            p.x += cos * dx - sin * dy + self.noise[0].sample(&mut self.rng);
            p.y += sin * dx + cos * dy + self.noise[1].sample(&mut self.rng);
            p.theta += turn + self.noise[2].sample(&mut self.rng);
        }
        let mut highest = f64::NEG_INFINITY;
        for (p, log_weight) in self.particles.iter().zip(&mut self.weights) {
            let ex = (z.pose[0] - p.x) / m.pose_sd[0];
            let ey = (z.pose[1] - p.y) / m.pose_sd[1];
            let et = wrap(z.pose[2] - p.theta) / m.pose_sd[2];
            let mut sum = ex * ex + ey * ey + et * et;
            for (rate, mean) in z.wheel_rates.iter().zip(&m.wheel_rates[p.mode]) {
                let e = (rate - mean) / m.wheel_rate_sd;
                sum += e * e;
            }
            *log_weight = -0.5 * sum;
            highest = highest.max(*log_weight);
        }
        let mut total = 0.0;
        for weight in &mut self.weights {
            *weight = (*weight - highest).exp();
            total += *weight;
        }
        self.posterior.fill(0.0);
        let mut squares = 0.0;
        for (p, weight) in self.particles.iter().zip(&mut self.weights) {
            *weight /= total;
            self.posterior[p.mode] += *weight;
            squares += *weight * *weight;
        }
        self.resample();
        (
            highest + (total / self.weights.len() as f64).ln(),
            1.0 / squares,
        )
    }

    /// Systematic, with one uniform draw.
    fn resample(&mut self) {
        let count = self.particles.len();
        let u: f64 = self.rng.random();
        let mut sum = self.weights[0];
        let mut i = 0;
        for (slot, other) in self.others.iter_mut().enumerate() {
            let at = (slot as f64 + u) / count as f64;
            while at > sum && i + 1 < count {
                i += 1;
                sum += self.weights[i];
            }
            *other = self.particles[i];
        }
        std::mem::swap(&mut self.particles, &mut self.others);
    }
}
