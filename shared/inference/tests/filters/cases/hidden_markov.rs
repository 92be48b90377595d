//! Thirteen modes without a continuous state: six observations, their means given by the mode.

use std::path::Path;

use rand_pcg::Pcg64Mcg;
use serde::Deserialize;
use vigil_inference::gaussian::Gaussian;
use vigil_inference::hybrid::{Conditional, Modes, Sampled};
use vigil_inference::logspace::log_normal;

use super::{CaseError, read};

const MODES: usize = 13;
const SENSORS: usize = 6;

/// The hidden Markov model, its observations and exact beliefs.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct HiddenMarkov {
    /// Transition probabilities, row by row.
    #[serde(rename = "P")]
    transition: [[f64; MODES]; MODES],
    /// Means of the observations in each mode.
    #[serde(rename = "M")]
    means: [[f64; SENSORS]; MODES],
    /// Standard deviation of every observation.
    sigma: f64,
    /// One row per step.
    #[serde(rename = "obs")]
    pub observations: Vec<[f64; SENSORS]>,
    /// `p(d_t | z_1 .. z_t)`.
    pub filter: Vec<[f64; MODES]>,
    /// `ln p(z_1 .. z_t)`.
    #[serde(rename = "loglik")]
    pub log_evidence: Vec<f64>,
}

impl HiddenMarkov {
    /// Reads `case1_hmm13.json`.
    ///
    /// # Errors
    /// [`CaseError`].
    pub fn read(path: &Path) -> Result<Self, CaseError> {
        read(path)
    }

    /// The transition matrix, rows sum to 1.
    #[must_use]
    pub const fn transitions(&self) -> &[[f64; MODES]; MODES] {
        &self.transition
    }

    /// `ln p(z | mode)`.
    #[must_use]
    pub fn log_density(&self, mode: usize, z: &[f64; SENSORS]) -> f64 {
        let variance = self.sigma * self.sigma;
        let residuals = z.iter().zip(&self.means[mode]).map(|(z, mean)| z - mean);
        residuals
            .map(|residual| log_normal(residual, variance))
            .sum()
    }
}

impl Modes for HiddenMarkov {
    fn modes(&self) -> usize {
        MODES
    }

    fn transition(&self, from: usize, to: usize) -> f64 {
        self.transition[from][to]
    }
}

impl Sampled for HiddenMarkov {
    type State = ();
    type Observation = [f64; SENSORS];

    fn draw(&self, _mode: usize, _rng: &mut Pcg64Mcg) {}

    fn propagate(&self, _mode: usize, _state: &(), _rng: &mut Pcg64Mcg) {}

    fn log_likelihood(&self, mode: usize, _state: &(), z: &[f64; SENSORS]) -> f64 {
        self.log_density(mode, z)
    }
}

impl Conditional<0> for HiddenMarkov {
    type Observation = [f64; SENSORS];

    fn prior(&self, _mode: usize) -> Gaussian<0> {
        Gaussian {
            mean: nalgebra::SVector::zeros(),
            covariance: nalgebra::SMatrix::zeros(),
        }
    }

    fn predict(&self, _mode: usize, _state: &mut Gaussian<0>) {}

    fn update(&self, mode: usize, _state: &mut Gaussian<0>, z: &[f64; SENSORS]) -> Option<f64> {
        let log_density = self.log_density(mode, z);
        log_density.is_finite().then_some(log_density)
    }
}
