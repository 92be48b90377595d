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

/// A planar robot as a model for every filter. Channels that are not a number are not measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Planar {
    /// Its tables.
    parameters: Parameters,
}

/// One step, with the mode drawn from its row of `transition` and n standard normal:
///
/// ```text
/// x   += cos(yaw) dx - sin(yaw) dy + motion_sd[0] n1
/// y   += sin(yaw) dx + cos(yaw) dy + motion_sd[1] n2
/// yaw += dyaw + motion_sd[2] n3                (the rotation above is by the yaw before)
/// ```
#[derive(Debug, Clone, PartialEq)]
struct Parameters {
    /// Probability of each mode before the first step.
    initial: Vec<f64>,
    /// Row by row the probabilities of the next mode.
    transition: Vec<Vec<f64>>,
    /// For each mode the increment in the body's frame: dx m, dy m, dyaw rad.
    motion: Vec<[f64; 3]>,
    /// Standard deviation of its noise: x m, y m, yaw rad.
    motion_sd: [f64; 3],
    /// Standard deviation of the measured pose: x m, y m, yaw rad.
    pose_sd: [f64; 3],
    /// For each mode the means of the measured wheel rates, rad/s.
    wheel_rates: Vec<Vec<f64>>,
    /// Standard deviation of a measured wheel rate, rad/s.
    wheel_rate_sd: f64,
    /// Mean pose before the first step: x m, y m, yaw rad.
    start: [f64; 3],
    /// Its standard deviation.
    start_sd: [f64; 3],
}

/// What is measured in one step; NaN where nothing is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// x m, y m, yaw rad.
    pub pose: [f64; 3],
    /// rad/s.
    pub wheel_rates: [f64; 6],
}

impl Observation {
    const MISSING: Self = Self {
        pose: [f64::NAN; 3],
        wheel_rates: [f64::NAN; 6],
    };
}

/// The model as its file has it.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
struct File {
    /// Increment of x in the body's frame, m, by mode.
    dx: Vec<f64>,
    /// The same of y.
    dy: Vec<f64>,
    /// The same of yaw, rad.
    dth: Vec<f64>,
    /// Mean wheel rates by mode.
    mu: Vec<Vec<f64>>,
    /// Transition probabilities, row by row.
    p: Vec<Vec<f64>>,
    /// Standard deviation of the motion's noise: x, m.
    sx: f64,
    /// The same of y.
    sy: f64,
    /// The same of yaw, rad.
    sth: f64,
    /// Standard deviation of the measured x, m.
    rx: f64,
    /// The same of y.
    ry: f64,
    /// The same of yaw, rad.
    rth: f64,
    /// The same of a wheel rate.
    rw: f64,
    /// Mean pose before the first step.
    x0: [f64; 3],
    /// Its standard deviation.
    s0: [f64; 3],
    /// Mode before the first step.
    #[serde(rename = "init_mode")]
    initial_mode: usize,
}

/// One recorded step: measured pose and wheel rates.
#[derive(Debug, Deserialize)]
struct Row {
    /// x, m.
    zx: f64,
    /// y, m.
    zy: f64,
    /// Yaw, rad.
    ztheta: f64,
    /// Rate of the first wheel.
    e0: f64,
    /// Of the second.
    e1: f64,
    /// Of the third.
    e2: f64,
    /// Of the fourth.
    e3: f64,
    /// Of the fifth.
    e4: f64,
    /// Of the sixth.
    e5: f64,
}

impl Planar {
    /// Reads `rover13_model.json` and the 200 steps of `rover13_obs.csv` in `folder`.
    ///
    /// # Errors
    /// [`CaseError`].
    pub fn read(folder: &Path) -> Result<(Self, Vec<Observation>), CaseError> {
        let file: File = read(&folder.join("rover13_model.json"))?;
        let path = folder.join("rover13_obs.csv");
        let wrong = |error| CaseError::Table(path.display().to_string(), error);
        let mut table = csv::Reader::from_path(&path).map_err(wrong)?;
        let observation = |row: Row| {
            let mut z = Observation::MISSING;
            z.pose = [row.zx, row.zy, row.ztheta];
            let rates = [row.e0, row.e1, row.e2, row.e3, row.e4, row.e5];
            z.wheel_rates[..rates.len()].copy_from_slice(&rates);
            z
        };
        let rows = table.deserialize().map(|row| row.map(observation));
        let observations = rows.collect::<Result<_, _>>().map_err(wrong)?;
        let modes = file.dx.len();
        let motion = (0..modes).map(|k| [file.dx[k], file.dy[k], file.dth[k]]);
        let initial = (0..modes).map(|k| f64::from(u8::from(k == file.initial_mode)));
        let parameters = Parameters {
            initial: initial.collect(),
            transition: file.p,
            motion: motion.collect(),
            motion_sd: [file.sx, file.sy, file.sth],
            pose_sd: [file.rx, file.ry, file.rth],
            wheel_rates: file.mu,
            wheel_rate_sd: file.rw,
            start: file.x0,
            start_sd: file.s0,
        };
        Ok((Self { parameters }, observations))
    }

    /// The same model with other probabilities: a fault appears with `p_fault` in all, in equal
    /// parts, and vanishes with `p_recovery`.
    #[must_use]
    pub fn with_rates(mut self, p_fault: f64, p_recovery: f64) -> Self {
        let modes = self.modes();
        for (from, row) in self.parameters.transition.iter_mut().enumerate() {
            for (to, p) in row.iter_mut().enumerate() {
                *p = match (from, to) {
                    (0, 0) => 1.0 - p_fault,
                    (0, _) => p_fault / (modes - 1) as f64,
                    (_, 0) => p_recovery,
                    _ if from == to => 1.0 - p_recovery,
                    _ => 0.0,
                };
            }
        }
        self
    }

    /// What is measured in a given state; without wheel rates if not `with_wheels`.
    pub fn measure(
        &self,
        mode: usize,
        pose: &Vector3<f64>,
        with_wheels: bool,
        rng: &mut Pcg64Mcg,
    ) -> Observation {
        let parameters = &self.parameters;
        let mut noise = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
        let mut z = Observation::MISSING;
        z.pose = std::array::from_fn(|i| pose[i] + noise(parameters.pose_sd[i]));
        for (rate, mean) in z.wheel_rates.iter_mut().zip(&parameters.wheel_rates[mode]) {
            let measured = mean + noise(parameters.wheel_rate_sd);
            *rate = if with_wheels { measured } else { f64::NAN };
        }
        z
    }

    fn moved(&self, mode: usize, pose: &Vector3<f64>) -> Vector3<f64> {
        let (sin, cos) = pose[2].sin_cos();
        let [forward, lateral, turn] = self.parameters.motion[mode];
        let (dx, dy) = (cos * forward - sin * lateral, sin * forward + cos * lateral);
        pose + Vector3::new(dx, dy, turn)
    }

    fn log_wheels(&self, mode: usize, z: &Observation) -> f64 {
        let variance = self.parameters.wheel_rate_sd.powi(2);
        let pairs = z.wheel_rates.iter().zip(&self.parameters.wheel_rates[mode]);
        let measured = pairs.filter(|(rate, _)| !rate.is_nan());
        measured
            .map(|(rate, mean)| log_normal(rate - mean, variance))
            .sum()
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
        self.parameters.initial.len()
    }

    fn initial(&self, mode: usize) -> f64 {
        self.parameters.initial[mode]
    }

    fn transition(&self, from: usize, to: usize) -> f64 {
        self.parameters.transition[from][to]
    }
}

impl Sampled for Planar {
    type State = Vector3<f64>;
    type Observation = Observation;

    fn draw(&self, _mode: usize, rng: &mut Pcg64Mcg) -> Vector3<f64> {
        let (start, sd) = (self.parameters.start, self.parameters.start_sd);
        Vector3::from_fn(|i, _| start[i] + sd[i] * rng.sample::<f64, _>(StandardNormal))
    }

    fn propagate(&self, mode: usize, state: &Vector3<f64>, rng: &mut Pcg64Mcg) -> Vector3<f64> {
        let sd = self.parameters.motion_sd;
        let noise = Vector3::from_fn(|i, _| sd[i] * rng.sample::<f64, _>(StandardNormal));
        self.moved(mode, state) + noise
    }

    fn log_motion(&self, mode: usize, before: &Vector3<f64>, after: &Vector3<f64>) -> f64 {
        let (residual, sd) = (
            apart(after, &self.moved(mode, before)),
            self.parameters.motion_sd,
        );
        (0..3).map(|i| log_normal(residual[i], sd[i] * sd[i])).sum()
    }

    fn log_likelihood(&self, mode: usize, state: &Vector3<f64>, z: &Observation) -> f64 {
        let (residual, sd) = (
            apart(&Vector3::from(z.pose), state),
            self.parameters.pose_sd,
        );
        let measured = (0..3).filter(|&i| !residual[i].is_nan());
        let pose: f64 = measured
            .map(|i| log_normal(residual[i], sd[i] * sd[i]))
            .sum();
        pose + self.log_wheels(mode, z)
    }
}

impl Conditional<3> for Planar {
    type Observation = Observation;

    fn prior(&self, _mode: usize) -> Gaussian<3> {
        Gaussian {
            mean: Vector3::from(self.parameters.start),
            covariance: squares(self.parameters.start_sd),
        }
    }

    fn predict(&self, mode: usize, state: &mut Gaussian<3>) {
        let moved = self.moved(mode, &state.mean);
        let (dx, dy) = (moved[0] - state.mean[0], moved[1] - state.mean[1]);
        let jacobian = Matrix3::new(1.0, 0.0, -dy, 0.0, 1.0, dx, 0.0, 0.0, 1.0);
        let shift = moved - jacobian * state.mean;
        state.predict(&jacobian, &shift, &squares(self.parameters.motion_sd));
    }

    fn update(&self, mode: usize, state: &mut Gaussian<3>, z: &Observation) -> Option<f64> {
        let wheels = self.log_wheels(mode, z);
        if !wheels.is_finite() {
            return None;
        }
        let innovation = apart(&Vector3::from(z.pose), &state.mean);
        if innovation.iter().all(|residual| residual.is_nan()) {
            return Some(wheels);
        }
        let noise = squares(self.parameters.pose_sd);
        let pose = state.update(&innovation, &SMatrix::<f64, 3, 3>::identity(), &noise)?;
        Some(pose + wheels)
    }
}
