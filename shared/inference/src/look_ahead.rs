//! Look-ahead Rao-Blackwellised particle filter.
//!
//! A particle is a mode and a Gaussian over the continuous state. Before anything is drawn, every
//! mode is tried: `l_k = ln P(k | d) + ln p(z | k, Gaussian)` by one Kalman step each. Parents are
//! resampled by `Σ_k exp(l_k)` first, then the mode is drawn by `exp(l_k)`: both drawings know the
//! observation (Morales-Menéndez, de Freitas and Poole, *Real-Time Monitoring of Complex
//! Industrial Processes with Particle Filters*, 2002). The belief over modes sums the `exp(l_k)`
//! themselves, so it has no sampling noise of this step.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_checkpoint::{Checkpoint, CheckpointValue};

use crate::filter::{Event, Filter, Step, normalise_into};
use crate::gaussian::Gaussian;
use crate::hybrid::{self, Conditional, ModelError};
use crate::logspace::{log_add, log_sum_exp};
use crate::resample::systematic;

#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
struct Particle<const N: usize> {
    mode: usize,
    state: Gaussian<N>,
}

/// The look-ahead filter of N continuous dimensions. Particles have equal weights after each step.
#[derive(Debug, Clone, Checkpoint)]
#[checkpoint(bound = "M: Checkpoint")]
pub struct LookAhead<M, const N: usize> {
    model: M,
    rng: Pcg64Mcg,
    count_max: usize,
    /// Particles wanted at present, at most `count_max`.
    allowed: usize,
    particles: Vec<Particle<N>>,
    children: Vec<Particle<N>>,
    /// Row i: `l_k` of particle i.
    log_joint: Vec<f64>,
    log_parent: Vec<f64>,
    parent: Vec<f64>,
    ancestors: Vec<u32>,
    log_p: Vec<f64>,
    posterior: Vec<f64>,
}

impl<M: Conditional<N>, const N: usize> LookAhead<M, N> {
    /// A filter of `count` particles, at least 1.
    ///
    /// # Errors
    /// [`ModelError`].
    pub fn new(model: M, count: usize, seed: u64) -> Result<Self, ModelError> {
        hybrid::check(&model)?;
        let (count, modes) = (count.max(1), model.modes());
        let particle = Particle {
            mode: 0,
            state: model.prior(0),
        };
        let mut filter = Self {
            rng: Pcg64Mcg::seed_from_u64(seed),
            count_max: count,
            allowed: count,
            particles: vec![particle; count],
            children: vec![particle; count],
            log_joint: vec![0.0; count * modes],
            log_parent: vec![0.0; count],
            parent: vec![0.0; count],
            ancestors: vec![0; count],
            log_p: vec![0.0; modes],
            posterior: vec![0.0; modes],
            model,
        };
        filter.reset();
        Ok(filter)
    }

    /// Begins anew from the prior and with the generator at `seed`, so that equal runs have equal
    /// beliefs.
    pub fn restart(&mut self, seed: u64) {
        self.rng = Pcg64Mcg::seed_from_u64(seed);
        self.reset();
    }

    /// Sets the number of particles, 1 to the number of the start, from the next step on. Fewer
    /// cost less; they are drawn from those there are.
    pub fn limit(&mut self, count: usize) {
        self.allowed = count.clamp(1, self.count_max);
    }

    /// The model, to give it the command of the next step.
    pub const fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }

    /// Mode and Gaussian of each particle; their weights are equal.
    pub fn particles(&self) -> impl Iterator<Item = (usize, &Gaussian<N>)> {
        self.particles
            .iter()
            .map(|particle| (particle.mode, &particle.state))
    }

    /// Tries every mode on every particle; false if nothing explains the observation.
    fn look_ahead(&mut self, z: &M::Observation) -> bool {
        let (modes, count) = (self.model.modes(), self.particles.len());
        self.log_p.fill(f64::NEG_INFINITY);
        self.log_parent.resize(count, 0.0);
        self.parent.resize(count, 0.0);
        for (i, particle) in self.particles.iter().enumerate() {
            let row = &mut self.log_joint[i * modes..(i + 1) * modes];
            for (mode, log_joint) in row.iter_mut().enumerate() {
                let p = hybrid::transition(&self.model, particle.mode, mode);
                let mut state = particle.state;
                *log_joint = f64::NEG_INFINITY;
                if p > 0.0 {
                    if mode != particle.mode {
                        self.model.enter(particle.mode, mode, &mut state);
                    }
                    self.model.predict(mode, &mut state);
                    let log_likelihood = self.model.update(mode, &mut state, z);
                    // A likelihood that is no number counts as impossible.
                    if let Some(log_likelihood) = log_likelihood.filter(|l| !l.is_nan()) {
                        *log_joint = p.ln() + log_likelihood;
                    }
                }
                self.log_p[mode] = log_add(self.log_p[mode], *log_joint);
            }
            self.log_parent[i] = log_sum_exp(row);
        }
        normalise_into(&self.log_parent, &mut self.parent)
    }

    /// Draws parents, then their modes, by the probabilities that the look-ahead has computed.
    fn draw(&mut self, z: &M::Observation) {
        let modes = self.model.modes();
        self.ancestors.resize(self.allowed, 0);
        systematic(&self.parent, self.rng.random(), &mut self.ancestors);
        self.children.clear();
        for &ancestor in &self.ancestors {
            let i = ancestor as usize;
            let row = &self.log_joint[i * modes..(i + 1) * modes];
            let mode = draw_index(row, self.log_parent[i], self.rng.random());
            let parent = &self.particles[i];
            let mut child = Particle { mode, ..*parent };
            if mode != parent.mode {
                self.model.enter(parent.mode, mode, &mut child.state);
            }
            self.model.predict(mode, &mut child.state);
            // Its log-likelihood is in the weights already, by the look-ahead.
            let _ = self.model.update(mode, &mut child.state, z);
            self.children.push(child);
        }
        std::mem::swap(&mut self.particles, &mut self.children);
    }

    /// Moves on without an observation: each particle draws its mode from the model.
    fn coast(&mut self) {
        let share = 1.0 / self.particles.len() as f64;
        self.posterior.fill(0.0);
        for particle in &mut self.particles {
            let (u, from) = (self.rng.random(), particle.mode);
            let row = |to| hybrid::transition(&self.model, from, to);
            particle.mode = draw_mode(self.model.modes(), u, row).unwrap_or(from);
            if particle.mode != from {
                self.model.enter(from, particle.mode, &mut particle.state);
            }
            self.model.predict(particle.mode, &mut particle.state);
            self.posterior[particle.mode] += share;
        }
    }
}

/// Mode at which the cumulative probability passes `u`; none if rounding leaves it short.
fn draw_mode(modes: usize, mut u: f64, p: impl Fn(usize) -> f64) -> Option<usize> {
    (0..modes).find(|&mode| {
        u -= p(mode);
        u < 0.0
    })
}

/// Index drawn with the probabilities `exp(log_p - log_sum)` by a uniform `u` in [0, 1).
fn draw_index(log_p: &[f64], log_sum: f64, u: f64) -> usize {
    let (mut sum, mut last) = (0.0, 0);
    for (i, log_p) in log_p.iter().enumerate() {
        let p = (log_p - log_sum).exp();
        if p > 0.0 {
            sum += p;
            last = i;
            if u < sum {
                break;
            }
        }
    }
    last
}

impl<M: Conditional<N>, const N: usize> Filter for LookAhead<M, N> {
    type Observation = M::Observation;

    fn step(&mut self, z: &M::Observation) -> Step {
        let count = self.particles.len();
        if !self.look_ahead(z) {
            self.coast();
            return Step {
                log_evidence: 0.0,
                effective_sample_size: count as f64,
                event: Some(Event::Coasted),
            }
            .checked(&self.posterior, count);
        }
        let log_evidence = log_sum_exp(&self.log_parent) - (count as f64).ln();
        normalise_into(&self.log_p, &mut self.posterior);
        let squares: f64 = self.parent.iter().map(|weight| weight * weight).sum();
        self.draw(z);
        Step {
            log_evidence,
            effective_sample_size: 1.0 / squares,
            event: None,
        }
        .checked(&self.posterior, count)
    }

    fn posterior(&self) -> &[f64] {
        &self.posterior
    }

    fn reset(&mut self) {
        self.posterior.fill(0.0);
        let count = self.particles.len();
        for (i, particle) in self.particles.iter_mut().enumerate() {
            // Evenly over the prior's cumulative probabilities.
            let u = (i as f64 + 0.5) / count as f64;
            let initial = |mode| self.model.initial(mode);
            particle.mode = draw_mode(self.model.modes(), u, initial).unwrap_or(0);
            particle.state = self.model.prior(particle.mode);
            self.posterior[particle.mode] += 1.0 / count as f64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hybrid::Modes;
    use nalgebra::{SMatrix, SVector};

    /// Two modes by turns, which move by 1 and by 10; no observation is possible.
    struct Turns;

    impl Modes for Turns {
        fn modes(&self) -> usize {
            2
        }

        fn transition(&self, from: usize, to: usize) -> f64 {
            f64::from(u8::from(from != to))
        }
    }

    impl Conditional<1> for Turns {
        type Observation = ();

        fn prior(&self, _mode: usize) -> Gaussian<1> {
            Gaussian {
                mean: SVector::zeros(),
                covariance: SMatrix::identity(),
            }
        }

        fn enter(&self, _from: usize, _to: usize, state: &mut Gaussian<1>) {
            state.mean[0] += 100.0;
        }

        fn predict(&self, mode: usize, state: &mut Gaussian<1>) {
            state.mean[0] += [1.0, 10.0][mode];
        }

        fn update(&self, _mode: usize, _state: &mut Gaussian<1>, _z: &()) -> Option<f64> {
            None
        }
    }

    #[test]
    fn without_a_possible_observation_particles_follow_the_chain() {
        let mut filter = LookAhead::<_, 1>::new(Turns, 4, 1).unwrap();
        for (posterior, mode, mean) in [([0.0, 1.0], 1, 110.0), ([1.0, 0.0], 0, 211.0)] {
            let step = filter.step(&());
            assert_eq!((step.event, step.log_evidence), (Some(Event::Coasted), 0.0));
            assert_eq!(filter.posterior(), posterior);
            let all: Vec<_> = filter
                .particles()
                .map(|(mode, g)| (mode, g.mean[0]))
                .collect();
            assert_eq!(all, [(mode, mean); 4]);
        }
    }

    #[test]
    fn a_restart_begins_from_the_prior() {
        let mut filter = LookAhead::<_, 1>::new(Turns, 4, 1).unwrap();
        for _ in 0..2 {
            filter.restart(1);
            filter.step(&());
            assert_eq!(filter.posterior(), [0.0, 1.0]);
            assert!(
                filter
                    .particles()
                    .all(|(mode, g)| mode == 1 && g.mean[0] == 110.0)
            );
        }
    }

    #[test]
    fn an_index_is_drawn_where_the_cumulative_probability_passes_u() {
        let log_p = [0.125_f64, 0.0, 0.25, 0.625].map(f64::ln);
        for (u, index) in [
            (0.0, 0),
            (0.124, 0),
            (0.126, 2),
            (0.374, 2),
            (0.376, 3),
            (0.999, 3),
        ] {
            assert_eq!(draw_index(&log_p, 0.0, u), index, "{u}");
            let halved = log_p.map(|log_p| log_p - 2.0_f64.ln());
            assert_eq!(draw_index(&halved, -2.0_f64.ln(), u), index, "{u}");
        }
    }
}
