//! Three modes that move a pose and set two wheel rates: a jump Markov linear system.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde::Deserialize;
use vigil_inference::gaussian::Gaussian;
use vigil_inference::hybrid::{Conditional, Modes, Sampled};
use vigil_inference::logspace::log_normal;

use super::{CaseError, observe, read, vector};

const MODES: usize = 3;

/// `x_t = x_{t-1} + B[d_t] + N(0, diag Q)`, pose `= x_t + N(0, diag R)`, wheels
/// `~ N(mu[d_t], sigma_w² I)`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct JumpLinear {
    /// Transition probabilities, row by row.
    #[serde(rename = "P")]
    transition: [[f64; MODES]; MODES],
    /// Shift of the pose in each mode.
    #[serde(rename = "B")]
    shift: [[f64; 3]; MODES],
    /// Variances of the motion.
    #[serde(rename = "Q")]
    noise: [f64; 3],
    /// Variances of the measured pose.
    #[serde(rename = "R")]
    sensor_noise: [f64; 3],
    /// Mean wheel rates in each mode.
    mu: [[f64; 2]; MODES],
    /// Standard deviation of a measured wheel rate.
    sigma_w: f64,
    /// Mean before the first transition.
    #[serde(rename = "m0")]
    mean_before: [f64; 3],
    /// Variances before the first transition.
    #[serde(rename = "C0")]
    variance_before: [f64; 3],
    /// Measured poses, one row per step.
    obs: Vec<[f64; 3]>,
    /// Measured wheel rates, one row per step.
    wheel: Vec<[f64; 2]>,
    /// `p(d_t | z_1 .. z_t)`.
    pub filter: Vec<[f64; MODES]>,
    /// Mean of `p(x_t | z_1 .. z_t)`.
    pub mean: Vec<[f64; 3]>,
    /// Its variances.
    #[serde(rename = "var")]
    pub variance: Vec<[f64; 3]>,
    /// `ln p(z_1 .. z_t)`.
    #[serde(rename = "loglik")]
    pub log_evidence: Vec<f64>,
}

/// One step's observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseAndWheels {
    /// Measured x, y, yaw.
    pub pose: [f64; 3],
    /// Measured wheel rates.
    pub wheels: [f64; 2],
}

impl JumpLinear {
    /// Reads `case3_jmls3_full.json`.
    ///
    /// # Errors
    /// [`CaseError`].
    pub fn read(path: &Path) -> Result<Self, CaseError> {
        read(path)
    }

    /// One observation per step.
    pub fn observations(&self) -> impl Iterator<Item = PoseAndWheels> + '_ {
        let pairs = self.obs.iter().zip(&self.wheel);
        pairs.map(|(&pose, &wheels)| PoseAndWheels { pose, wheels })
    }

    fn log_wheels(&self, mode: usize, wheels: &[f64; 2]) -> f64 {
        let variance = self.sigma_w * self.sigma_w;
        let pairs = wheels.iter().zip(&self.mu[mode]);
        pairs.map(|(z, mean)| log_normal(z - mean, variance)).sum()
    }
}

fn diagonal(variances: &[f64; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal(&vector(variances))
}

fn noise(variances: &[f64; 3], rng: &mut Pcg64Mcg) -> Vector3<f64> {
    Vector3::from_fn(|i, _| variances[i].sqrt() * rng.sample::<f64, _>(StandardNormal))
}

impl Modes for JumpLinear {
    fn modes(&self) -> usize {
        MODES
    }

    fn transition(&self, from: usize, to: usize) -> f64 {
        self.transition[from][to]
    }
}

impl Sampled for JumpLinear {
    type State = Vector3<f64>;
    type Observation = PoseAndWheels;

    fn draw(&self, _mode: usize, rng: &mut Pcg64Mcg) -> Vector3<f64> {
        vector(&self.mean_before) + noise(&self.variance_before, rng)
    }

    fn propagate(&self, mode: usize, state: &Vector3<f64>, rng: &mut Pcg64Mcg) -> Vector3<f64> {
        state + vector(&self.shift[mode]) + noise(&self.noise, rng)
    }

    fn log_motion(&self, mode: usize, before: &Vector3<f64>, after: &Vector3<f64>) -> f64 {
        let apart = after - before - vector(&self.shift[mode]);
        (0..3).map(|i| log_normal(apart[i], self.noise[i])).sum()
    }

    fn log_likelihood(&self, mode: usize, state: &Vector3<f64>, z: &PoseAndWheels) -> f64 {
        let pose: f64 = (0..3)
            .map(|i| log_normal(z.pose[i] - state[i], self.sensor_noise[i]))
            .sum();
        pose + self.log_wheels(mode, &z.wheels)
    }
}

impl Conditional<3> for JumpLinear {
    type Observation = PoseAndWheels;

    fn prior(&self, _mode: usize) -> Gaussian<3> {
        Gaussian {
            mean: vector(&self.mean_before),
            covariance: diagonal(&self.variance_before),
        }
    }

    fn predict(&self, mode: usize, state: &mut Gaussian<3>) {
        state.predict(
            &Matrix3::identity(),
            &vector(&self.shift[mode]),
            &diagonal(&self.noise),
        );
    }

    fn update(&self, mode: usize, state: &mut Gaussian<3>, z: &PoseAndWheels) -> Option<f64> {
        let wheels = self.log_wheels(mode, &z.wheels);
        if !wheels.is_finite() {
            return None;
        }
        observe(state, &z.pose, &diagonal(&self.sensor_noise)).map(|pose| pose + wheels)
    }
}
