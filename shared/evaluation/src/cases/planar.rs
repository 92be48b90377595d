//! Thirteen modes of a six-wheel rover in the plane: one table of motion per mode, wheel rates
//! given by the mode. Its pose is turned by the heading, so only sampling is exact.

use std::path::Path;

use nalgebra::{Matrix3, SMatrix, Vector3};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde::Deserialize;
use vigil_inference::angle::wrap;
use vigil_inference::gaussian::Gaussian;
use vigil_inference::hybrid::{Conditional, Modes, Sampled};
use vigil_inference::logspace::log_normal;

use super::{CaseError, read};

const MODES: usize = 13;
const WHEELS: usize = 6;

/// The model: x, y, yaw move by `DX`, `DY`, `DTH` of the mode, turned by the heading before.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Planar {
    /// Forward displacement per step in each mode, m.
    #[serde(rename = "DX")]
    forward_m: [f64; MODES],
    /// Lateral displacement per step in each mode, m.
    #[serde(rename = "DY")]
    lateral_m: [f64; MODES],
    /// Turn per step in each mode, rad.
    #[serde(rename = "DTH")]
    turn_rad: [f64; MODES],
    /// Mean wheel rates in each mode.
    #[serde(rename = "MU")]
    wheel_rates: [[f64; WHEELS]; MODES],
    /// Transition probabilities, row by row.
    #[serde(rename = "P")]
    transition: [[f64; MODES]; MODES],
    /// Standard deviation of the motion in x, m.
    #[serde(rename = "SX")]
    motion_x_m: f64,
    /// The same in y, m.
    #[serde(rename = "SY")]
    motion_y_m: f64,
    /// The same in yaw, rad.
    #[serde(rename = "STH")]
    motion_yaw_rad: f64,
    /// Standard deviation of the measured x, m.
    #[serde(rename = "RX")]
    sensor_x_m: f64,
    /// The same of y, m.
    #[serde(rename = "RY")]
    sensor_y_m: f64,
    /// The same of yaw, rad.
    #[serde(rename = "RTH")]
    sensor_yaw_rad: f64,
    /// Standard deviation of a measured wheel rate.
    #[serde(rename = "RW")]
    sensor_wheel: f64,
    /// Pose before the first step.
    #[serde(rename = "X0")]
    pose_before: [f64; 3],
    /// Its standard deviations.
    #[serde(rename = "S0")]
    pose_before_sd: [f64; 3],
}

/// One step's observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarObservation {
    /// Measured x m, y m, yaw rad.
    pub pose: [f64; 3],
    /// Measured wheel rates; `None` when only the pose is used.
    pub wheels: Option<[f64; WHEELS]>,
}

impl Planar {
    /// Reads `rover13_model.json`.
    ///
    /// # Errors
    /// [`CaseError`].
    pub fn read(path: &Path) -> Result<Self, CaseError> {
        read(path)
    }

    /// The same model with other probabilities: a fault appears with `p_fault` in all, in equal
    /// parts, and vanishes with `p_recovery`.
    #[must_use]
    pub fn with_rates(mut self, p_fault: f64, p_recovery: f64) -> Self {
        self.transition = [[0.0; MODES]; MODES];
        self.transition[0] = [p_fault / (MODES - 1) as f64; MODES];
        self.transition[0][0] = 1.0 - p_fault;
        for (mode, row) in self.transition.iter_mut().enumerate().skip(1) {
            (row[0], row[mode]) = (p_recovery, 1.0 - p_recovery);
        }
        self
    }

    /// What is measured in a given state.
    pub fn measure(
        &self,
        mode: usize,
        pose: &Vector3<f64>,
        with_wheels: bool,
        rng: &mut Pcg64Mcg,
    ) -> PlanarObservation {
        let sd = self.sensor_sd();
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let pose = std::array::from_fn(|i| pose[i] + sd[i] * normal());
        let wheels = self.wheel_rates[mode].map(|mean| mean + self.sensor_wheel * normal());
        PlanarObservation {
            pose,
            wheels: with_wheels.then_some(wheels),
        }
    }

    const fn sensor_sd(&self) -> [f64; 3] {
        [self.sensor_x_m, self.sensor_y_m, self.sensor_yaw_rad]
    }

    const fn motion_sd(&self) -> [f64; 3] {
        [self.motion_x_m, self.motion_y_m, self.motion_yaw_rad]
    }

    fn moved(&self, mode: usize, pose: &Vector3<f64>) -> Vector3<f64> {
        let (sin, cos) = pose[2].sin_cos();
        let (forward, lateral) = (self.forward_m[mode], self.lateral_m[mode]);
        let (dx, dy) = (cos * forward - sin * lateral, sin * forward + cos * lateral);
        pose + Vector3::new(dx, dy, self.turn_rad[mode])
    }

    fn log_wheels(&self, mode: usize, wheels: Option<&[f64; WHEELS]>) -> f64 {
        let variance = self.sensor_wheel * self.sensor_wheel;
        let pairs = wheels.into_iter().flatten().zip(&self.wheel_rates[mode]);
        pairs.map(|(z, mean)| log_normal(z - mean, variance)).sum()
    }
}

fn apart(a: &Vector3<f64>, b: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(a[0] - b[0], a[1] - b[1], wrap(a[2] - b[2]))
}

fn squares(sd: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::from(sd.map(|sd| sd * sd)))
}

impl Modes for Planar {
    fn modes(&self) -> usize {
        MODES
    }

    fn transition(&self, from: usize, to: usize) -> f64 {
        self.transition[from][to]
    }
}

impl Sampled for Planar {
    type State = Vector3<f64>;
    type Observation = PlanarObservation;

    fn draw(&self, _mode: usize, rng: &mut Pcg64Mcg) -> Vector3<f64> {
        Vector3::from_fn(|i, _| {
            self.pose_before[i] + self.pose_before_sd[i] * rng.sample::<f64, _>(StandardNormal)
        })
    }

    fn propagate(&self, mode: usize, state: &Vector3<f64>, rng: &mut Pcg64Mcg) -> Vector3<f64> {
        let sd = self.motion_sd();
        let noise = Vector3::from_fn(|i, _| sd[i] * rng.sample::<f64, _>(StandardNormal));
        self.moved(mode, state) + noise
    }

    fn log_motion(&self, mode: usize, before: &Vector3<f64>, after: &Vector3<f64>) -> f64 {
        let (residual, sd) = (apart(after, &self.moved(mode, before)), self.motion_sd());
        (0..3).map(|i| log_normal(residual[i], sd[i] * sd[i])).sum()
    }

    fn log_likelihood(&self, mode: usize, state: &Vector3<f64>, z: &PlanarObservation) -> f64 {
        let (residual, sd) = (apart(&Vector3::from(z.pose), state), self.sensor_sd());
        let pose: f64 = (0..3).map(|i| log_normal(residual[i], sd[i] * sd[i])).sum();
        pose + self.log_wheels(mode, z.wheels.as_ref())
    }
}

impl Conditional<3> for Planar {
    type Observation = PlanarObservation;

    fn prior(&self, _mode: usize) -> Gaussian<3> {
        Gaussian {
            mean: Vector3::from(self.pose_before),
            covariance: squares(self.pose_before_sd),
        }
    }

    fn predict(&self, mode: usize, state: &mut Gaussian<3>) {
        let moved = self.moved(mode, &state.mean);
        let (dx, dy) = (moved[0] - state.mean[0], moved[1] - state.mean[1]);
        let jacobian = Matrix3::new(1.0, 0.0, -dy, 0.0, 1.0, dx, 0.0, 0.0, 1.0);
        let shift = moved - jacobian * state.mean;
        state.predict(&jacobian, &shift, &squares(self.motion_sd()));
    }

    fn update(&self, mode: usize, state: &mut Gaussian<3>, z: &PlanarObservation) -> Option<f64> {
        let wheels = self.log_wheels(mode, z.wheels.as_ref());
        if !wheels.is_finite() {
            return None;
        }
        let innovation = apart(&Vector3::from(z.pose), &state.mean);
        let noise = squares(self.sensor_sd());
        let pose = state.update(&innovation, &SMatrix::<f64, 3, 3>::identity(), &noise)?;
        Some(pose + wheels)
    }
}
