//! Planar pose particles of equal weight, drawn from a Gaussian.

use nalgebra::{Cholesky, Matrix3, Vector3};

use crate::normals::Normals;

/// Variance added to a covariance: particles are carried in single precision.
pub const PRECISION: f64 = 1e-10;

/// Particles over (x m, y m, yaw rad). The buffer is allocated once.
#[derive(Debug, Clone)]
pub struct PoseParticles {
    poses: Vec<Vector3<f64>>,
}

impl PoseParticles {
    /// `count` particles (at least 1) at the origin.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self {
            poses: vec![Vector3::zeros(); count.max(1)],
        }
    }

    /// The particles.
    #[must_use]
    pub fn poses(&self) -> &[Vector3<f64>] {
        &self.poses
    }

    /// Draws every particle anew from the normal distribution with these moments; all at the mean
    /// if the covariance is none.
    pub fn draw(&mut self, mean: Vector3<f64>, covariance: Matrix3<f64>, normals: &mut Normals) {
        let factor = factor(covariance);
        for pose in &mut self.poses {
            *pose = mean + factor * normals.take();
        }
    }

    /// Changes the number of particles to `count` (at least 1, at most the number at the start);
    /// new ones repeat the first. Allocates nothing.
    pub fn resize(&mut self, count: usize) {
        let (count, first) = (count.clamp(1, self.poses.capacity()), self.poses[0]);
        self.poses.resize(count, first);
    }
}

/// What standard normals are multiplied by to have this covariance; 0 if it is none.
#[must_use]
pub fn factor(covariance: Matrix3<f64>) -> Matrix3<f64> {
    let spread = covariance + Matrix3::identity() * PRECISION;
    Cholesky::new(spread).map_or(Matrix3::zeros(), |factor| factor.l())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn particles_have_the_moments_that_they_were_drawn_from() {
        let mean = Vector3::new(3.0, -1.0, 0.5);
        let covariance = Matrix3::new(0.04, 0.01, 0.0, 0.01, 0.09, -0.02, 0.0, -0.02, 0.01);
        let mut cloud = PoseParticles::new(40_000);
        cloud.draw(mean, covariance, &mut Normals::new(3, 100));
        let count = cloud.poses().len() as f64;
        let found = cloud.poses().iter().sum::<Vector3<f64>>() / count;
        let apart = cloud.poses().iter().map(|pose| pose - found);
        let square = apart.map(|a| a * a.transpose()).sum::<Matrix3<f64>>() / count;
        // Four standard errors: of a mean sd/200, of a variance 1.4 % of it.
        assert!((found - mean).abs().max() < 4.0 * 0.3 / 200.0);
        assert!((square - covariance).abs().max() < 0.06 * 0.09);
        cloud.draw(
            mean,
            Matrix3::identity() * f64::NAN,
            &mut Normals::new(3, 100),
        );
        assert!(cloud.poses().iter().all(|pose| *pose == mean));
    }

    #[test]
    fn the_number_is_bounded_by_that_at_the_start() {
        let mut cloud = PoseParticles::new(64);
        for (asked, got) in [(10, 10), (0, 1), (1000, 64)] {
            cloud.resize(asked);
            assert_eq!(cloud.poses().len(), got);
        }
    }
}
