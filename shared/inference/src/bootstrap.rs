//! The hybrid particle filter: the paper's second listing, and what better proposals make of it.
//!
//! Per particle and step (Verma, Fernandez and Simmons 2002, section 4.1): draw a mode, draw a
//! continuous state, weigh by the likelihood; then resample. With [`Proposal::prior`] this is the
//! paper's classical filter; with [`Proposal::raised`] faults are tried more often than they occur;
//! with [`Proposal::risk_sensitive`] it is the decision-theoretic filter. The belief over modes is
//! the sum of weights before resampling, which has less variance than the one after.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::adaptive::Adaptive;
use crate::filter::{Event, Filter, Step, normalise_into};
use crate::hybrid::Sampled;
use crate::logspace::log_add;
use crate::proposal::Proposal;
use crate::resample::Resampling;
use crate::weights::Weights;

/// Steps without a usable observation after which the continuous states are drawn anew. Chosen: a
/// quarter of a second of 50 ms observations.
const COASTED_MAX: u32 = 5;

/// A particle filter over the modes and states of `M`. All buffers are made once.
#[derive(Debug, Clone)]
pub struct ParticleFilter<M: Sampled> {
    model: M,
    proposal: Proposal,
    resampling: Resampling,
    adaptive: Option<Adaptive>,
    count_max: usize,
    /// Particles allowed at present, at most `count_max`.
    allowed: usize,
    rng: Pcg64Mcg,
    modes: Vec<u16>,
    states: Vec<M::State>,
    other_modes: Vec<u16>,
    other_states: Vec<M::State>,
    weights: Weights,
    /// What a particle's weight pays for its proposal.
    correction: Vec<f64>,
    increments: Vec<f64>,
    ancestors: Vec<u32>,
    log_p: Vec<f64>,
    posterior: Vec<f64>,
    /// `ln Σ W / r` over the particles as they are: undoes the tilt in the evidence.
    log_untilted: f64,
    coasted: u32,
}

impl<M: Sampled> ParticleFilter<M> {
    /// A filter of `count` particles, at least 1.
    pub fn new(
        model: M,
        proposal: Proposal,
        resampling: Resampling,
        count: usize,
        seed: u64,
    ) -> Self {
        let (count, modes) = (count.max(1), model.modes());
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let state = model.draw(0, &mut rng);
        let mut filter = Self {
            proposal,
            resampling,
            adaptive: None,
            count_max: count,
            allowed: count,
            rng,
            modes: vec![0; count],
            states: vec![state; count],
            other_modes: vec![0; count],
            other_states: vec![state; count],
            weights: Weights::equal(count),
            correction: vec![0.0; count],
            increments: vec![0.0; count],
            ancestors: vec![0; count],
            log_p: vec![0.0; modes],
            posterior: vec![0.0; modes],
            log_untilted: 0.0,
            coasted: 0,
            model,
        };
        filter.reset();
        filter
    }

    /// The same filter with a number of particles that follows the belief's spread, at most the
    /// number of the start.
    #[must_use]
    pub fn with_adaptive_count(mut self, adaptive: Adaptive) -> Self {
        self.adaptive = Some(adaptive);
        self
    }

    /// From the next step on at most `count` particles, 1 to the number of the start: fewer cost
    /// less, and are resampled from those there are.
    pub fn limit(&mut self, count: usize) {
        self.allowed = count.clamp(1, self.count_max);
    }

    /// The model.
    #[must_use]
    pub const fn model(&self) -> &M {
        &self.model
    }

    /// Begins anew from the prior and with the generator at `seed`: equal runs then have equal
    /// beliefs, whatever came before.
    pub fn restart(&mut self, seed: u64) {
        self.rng = Pcg64Mcg::seed_from_u64(seed);
        self.reset();
    }

    /// The model, to give it the command of the next step.
    pub const fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }

    /// Particles at present.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.modes.len()
    }

    /// Mode, state and un-tilted weight of each particle; the weights need not sum to 1.
    pub fn particles(&self) -> impl Iterator<Item = (usize, &M::State, f64)> {
        let weights = self.weights.linear();
        self.modes
            .iter()
            .zip(&self.states)
            .zip(weights)
            .map(|((&mode, state), weight)| {
                let mode = usize::from(mode);
                (mode, state, weight * (-self.proposal.log_risk(mode)).exp())
            })
    }

    /// Draws states for the particles' modes, from the prior or around an observation.
    fn redraw(&mut self, z: Option<&M::Observation>) {
        let initial = |model: &M, u: f64| {
            let mut sum = 0.0;
            (0..model.modes())
                .find(|&mode| {
                    sum += model.initial(mode);
                    u < sum
                })
                .unwrap_or(0)
        };
        let count = self.allowed;
        self.modes.resize(count, 0);
        self.states.truncate(count);
        self.weights.level(count);
        for i in 0..count {
            let mode = initial(&self.model, self.rng.random());
            self.modes[i] = mode as u16;
            let found = z.and_then(|z| self.model.locate(mode, z, &mut self.rng));
            let state = found.unwrap_or_else(|| self.model.draw(mode, &mut self.rng));
            if i < self.states.len() {
                self.states[i] = state;
            } else {
                self.states.push(state);
            }
            // Drawn from the prior, not from the tilted one.
            self.increments[i] = self.proposal.log_risk(mode);
        }
        self.weights.absorb(&self.increments[..count]);
        self.coasted = 0;
        self.sum_modes();
    }

    fn predict(&mut self) {
        for i in 0..self.count() {
            let from = usize::from(self.modes[i]);
            let (to, correction) = self.proposal.next(from, self.rng.random());
            self.modes[i] = to as u16;
            self.states[i] = self.model.propagate(to, &self.states[i], &mut self.rng);
            self.correction[i] = correction;
        }
    }

    /// Weighs by the observation; the increment of the tilted log-evidence, if there is one.
    fn update(&mut self, z: &M::Observation) -> Option<f64> {
        let count = self.count();
        for i in 0..count {
            let mode = usize::from(self.modes[i]);
            self.increments[i] =
                self.correction[i] + self.model.log_likelihood(mode, &self.states[i], z);
        }
        self.weights.absorb(&self.increments[..count])
    }

    /// The belief over modes, without the tilt; `ln Σ W / r`.
    fn sum_modes(&mut self) {
        self.log_p.fill(f64::NEG_INFINITY);
        for (&mode, &log_weight) in self.modes.iter().zip(self.weights.log()) {
            let mode = usize::from(mode);
            let log_p = &mut self.log_p[mode];
            *log_p = log_add(*log_p, log_weight - self.proposal.log_risk(mode));
        }
        self.log_untilted = crate::logspace::log_sum_exp(&self.log_p);
        normalise_into(&self.log_p, &mut self.posterior);
    }

    fn resample(&mut self) {
        let next = match &mut self.adaptive {
            Some(adaptive) => {
                let model = &self.model;
                let occupied = self
                    .modes
                    .iter()
                    .zip(&self.states)
                    .zip(self.weights.linear());
                let cells = occupied
                    .filter(|(_, weight)| **weight > 0.0)
                    .map(|((&mode, state), _)| (u64::from(mode) << 48) ^ model.cell(state));
                adaptive.count(cells).min(self.allowed)
            }
            None => self.allowed,
        };
        self.ancestors.resize(next, 0);
        let (weights, spare) = (self.weights.linear(), &mut self.increments);
        let scheme = self.resampling.scheme;
        if !scheme.resample(weights, spare, &mut self.ancestors, &mut self.rng) {
            return;
        }
        self.other_modes.clear();
        self.other_states.clear();
        for &ancestor in &self.ancestors {
            self.other_modes.push(self.modes[ancestor as usize]);
            self.other_states.push(self.states[ancestor as usize]);
        }
        std::mem::swap(&mut self.modes, &mut self.other_modes);
        std::mem::swap(&mut self.states, &mut self.other_states);
        self.weights.level(next);
        // Which tilted particles survived decides what the next evidence is relative to.
        self.log_untilted = f64::NEG_INFINITY;
        let share = -(next as f64).ln();
        for &mode in &self.modes {
            let untilted = share - self.proposal.log_risk(usize::from(mode));
            self.log_untilted = log_add(self.log_untilted, untilted);
        }
    }
}

impl<M: Sampled> Filter for ParticleFilter<M> {
    type Observation = M::Observation;

    fn step(&mut self, z: &M::Observation) -> Step {
        self.predict();
        let before = self.log_untilted;
        let mut event = None;
        let mut log_evidence = 0.0;
        if let Some(tilted) = self.update(z) {
            self.coasted = 0;
            self.sum_modes();
            log_evidence = tilted + self.log_untilted - before;
        } else {
            let count = self.count();
            self.weights.absorb(&self.correction[..count]);
            self.coasted += 1;
            event = Some(Event::Coasted);
            if self.coasted >= COASTED_MAX {
                self.redraw(Some(z));
                event = Some(Event::Restarted);
            }
            self.sum_modes();
        }
        let effective_sample_size = self.weights.effective_sample_size();
        let count = self.count();
        let is_limited = count > self.allowed || self.adaptive.is_none() && count < self.allowed;
        if effective_sample_size < self.resampling.threshold * count as f64
            || self.resampling.threshold >= 1.0
            || is_limited
        {
            self.resample();
        }
        Step {
            log_evidence,
            effective_sample_size,
            event,
        }
    }

    fn posterior(&self) -> &[f64] {
        &self.posterior
    }

    fn reset(&mut self) {
        self.redraw(None);
    }
}
