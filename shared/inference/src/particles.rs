//! Planar pose particles, structure of arrays, without a mode: the flag is integrated exactly.

use nalgebra::{Cholesky, Matrix3, Vector3};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use crate::angle::wrap;
use crate::resample::systematic;

/// Width of the smoothing kernel relative to the cloud's.
const KERNEL: f64 = 0.3;

/// Particles over (x m, y m, yaw rad) with log-weights. The buffers are allocated once.
#[derive(Debug, Clone)]
pub struct PoseParticles {
    /// x, m.
    pub x: Vec<f64>,
    /// y, m.
    pub y: Vec<f64>,
    /// Yaw, rad, not wrapped.
    pub yaw: Vec<f64>,
    /// Logarithms of the normalised weights.
    pub log_weight: Vec<f64>,
    weight: Vec<f64>,
    ancestors: Vec<u32>,
    scratch: Vec<f64>,
}

/// Moments of a weighted cloud; the order is x, y, yaw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// Mean.
    pub mean: Vector3<f64>,
    /// Covariance.
    pub covariance: Matrix3<f64>,
}

impl PoseParticles {
    /// `count` particles (at least 1) at the origin.
    #[must_use]
    pub fn new(count: usize) -> Self {
        let count = count.max(1);
        Self {
            x: vec![0.0; count],
            y: vec![0.0; count],
            yaw: vec![0.0; count],
            log_weight: vec![-(count as f64).ln(); count],
            weight: vec![1.0 / count as f64; count],
            ancestors: vec![0; count],
            scratch: vec![0.0; count],
        }
    }

    /// Number of particles.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.x.len()
    }

    /// Never: there is at least one particle.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Draws every particle anew around `pose`, with independent standard deviations `sd`.
    pub fn scatter(&mut self, pose: [f64; 3], sd: [f64; 3], rng: &mut Pcg64Mcg) {
        let count = self.len();
        for i in 0..count {
            self.x[i] = pose[0] + sd[0] * rng.sample::<f64, _>(StandardNormal);
            self.y[i] = pose[1] + sd[1] * rng.sample::<f64, _>(StandardNormal);
            self.yaw[i] = pose[2] + sd[2] * rng.sample::<f64, _>(StandardNormal);
        }
        self.log_weight.fill(-(count as f64).ln());
        self.weight.fill(1.0 / count as f64);
    }

    /// Moves every particle by the body-frame increment (`mean` of yaw, forward, lateral) plus
    /// white noise with standard deviations `sd`, rotated by the heading at half the turn.
    pub fn advance(&mut self, mean: [f64; 3], sd: [f64; 3], rng: &mut Pcg64Mcg) {
        for i in 0..self.len() {
            let turn = mean[0] + sd[0] * rng.sample::<f64, _>(StandardNormal);
            let forward = mean[1] + sd[1] * rng.sample::<f64, _>(StandardNormal);
            let lateral = mean[2] + sd[2] * rng.sample::<f64, _>(StandardNormal);
            let (sin, cos) = (self.yaw[i] + 0.5 * turn).sin_cos();
            self.x[i] += forward * cos - lateral * sin;
            self.y[i] += forward * sin + lateral * cos;
            self.yaw[i] += turn;
        }
    }

    /// Weighted mean and covariance. Yaw is averaged as deviation from the first particle's.
    #[must_use]
    pub fn moments(&self) -> Moments {
        let origin = Vector3::new(self.x[0], self.y[0], self.yaw[0]);
        let (mut mean, mut square) = (Vector3::zeros(), Matrix3::zeros());
        for i in 0..self.len() {
            let at = Vector3::new(self.x[i], self.y[i], self.yaw[i]) - origin;
            mean += at * self.weight[i];
            square += at * at.transpose() * self.weight[i];
        }
        Moments {
            mean: mean + origin,
            covariance: square - mean * mean.transpose(),
        }
    }

    /// Weighs by independent normal densities of `pose` with `variance` (x, y, yaw); returns the
    /// effective sample size before resampling. None, unchanged, when every particle is impossible.
    pub fn weigh(&mut self, pose: [f64; 3], variance: [f64; 3]) -> Option<f64> {
        let mut highest = f64::NEG_INFINITY;
        for i in 0..self.len() {
            let (dx, dy) = (pose[0] - self.x[i], pose[1] - self.y[i]);
            let turn = wrap(pose[2] - self.yaw[i]);
            let distance =
                dx * dx / variance[0] + dy * dy / variance[1] + turn * turn / variance[2];
            self.scratch[i] = self.log_weight[i] - 0.5 * distance;
            highest = highest.max(self.scratch[i]);
        }
        if !highest.is_finite() {
            return None;
        }
        let sum: f64 = self
            .scratch
            .iter()
            .map(|log_weight| (log_weight - highest).exp())
            .sum();
        let norm = highest + sum.ln();
        let mut squares = 0.0;
        for i in 0..self.len() {
            self.log_weight[i] = self.scratch[i] - norm;
            self.weight[i] = self.log_weight[i].exp();
            squares += self.weight[i] * self.weight[i];
        }
        Some(1.0 / squares)
    }

    /// Changes the number of particles to `count` (at least 1, at most the number at the start),
    /// resampling first. Allocates nothing.
    pub fn resize(&mut self, count: usize, rng: &mut Pcg64Mcg) {
        let count = count.clamp(1, self.x.capacity());
        let before = self.len();
        if count == before {
            return;
        }
        self.resample(rng);
        self.scratch.resize(count, 0.0);
        for values in [&mut self.x, &mut self.y, &mut self.yaw] {
            for (i, to) in self.scratch.iter_mut().enumerate() {
                *to = values[i * before / count];
            }
            values.resize(count, 0.0);
            values.copy_from_slice(&self.scratch);
        }
        self.log_weight.resize(count, 0.0);
        self.weight.resize(count, 0.0);
        self.ancestors.resize(count, 0);
        self.log_weight.fill(-(count as f64).ln());
        self.weight.fill(1.0 / count as f64);
    }

    /// Systematic resampling; afterwards all weights are equal. Copies of a particle are spread by
    /// a kernel that keeps the cloud's mean and covariance (shrinking towards the mean as much as
    /// the kernel widens): with little process noise, copies would never part again.
    pub fn resample(&mut self, rng: &mut Pcg64Mcg) {
        if !systematic(&self.weight, rng.random::<f64>(), &mut self.ancestors) {
            return;
        }
        for values in [&mut self.x, &mut self.y, &mut self.yaw] {
            for (to, &from) in self.scratch.iter_mut().zip(&self.ancestors) {
                *to = values[from as usize];
            }
            std::mem::swap(values, &mut self.scratch);
        }
        let count = self.len() as f64;
        self.log_weight.fill(-count.ln());
        self.weight.fill(1.0 / count);
        self.smooth(rng);
    }

    fn smooth(&mut self, rng: &mut Pcg64Mcg) {
        let Moments { mean, covariance } = self.moments();
        let Some(factor) = Cholesky::new(covariance) else {
            return;
        };
        let (spread, shrink) = (factor.l() * KERNEL, (1.0 - KERNEL * KERNEL).sqrt());
        for i in 0..self.len() {
            let apart = Vector3::new(self.x[i], self.y[i], self.yaw[i]) - mean;
            let normal = Vector3::from_fn(|_, _| rng.sample(StandardNormal));
            let at = mean + apart * shrink + spread * normal;
            (self.x[i], self.y[i], self.yaw[i]) = (at[0], at[1], at[2]);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn a_large_cloud_matches_the_conjugate_posterior() {
        // Prior N(0, .04), measurement .3 with variance .01: mean .24, variance .008.
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        let mut cloud = PoseParticles::new(40_000);
        cloud.scatter([0.0, 0.0, 3.0], [0.2, 0.2, 0.2], &mut rng);
        cloud
            .weigh([0.3, -0.3, 3.3 - std::f64::consts::TAU], [0.01; 3])
            .unwrap();
        for resampled in [false, true] {
            if resampled {
                cloud.resample(&mut rng);
            }
            let moments = cloud.moments();
            let expected = Vector3::new(0.24, -0.24, 3.24);
            assert!((moments.mean - expected).abs().max() < 3e-3, "{moments:?}");
            assert!(
                (moments.covariance.diagonal().add_scalar(-0.008))
                    .abs()
                    .max()
                    < 5e-4
            );
        }
    }

    #[test]
    fn the_effective_sample_size_is_the_count_when_nothing_is_learned() {
        let mut cloud = PoseParticles::new(64);
        let size = cloud.weigh([0.0; 3], [1.0; 3]).unwrap();
        assert!((size - 64.0).abs() < 1e-9);
        assert!(cloud.weigh([f64::NAN, 0.0, 0.0], [1.0; 3]).is_none());
    }

    #[test]
    fn resizing_keeps_the_cloud() {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let mut cloud = PoseParticles::new(4000);
        cloud.scatter([1.0, 2.0, 3.0], [0.1; 3], &mut rng);
        for count in [500, 1, 4000, 9000] {
            cloud.resize(count, &mut rng);
            assert_eq!(cloud.len(), count.min(4000));
            let sum: f64 = cloud.log_weight.iter().map(|w| w.exp()).sum();
            assert!((sum - 1.0).abs() < 1e-9);
            let off = (cloud.moments().mean - Vector3::new(1.0, 2.0, 3.0))
                .abs()
                .max();
            assert!(off < if count == 500 { 0.02 } else { 0.5 });
        }
    }

    #[test]
    fn a_quarter_circle_is_followed() {
        let mut cloud = PoseParticles::new(1);
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let turn = std::f64::consts::FRAC_PI_2 / 1000.0;
        for _ in 0..1000 {
            cloud.advance([turn, turn, 0.0], [0.0; 3], &mut rng);
        }
        assert!((cloud.x[0] - 1.0).abs() < 1e-6 && (cloud.y[0] - 1.0).abs() < 1e-6);
    }
}
