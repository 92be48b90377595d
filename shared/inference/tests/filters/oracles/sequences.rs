//! Exact filtering of a hybrid linear system: one Kalman filter for each sequence of modes.
//!
//! K modes and t steps make K^t sequences. While all of them fit, the belief is exact: an oracle
//! for short runs. When there are more than fit, the least likely are dropped, and the step says
//! what share of the belief went with them.

use vigil_inference::filter::{Event, Filter, Step};
use vigil_inference::gaussian::Gaussian;
use vigil_inference::hybrid::Conditional;
use vigil_inference::logspace::{log_add, log_sum_exp};

/// One sequence of modes: where it has led.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sequence<const N: usize> {
    mode: usize,
    log_weight: f64,
    state: Gaussian<N>,
}

/// The exact filter over mode sequences, at most a given number of them.
#[derive(Debug, Clone)]
pub struct Sequences<M, const N: usize> {
    model: M,
    capacity: usize,
    sequences: Vec<Sequence<N>>,
    grown: Vec<Sequence<N>>,
    log_p: Vec<f64>,
    posterior: Vec<f64>,
    log_dropped: f64,
}

impl<M: Conditional<N>, const N: usize> Sequences<M, N> {
    /// A filter that keeps at most `capacity` sequences, at least one per mode. Allocates room for
    /// that many times the number of modes.
    pub fn new(model: M, capacity: usize) -> Self {
        let modes = model.modes();
        let capacity = capacity.max(modes);
        let mut filter = Self {
            capacity,
            sequences: Vec::with_capacity(capacity * modes),
            grown: Vec::with_capacity(capacity * modes),
            log_p: vec![0.0; modes],
            posterior: vec![0.0; modes],
            log_dropped: f64::NEG_INFINITY,
            model,
        };
        filter.reset();
        filter
    }

    /// Logarithm of the share of the belief that was dropped since the start, as if every dropped
    /// sequence had explained the later observations as well as the kept ones; minus infinity
    /// while the filter is exact.
    #[must_use]
    pub const fn log_dropped(&self) -> f64 {
        self.log_dropped
    }

    /// Mean and variances of the continuous state over all sequences.
    #[must_use]
    pub fn state(&self) -> (nalgebra::SVector<f64, N>, nalgebra::SVector<f64, N>) {
        let mut mean = nalgebra::SVector::<f64, N>::zeros();
        for sequence in &self.sequences {
            mean += sequence.state.mean * sequence.log_weight.exp();
        }
        let mut variance = nalgebra::SVector::<f64, N>::zeros();
        for sequence in &self.sequences {
            let apart = sequence.state.mean - mean;
            let spread = sequence.state.covariance.diagonal() + apart.component_mul(&apart);
            variance += spread * sequence.log_weight.exp();
        }
        (mean, variance)
    }

    fn predict(&mut self) {
        self.grown.clear();
        for sequence in &self.sequences {
            for to in 0..self.model.modes() {
                let p = self.model.transition(sequence.mode, to);
                if p > 0.0 {
                    let mut next = *sequence;
                    (next.mode, next.log_weight) = (to, sequence.log_weight + p.ln());
                    if to != sequence.mode {
                        self.model.enter(sequence.mode, to, &mut next.state);
                    }
                    self.model.predict(to, &mut next.state);
                    self.grown.push(next);
                }
            }
        }
        std::mem::swap(&mut self.sequences, &mut self.grown);
    }

    /// Keeps the most likely sequences; their weights then sum to 1 again.
    fn prune(&mut self) {
        if self.sequences.len() <= self.capacity {
            return;
        }
        let least_first = |a: &Sequence<N>, b: &Sequence<N>| b.log_weight.total_cmp(&a.log_weight);
        self.sequences
            .select_nth_unstable_by(self.capacity - 1, least_first);
        let weights = self.sequences.iter().map(|sequence| sequence.log_weight);
        let dropped = weights
            .clone()
            .skip(self.capacity)
            .fold(f64::NEG_INFINITY, log_add);
        let kept = weights.take(self.capacity).fold(f64::NEG_INFINITY, log_add);
        self.log_dropped = log_add(self.log_dropped, dropped);
        self.sequences.truncate(self.capacity);
        for sequence in &mut self.sequences {
            sequence.log_weight -= kept;
        }
    }

    fn sum_modes(&mut self) {
        self.log_p.fill(f64::NEG_INFINITY);
        for sequence in &self.sequences {
            let log_p = &mut self.log_p[sequence.mode];
            *log_p = log_add(*log_p, sequence.log_weight);
        }
        let log_sum = log_sum_exp(&self.log_p);
        for (p, log_p) in self.posterior.iter_mut().zip(&self.log_p) {
            *p = (log_p - log_sum).exp();
        }
    }
}

impl<M: Conditional<N>, const N: usize> Filter for Sequences<M, N> {
    type Observation = M::Observation;

    fn step(&mut self, z: &M::Observation) -> Step {
        self.predict();
        // The other buffer keeps the predictions, should nothing explain the observation.
        self.grown.clear();
        self.grown.extend_from_slice(&self.sequences);
        let model = &self.model;
        self.sequences.retain_mut(|sequence| {
            match model.update(sequence.mode, &mut sequence.state, z) {
                Some(log_likelihood) => sequence.log_weight += log_likelihood,
                None => return false,
            }
            sequence.log_weight > f64::NEG_INFINITY
        });
        let log_weights = self.sequences.iter().map(|sequence| sequence.log_weight);
        let evidence = log_weights.fold(f64::NEG_INFINITY, log_add);
        let event = if evidence.is_finite() {
            for sequence in &mut self.sequences {
                sequence.log_weight -= evidence;
            }
            None
        } else {
            std::mem::swap(&mut self.sequences, &mut self.grown);
            Some(Event::Coasted)
        };
        self.prune();
        self.sum_modes();
        let squares: f64 = self
            .sequences
            .iter()
            .map(|s| (2.0 * s.log_weight).exp())
            .sum();
        Step {
            log_evidence: if event.is_none() { evidence } else { 0.0 },
            effective_sample_size: 1.0 / squares,
            event,
        }
    }

    fn posterior(&self) -> &[f64] {
        &self.posterior
    }

    fn reset(&mut self) {
        self.sequences.clear();
        self.log_dropped = f64::NEG_INFINITY;
        for mode in 0..self.model.modes() {
            let p = self.model.initial(mode);
            if p > 0.0 {
                self.sequences.push(Sequence {
                    mode,
                    log_weight: p.ln(),
                    state: self.model.prior(mode),
                });
            }
        }
        self.sum_modes();
    }
}
