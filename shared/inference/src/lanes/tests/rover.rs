//! A rover with 13 modes (nominal, six stuck wheels, six broken encoders), its simulation, and the
//! same model for the filter in double precision.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::super::{Observation, PlanarParameters};
use crate::angle::wrap;
use crate::hybrid::{Modes, Sampled};
use crate::logspace::log_normal;

pub const MODES: usize = 13;
pub const WHEELS: usize = 6;

/// Wheels in the order left front, middle, rear, right front, middle, rear.
pub fn parameters() -> PlanarParameters {
    let nominal = [0.92, 0.92, 0.92, 1.08, 1.08, 1.08];
    let (mut motion, mut wheel_rates) = (vec![[0.05, 0.0, 0.0083]], vec![nominal.to_vec()]);
    for fault in 0..2 * WHEELS {
        let (wheel, side) = (fault % WHEELS, if fault % WHEELS < 3 { 1.0 } else { -1.0 });
        let lateral = [0.003, 0.0, -0.003][wheel % 3] * side;
        let stuck = [
            0.043 + 0.0015 * (wheel % 3) as f64,
            lateral,
            0.0083 + 0.01 * side,
        ];
        motion.push(if fault < WHEELS { stuck } else { motion[0] });
        let mut rates = nominal.to_vec();
        rates[wheel] = 0.0;
        wheel_rates.push(rates);
    }
    let mut transition = vec![vec![0.0; MODES]; MODES];
    transition[0] = vec![0.005; MODES];
    transition[0][0] = 0.94;
    for (fault, row) in transition.iter_mut().enumerate().skip(1) {
        (row[0], row[fault]) = (0.01, 0.99);
    }
    let mut initial = vec![0.0; MODES];
    initial[0] = 1.0;
    PlanarParameters {
        initial,
        transition,
        motion,
        motion_sd: [0.005, 0.005, 0.004],
        pose_sd: [0.01; 3],
        wheel_rates,
        wheel_rate_sd: 0.3,
        start: [0.0; 3],
        start_sd: [0.01; 3],
    }
}

/// The model in double precision, for the filter that knows any model.
#[derive(Debug, Clone)]
pub struct Rover(pub PlanarParameters);

impl Modes for Rover {
    fn modes(&self) -> usize {
        self.0.initial.len()
    }
    fn initial(&self, mode: usize) -> f64 {
        self.0.initial[mode]
    }
    fn transition(&self, from: usize, to: usize) -> f64 {
        self.0.transition[from][to]
    }
}

impl Sampled for Rover {
    type State = [f64; 3];
    type Observation = Observation;

    fn draw(&self, _: usize, rng: &mut Pcg64Mcg) -> [f64; 3] {
        let sd = self.0.start_sd;
        std::array::from_fn(|i| self.0.start[i] + sd[i] * rng.sample::<f64, _>(StandardNormal))
    }

    fn propagate(&self, mode: usize, at: &[f64; 3], rng: &mut Pcg64Mcg) -> [f64; 3] {
        let ([dx, dy, turn], sd) = (self.0.motion[mode], self.0.motion_sd);
        let (sin, cos) = at[2].sin_cos();
        let mean = [
            at[0] + cos * dx - sin * dy,
            at[1] + sin * dx + cos * dy,
            at[2] + turn,
        ];
        std::array::from_fn(|i| mean[i] + sd[i] * rng.sample::<f64, _>(StandardNormal))
    }

    fn log_likelihood(&self, mode: usize, at: &[f64; 3], z: &Observation) -> f64 {
        let apart = [
            z.pose[0] - at[0],
            z.pose[1] - at[1],
            wrap(z.pose[2] - at[2]),
        ];
        let pose = apart.iter().zip(self.0.pose_sd);
        let pose: f64 = pose.map(|(d, sd)| log_normal(*d, sd * sd)).sum();
        let means = z.wheel_rates.iter().zip(&self.0.wheel_rates[mode]);
        let variance = self.0.wheel_rate_sd.powi(2);
        pose + means
            .map(|(z, mean)| log_normal(z - mean, variance))
            .sum::<f64>()
    }
}

impl Rover {
    /// Observations of one run: every mode for a while.
    pub fn drive(&self, steps: usize, seed: u64) -> Vec<Observation> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut at = self.draw(0, &mut rng);
        let mut mode = 0;
        let step = |_| {
            let mut u: f64 = rng.random();
            let next = self.0.transition[mode].iter().position(|p| {
                u -= p;
                u < 0.0
            });
            mode = next.unwrap_or(mode);
            at = self.propagate(mode, &at, &mut rng);
            let mut z = Observation::MISSING;
            for (axis, (z, sd)) in z.pose.iter_mut().zip(self.0.pose_sd).enumerate() {
                *z = at[axis] + sd * rng.sample::<f64, _>(StandardNormal);
            }
            for (z, mean) in z.wheel_rates.iter_mut().zip(&self.0.wheel_rates[mode]) {
                *z = mean + self.0.wheel_rate_sd * rng.sample::<f64, _>(StandardNormal);
            }
            z
        };
        (0..steps).map(step).collect()
    }
}
