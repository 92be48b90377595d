//! One Kalman filter per mode: the interacting multiple model filter.
//!
//! The number of exact mode sequences grows without bound. Here the Gaussians that lead into one
//! mode are merged into one of the same mean and covariance before each prediction (Blom and
//! Bar-Shalom, *The Interacting Multiple Model Algorithm*, 1988): `μ_ij = b_i P_ij / Σ_i`, mean
//! `m_j = Σ_i μ_ij m_i`, covariance `Σ_i μ_ij (V_i + (m_i - m_j)(m_i - m_j)ᵀ)`.

use vigil_checkpoint::Checkpoint;

use crate::filter::{Event, Filter, Step, is_distribution, normalise_into};
use crate::gaussian::Gaussian;
use crate::hybrid::{self, Conditional, ModelError};
use crate::logspace::log_sum_exp;

/// The interacting multiple model filter of N continuous dimensions.
#[derive(Debug, Clone, Checkpoint)]
#[checkpoint(bound = "M: Checkpoint")]
pub struct Merged<M, const N: usize> {
    model: M,
    states: Vec<Gaussian<N>>,
    mixed: Vec<Gaussian<N>>,
    log_p: Vec<f64>,
    posterior: Vec<f64>,
    predicted: Vec<f64>,
}

impl<M: Conditional<N>, const N: usize> Merged<M, N> {
    /// A filter at the model's prior.
    ///
    /// # Errors
    /// [`ModelError`].
    pub fn new(model: M) -> Result<Self, ModelError> {
        hybrid::check(&model)?;
        let modes = model.modes();
        let states: Vec<_> = (0..modes).map(|mode| model.prior(mode)).collect();
        let mut filter = Self {
            mixed: states.clone(),
            states,
            log_p: vec![0.0; modes],
            posterior: vec![0.0; modes],
            predicted: vec![0.0; modes],
            model,
        };
        filter.reset();
        Ok(filter)
    }

    /// The model, to give it the command of the next step.
    pub const fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }

    /// The continuous state given each mode.
    #[must_use]
    pub fn states(&self) -> &[Gaussian<N>] {
        &self.states
    }

    fn predict(&mut self) {
        for to in 0..self.states.len() {
            let share =
                |from: usize| self.posterior[from] * hybrid::transition(&self.model, from, to);
            let total: f64 = (0..self.states.len()).map(share).sum();
            self.predicted[to] = total;
            if total > 0.0 {
                let sources = (0..self.states.len()).filter(|&from| share(from) > 0.0);
                let parts = sources.map(|from| {
                    let mut state = self.states[from];
                    if from != to {
                        self.model.enter(from, to, &mut state);
                    }
                    (share(from) / total, state)
                });
                self.mixed[to] = merge(parts);
            } else {
                // No mode leads here: the state goes on for a later step in which one does.
                self.mixed[to] = self.states[to];
            }
            self.model.predict(to, &mut self.mixed[to]);
        }
        std::mem::swap(&mut self.states, &mut self.mixed);
    }
}

/// The Gaussian with the mean and covariance of a mixture; weights sum to 1.
fn merge<const N: usize>(parts: impl Iterator<Item = (f64, Gaussian<N>)> + Clone) -> Gaussian<N> {
    let mut merged = Gaussian {
        mean: nalgebra::SVector::zeros(),
        covariance: nalgebra::SMatrix::zeros(),
    };
    for (weight, part) in parts.clone() {
        merged.mean += part.mean * weight;
    }
    for (weight, part) in parts {
        let difference = part.mean - merged.mean;
        merged.covariance += (part.covariance + difference * difference.transpose()) * weight;
    }
    merged
}

impl<M: Conditional<N>, const N: usize> Filter for Merged<M, N> {
    type Observation = M::Observation;

    fn step(&mut self, z: &M::Observation) -> Step {
        self.predict();
        for mode in 0..self.states.len() {
            let log_likelihood = self.model.update(mode, &mut self.states[mode], z);
            let log_p = log_likelihood.unwrap_or(f64::NEG_INFINITY) + self.predicted[mode].ln();
            // What is no number counts as impossible.
            self.log_p[mode] = if log_p.is_nan() {
                f64::NEG_INFINITY
            } else {
                log_p
            };
        }
        let log_evidence = log_sum_exp(&self.log_p);
        let updated = normalise_into(&self.log_p, &mut self.posterior);
        // A chain that has changed since its check may predict no belief: then the last one stays.
        if !updated && is_distribution(&self.predicted) {
            self.posterior.copy_from_slice(&self.predicted);
        }
        Step {
            log_evidence: if updated { log_evidence } else { 0.0 },
            effective_sample_size: 1.0 / self.posterior.iter().map(|p| p * p).sum::<f64>(),
            event: (!updated).then_some(Event::Coasted),
        }
        .checked(&self.posterior, self.states.len())
    }

    fn posterior(&self) -> &[f64] {
        &self.posterior
    }

    fn reset(&mut self) {
        for (mode, (state, p)) in self.states.iter_mut().zip(&mut self.posterior).enumerate() {
            (*state, *p) = (self.model.prior(mode), self.model.initial(mode));
        }
        if !is_distribution(&self.posterior) {
            // A chain that has changed since its check: the nominal mode is the default.
            self.posterior.fill(0.0);
            self.posterior[0] = 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};

    #[test]
    fn a_merged_gaussian_has_the_moments_of_the_mixture() {
        let part = |mean, variance| Gaussian {
            mean: SVector::from([mean]),
            covariance: SMatrix::from([[variance]]),
        };
        let parts = [(0.25, part(1.0, 2.0)), (0.75, part(3.0, 4.0))];
        let merged = merge(parts.into_iter());
        // Mean .25 + 2.25; second moment .25 (2 + 1) + .75 (4 + 9) = 10.5.
        assert!((merged.mean[0] - 2.5).abs() < 1e-14);
        assert!((merged.covariance[0] - (10.5 - 6.25)).abs() < 1e-14);
    }
}
