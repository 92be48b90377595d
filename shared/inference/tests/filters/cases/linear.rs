//! One mode, a linear Gaussian state of three dimensions, observed directly.

use std::path::Path;

use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde::Deserialize;
use vigil_inference::gaussian::Gaussian;
use vigil_inference::hybrid::{Conditional, Modes, Sampled};
use vigil_inference::logspace::log_normal;

use super::{CaseError, matrix, observe, read, vector};

type Rows = [[f64; 3]; 3];

/// `x' = A x + b + N(0, Q)`, `z = x + N(0, R)`; Q and R are diagonal.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Linear {
    /// A.
    #[serde(rename = "A")]
    transition: Rows,
    /// b.
    #[serde(rename = "b")]
    shift: [f64; 3],
    /// Q.
    #[serde(rename = "Q")]
    noise: Rows,
    /// R.
    #[serde(rename = "R")]
    sensor_noise: Rows,
    /// Mean before the first transition.
    #[serde(rename = "m0")]
    mean_before: [f64; 3],
    /// Covariance before the first transition.
    #[serde(rename = "C0")]
    covariance_before: Rows,
    /// One row per step.
    #[serde(rename = "obs")]
    pub observations: Vec<[f64; 3]>,
    /// Mean of `p(x_t | z_1 .. z_t)`.
    pub mean: Vec<[f64; 3]>,
    /// Its covariance.
    #[serde(rename = "cov")]
    pub covariance: Vec<Rows>,
    /// `ln p(z_1 .. z_t)`.
    #[serde(rename = "loglik")]
    pub log_evidence: Vec<f64>,
}

impl Linear {
    /// Reads `case2_lgss3.json`.
    ///
    /// # Errors
    /// [`CaseError`].
    pub fn read(path: &Path) -> Result<Self, CaseError> {
        read(path)
    }
}

/// Independent noise with the variances on the diagonal of `rows`.
fn noise(rows: &Rows, rng: &mut Pcg64Mcg) -> Vector3<f64> {
    Vector3::from_fn(|i, _| rows[i][i].sqrt() * rng.sample::<f64, _>(StandardNormal))
}

impl Modes for Linear {
    fn modes(&self) -> usize {
        1
    }

    fn transition(&self, _from: usize, _to: usize) -> f64 {
        1.0
    }
}

impl Sampled for Linear {
    type State = Vector3<f64>;
    type Observation = [f64; 3];

    fn draw(&self, _mode: usize, rng: &mut Pcg64Mcg) -> Vector3<f64> {
        vector(&self.mean_before) + noise(&self.covariance_before, rng)
    }

    fn propagate(&self, _mode: usize, state: &Vector3<f64>, rng: &mut Pcg64Mcg) -> Vector3<f64> {
        matrix(&self.transition) * state + vector(&self.shift) + noise(&self.noise, rng)
    }

    fn log_likelihood(&self, _mode: usize, state: &Vector3<f64>, z: &[f64; 3]) -> f64 {
        (0..3)
            .map(|i| log_normal(z[i] - state[i], self.sensor_noise[i][i]))
            .sum()
    }
}

impl Conditional<3> for Linear {
    type Observation = [f64; 3];

    fn prior(&self, _mode: usize) -> Gaussian<3> {
        Gaussian {
            mean: vector(&self.mean_before),
            covariance: matrix(&self.covariance_before),
        }
    }

    fn predict(&self, _mode: usize, state: &mut Gaussian<3>) {
        state.predict(
            &matrix(&self.transition),
            &vector(&self.shift),
            &matrix(&self.noise),
        );
    }

    fn update(&self, _mode: usize, state: &mut Gaussian<3>, z: &[f64; 3]) -> Option<f64> {
        observe(state, z, &matrix(&self.sensor_noise))
    }
}
