//! The hybrid particle filter: the paper's second listing, and its variants by proposal.
//!
//! Per particle and step (Verma, Fernandez and Simmons 2002, section 4.1): draw a mode, draw a
//! continuous state, weigh by the likelihood; then resample. With [`Proposal::prior`] this is the
//! paper's classical filter; with [`Proposal::raised`] faults are tried more often than they occur;
//! with [`Proposal::risk_raised`] it is the decision-theoretic filter. The belief over modes is
//! the sum of weights before resampling, which has less variance than the one after.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_checkpoint::{Checkpoint, CheckpointValue};

use crate::adaptive::Adaptive;
use crate::filter::{Event, Filter, Step, normalise_into};
use crate::hybrid::{self, Modes, Sampled};
use crate::logspace::{log_add, log_sum_exp};
use crate::proposal::{Proposal, ProposalError};
use crate::resample::{Resampling, systematic};
use crate::weights::Weights;

/// Steps in a row without a usable observation after which the continuous states are drawn anew:
/// a quarter of a second at 20 observations per second. Chosen by hand: with fewer, a short
/// disturbance discards a good track; with more, a lost filter stays lost longer.
const COASTED_MAX: u32 = 5;

/// A particle filter over the modes and states of `M`. All buffers are made once.
#[derive(Debug, Clone, Checkpoint)]
#[checkpoint(bound = "M: Checkpoint")]
#[checkpoint(bound = "M::State: CheckpointValue")]
pub struct ParticleFilter<M: Sampled> {
    model: M,
    proposal: Proposal,
    #[checkpoint(fixed)]
    resampling: Resampling,
    adaptive: Option<Adaptive>,
    count_max: usize,
    /// Particles allowed at present, at most `count_max`.
    allowed: usize,
    rng: Pcg64Mcg,
    modes: Vec<u16>,
    states: Vec<M::State>,
    #[checkpoint(scratch)]
    other_modes: Vec<u16>,
    #[checkpoint(scratch)]
    other_states: Vec<M::State>,
    weights: Weights,
    /// Logarithm of the factor by which a particle's weight pays for its proposal.
    correction: Vec<f64>,
    #[checkpoint(scratch)]
    increments: Vec<f64>,
    #[checkpoint(scratch)]
    ancestors: Vec<u32>,
    log_p: Vec<f64>,
    posterior: Vec<f64>,
    /// `ln Σ W / r` over the particles as they are: undoes the tilt in the evidence.
    log_untilted: f64,
    coasted: u32,
}

impl<M: Sampled> ParticleFilter<M> {
    /// A filter of `count` particles, at least 1.
    ///
    /// # Errors
    /// [`ProposalError`] if the proposal was made for a model with another number of modes, or the
    /// model is refused.
    pub fn new(
        model: M,
        proposal: Proposal,
        resampling: Resampling,
        count: usize,
        seed: u64,
    ) -> Result<Self, ProposalError> {
        hybrid::check(&model)?;
        let (count, modes) = (count.max(1), model.modes());
        if proposal.modes() != modes {
            let found = proposal.modes();
            return Err(ProposalError::Length { found, modes });
        }
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
        Ok(filter)
    }

    /// Lets the number of particles follow the spread of the belief, up to the number of the start.
    #[must_use]
    pub fn with_adaptive_count(mut self, adaptive: Adaptive) -> Self {
        self.adaptive = Some(adaptive);
        self
    }

    /// Limits the particles to `count`, 1 to the number of the start, from the next step on. Fewer
    /// cost less; they are resampled from those there are.
    pub fn limit(&mut self, count: usize) {
        self.allowed = count.clamp(1, self.count_max);
    }

    /// Begins anew from the prior and with the generator at `seed`, so that equal runs have equal
    /// beliefs.
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

    /// Draws each particle's mode from the prior, and its state from the prior or around an
    /// observation.
    fn redraw(&mut self, z: Option<&M::Observation>) {
        let count = self.allowed;
        self.modes.resize(count, 0);
        self.states.truncate(count);
        self.weights.level(count);
        for i in 0..count {
            let mode = initial_mode(&self.model, self.rng.random());
            self.modes[i] = mode as u16;
            let found = z.and_then(|z| self.model.locate(mode, z, &mut self.rng));
            let state = found.unwrap_or_else(|| self.model.draw(mode, &mut self.rng));
            if i < self.states.len() {
                self.states[i] = state;
            } else {
                self.states.push(state);
            }
            // Drawn from the prior; weights are those of the belief tilted by the risk.
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
        self.log_untilted = log_sum_exp(&self.log_p);
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
        let weights = self.weights.linear();
        if !systematic(weights, self.rng.random(), &mut self.ancestors) {
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
        // The next evidence is relative to the particles that survived.
        self.log_untilted = f64::NEG_INFINITY;
        let share = -(next as f64).ln();
        for &mode in &self.modes {
            let untilted = share - self.proposal.log_risk(usize::from(mode));
            self.log_untilted = log_add(self.log_untilted, untilted);
        }
    }
}

/// The initial mode for a uniform draw `u` in [0, 1); the nominal one if rounding leaves none.
fn initial_mode(model: &impl Modes, u: f64) -> usize {
    let mut sum = 0.0;
    (0..model.modes())
        .find(|&mode| {
            sum += model.initial(mode);
            u < sum
        })
        .unwrap_or(0)
}

impl<M: Sampled> Filter for ParticleFilter<M> {
    type Observation = M::Observation;

    fn step(&mut self, z: &M::Observation) -> Step {
        let count = self.count();
        assert!(
            count == self.states.len()
                && count == self.weights.linear().len()
                && (1..=self.count_max).contains(&count),
            "each particle has a mode, a state and a weight, and their number is within bounds"
        );
        self.predict();
        let before = self.log_untilted;
        let mut event = None;
        let mut log_evidence = 0.0;
        if let Some(tilted) = self.update(z) {
            self.coasted = 0;
            self.sum_modes();
            log_evidence = tilted + self.log_untilted - before;
        } else {
            // The draws are paid for all the same; without an observation nothing else counts.
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
        // An adaptive number may well be smaller than what is allowed.
        let is_limited = count > self.allowed || self.adaptive.is_none() && count < self.allowed;
        if self.resampling.is_due(effective_sample_size, count) || is_limited {
            self.resample();
        }
        Step {
            log_evidence,
            effective_sample_size,
            event,
        }
        .checked(&self.posterior, count)
    }

    fn posterior(&self) -> &[f64] {
        &self.posterior
    }

    fn reset(&mut self) {
        self.redraw(None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two modes, shown by the sign of the observation; states count their steps.
    #[derive(Debug, Clone)]
    struct Sign;

    impl Modes for Sign {
        fn modes(&self) -> usize {
            2
        }

        fn transition(&self, from: usize, to: usize) -> f64 {
            if from == to { 0.75 } else { 0.25 }
        }
    }

    impl Sampled for Sign {
        type State = usize;
        type Observation = f64;

        fn draw(&self, _mode: usize, _rng: &mut Pcg64Mcg) -> usize {
            0
        }

        fn propagate(&self, _mode: usize, steps: &usize, _rng: &mut Pcg64Mcg) -> usize {
            steps + 1
        }

        fn log_likelihood(&self, mode: usize, _steps: &usize, z: &f64) -> f64 {
            match (mode == 0) == (*z >= 0.0) {
                _ if z.is_nan() => f64::NEG_INFINITY,
                // A large observation is impossible in the other mode.
                false if z.abs() > 10.0 => f64::NEG_INFINITY,
                true => 0.8_f64.ln(),
                false => 0.2_f64.ln(),
            }
        }

        fn locate(&self, _mode: usize, _z: &f64, _rng: &mut Pcg64Mcg) -> Option<usize> {
            Some(100)
        }
    }

    fn filter(count: usize) -> ParticleFilter<Sign> {
        let proposal = Proposal::prior(&Sign).unwrap();
        ParticleFilter::new(Sign, proposal, Resampling::default(), count, 1).unwrap()
    }

    #[test]
    #[should_panic(expected = "each particle has a mode, a state and a weight")]
    fn a_particle_without_a_state_is_caught() {
        let mut filter = filter(10);
        filter.states.pop();
        filter.step(&1.0);
    }

    #[test]
    fn a_proposal_for_another_number_of_modes_is_refused() {
        struct Single;
        impl Modes for Single {
            fn modes(&self) -> usize {
                1
            }

            fn transition(&self, _from: usize, _to: usize) -> f64 {
                1.0
            }
        }
        let proposal = Proposal::prior(&Single).unwrap();
        let refused = ParticleFilter::new(Sign, proposal, Resampling::default(), 10, 1);
        let length = ProposalError::Length { found: 1, modes: 2 };
        assert_eq!(refused.map(|_| ()), Err(length));
    }

    #[test]
    fn a_limit_holds_from_the_next_step_on_and_can_be_lifted() {
        let mut filter = filter(40);
        for (limit, count) in [(10, 10), (0, 1), (1000, 40)] {
            filter.limit(limit);
            filter.step(&1.0);
            assert_eq!(filter.count(), count);
            let total: f64 = filter.particles().map(|(_, _, weight)| weight).sum();
            assert!((total - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn five_lost_steps_in_a_row_begin_anew_around_the_observation_and_four_do_not() {
        let mut filter = filter(20);
        for _ in 0..2 {
            for _ in 0..4 {
                assert_eq!(filter.step(&f64::NAN).event, Some(Event::Coasted));
            }
            assert_eq!(filter.step(&1.0).event, None);
        }
        for _ in 0..4 {
            assert_eq!(filter.step(&f64::NAN).event, Some(Event::Coasted));
        }
        assert!(filter.particles().all(|(_, &steps, _)| steps == 14));
        assert_eq!(filter.step(&f64::NAN).event, Some(Event::Restarted));
        assert!(filter.particles().all(|(_, &steps, _)| steps == 100));
        assert_eq!(filter.posterior(), [1.0, 0.0]);
        assert_eq!(filter.step(&f64::NAN).event, Some(Event::Coasted));
    }

    #[test]
    fn an_adaptive_count_counts_the_cells_that_have_weight() {
        let after = |z: f64| {
            let proposal = Proposal::prior(&Sign).unwrap();
            let filter = ParticleFilter::new(Sign, proposal, Resampling::EVERY_STEP, 200, 1);
            let adaptive = Adaptive::new(0.05, 2.33, 10, 200);
            let mut filter = filter.unwrap().with_adaptive_count(adaptive);
            filter.step(&z);
            filter.count()
        };
        // All states are alike: a cell for each mode. Fox's equation 12 for two cells is 67.
        assert_eq!(after(1.0), 67);
        assert_eq!(after(20.0), 10, "one mode is impossible");
    }

    #[test]
    fn the_initial_mode_follows_the_prior() {
        struct Prior;
        impl Modes for Prior {
            fn modes(&self) -> usize {
                2
            }

            fn initial(&self, mode: usize) -> f64 {
                [0.25, 0.75][mode]
            }

            fn transition(&self, from: usize, to: usize) -> f64 {
                f64::from(u8::from(from == to))
            }
        }
        for (u, mode) in [(0.0, 0), (0.2499, 0), (0.25, 1), (0.9999, 1), (1.0, 0)] {
            assert_eq!(initial_mode(&Prior, u), mode, "{u}");
        }
    }
}
