//! The workload `rover13`: 13 modes, a planar pose, six wheel rates, 200 recorded steps.

use std::error::Error;
use std::fs;
use std::path::Path;

use serde::Deserialize;
use vigil_inference::lanes::{Observation, PlanarParameters};

/// The model as its file has it.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub struct Rover13 {
    /// Increment of x in the body's frame, m, by mode.
    pub dx: Vec<f64>,
    /// The same of y.
    pub dy: Vec<f64>,
    /// The same of yaw, rad.
    pub dth: Vec<f64>,
    /// Mean wheel rates by mode.
    pub mu: Vec<Vec<f64>>,
    /// Transition probabilities, row by row.
    pub p: Vec<Vec<f64>>,
    /// Standard deviation of the motion's noise: x, m.
    pub sx: f64,
    /// The same of y.
    pub sy: f64,
    /// The same of yaw, rad.
    pub sth: f64,
    /// Standard deviation of the measured x, m.
    pub rx: f64,
    /// The same of y.
    pub ry: f64,
    /// The same of yaw, rad.
    pub rth: f64,
    /// The same of a wheel rate.
    pub rw: f64,
    /// Mean pose before the first step.
    pub x0: [f64; 3],
    /// Its standard deviation.
    pub s0: [f64; 3],
    /// Mode before the first step.
    #[serde(rename = "init_mode")]
    pub initial_mode: usize,
}

impl Rover13 {
    /// Reads `rover13_model.json` and `rover13_obs.csv` in `folder`.
    ///
    /// # Errors
    /// A file that cannot be read, or not be understood.
    pub fn read(folder: &Path) -> Result<(Self, Vec<Observation>), Box<dyn Error>> {
        let model = fs::read_to_string(folder.join("rover13_model.json"))?;
        let text = fs::read_to_string(folder.join("rover13_obs.csv"))?;
        let mut lines = text.lines();
        let columns: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let at = |name: &str| {
            let found = columns.iter().position(|column| *column == name);
            found.ok_or_else(|| format!("rover13_obs.csv: no column {name}"))
        };
        let pose = [at("zx")?, at("zy")?, at("ztheta")?];
        let first_wheel = at("e0")?;
        let mut observations = Vec::new();
        for line in lines {
            let row: Vec<f64> = line.split(',').map(str::parse).collect::<Result<_, _>>()?;
            let mut z = Observation::MISSING;
            z.pose = pose.map(|column| row[column]);
            z.wheel_rates[..6].copy_from_slice(&row[first_wheel..first_wheel + 6]);
            observations.push(z);
        }
        Ok((serde_json::from_str(&model)?, observations))
    }

    /// The model for the lane filter.
    #[must_use]
    pub fn parameters(&self) -> PlanarParameters {
        let modes = self.dx.len();
        let mut initial = vec![0.0; modes];
        initial[self.initial_mode] = 1.0;
        let motion = (0..modes).map(|k| [self.dx[k], self.dy[k], self.dth[k]]);
        PlanarParameters {
            initial,
            transition: self.p.clone(),
            motion: motion.collect(),
            motion_sd: [self.sx, self.sy, self.sth],
            pose_sd: [self.rx, self.ry, self.rth],
            wheel_rates: self.mu.clone(),
            wheel_rate_sd: self.rw,
            start: self.x0,
            start_sd: self.s0,
        }
    }
}
