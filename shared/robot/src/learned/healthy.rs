//! What is believed of a robot as long as it is healthy: what an identification starts from.

use nalgebra::{Matrix3, Vector3};
use vigil_blocks::HealthyBelief;
use vigil_checkpoint::CheckpointValue;
use vigil_inference::track::{Context, MotionNoise, Track};

use super::{Model, WheelContext};
use crate::description::Description;

/// Deviation of a pose of which nothing but a measurement is known, m and rad: twice its noise.
const UNSURE_M: f64 = 0.01;

/// Variances of a pose or a deviation that no healthy track has. Chosen: a kilometre of deviation.
const VARIANCE_MAX: f64 = 1e6;

/// Pose, and the context of motion and wheels.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Healthy {
    /// Mean pose: x m, y m, yaw rad.
    pub pose: Vector3<f64>,
    /// Its covariance.
    pub covariance: Matrix3<f64>,
    /// Of the motion.
    pub context: Context,
    /// Of the wheels' rates.
    pub wheels: WheelContext,
}

impl Healthy {
    /// Nothing but that the robot is healthy: a pose at the origin, known to a centimetre, on any
    /// ground that the description allows for.
    #[must_use]
    pub fn unsure(model: &Model, robot: &Description) -> Self {
        let noise = model.nominal_noise(robot);
        Self {
            pose: Vector3::zeros(),
            covariance: Matrix3::identity() * UNSURE_M * UNSURE_M,
            context: Context::new(Vector3::zeros(), noise.offset + noise.deviation),
            wheels: WheelContext::new(robot.tolerance),
        }
    }

    /// The block's part, bit for bit; of covariances the upper triangle.
    #[must_use]
    pub fn to_block(&self) -> HealthyBelief {
        let mut block = HealthyBelief {
            pose: self.pose.into(),
            pose_covariance: triangle(&self.covariance),
            deviation: self.context.mean.into(),
            deviation_covariance: triangle(&self.context.covariance),
            direction: self.context.direction(),
            ..HealthyBelief::default()
        };
        self.wheels.write(&mut block);
        block
    }

    /// What a block says, for a robot whose wheels are as in `wheels`; None if it says nothing, or
    /// what no detector believes.
    #[must_use]
    pub fn from_block(block: &HealthyBelief, wheels: WheelContext) -> Option<Self> {
        let covariance = symmetric(&block.pose_covariance)?;
        let context = Context::new(
            Vector3::from(block.deviation),
            symmetric(&block.deviation_covariance)?,
        )
        .facing(block.direction);
        let pose = Vector3::from(block.pose);
        let is_finite = |vector: &Vector3<f64>| vector.iter().all(|value| value.is_finite());
        let is_sane = [-1.0, 0.0, 1.0].contains(&block.direction) && covariance[(0, 0)] > 0.0;
        if !(is_finite(&pose) && is_finite(&context.mean) && is_sane) {
            return None;
        }
        Some(Self {
            pose,
            covariance,
            context,
            wheels: wheels.read(block)?,
        })
    }

    /// The track of a mode with this noise that begins here.
    #[must_use]
    pub fn track(&self, noise: &MotionNoise) -> Track {
        Track::new(self.pose, self.covariance, noise)
            .enter(&self.context, noise)
            .facing(self.context.direction())
    }
}

/// The upper triangle of a covariance, row by row: as blocks hold it.
#[must_use]
pub fn triangle(matrix: &Matrix3<f64>) -> [f64; 6] {
    let at = |i, j| matrix[(i, j)];
    [at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2)]
}

fn symmetric(triangle: &[f64; 6]) -> Option<Matrix3<f64>> {
    let &[a, b, c, d, e, f] = triangle;
    let is_variance = |value: f64| (0.0..=VARIANCE_MAX).contains(&value);
    let fits = |cross: f64, one: f64, other: f64| cross * cross <= one * other * (1.0 + 1e-9);
    let is_sane = is_variance(a) && is_variance(d) && is_variance(f);
    let is_sane = is_sane && fits(b, a, d) && fits(c, a, f) && fits(e, d, f);
    is_sane.then(|| Matrix3::new(a, b, c, b, d, e, c, e, f))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn healthy() -> Healthy {
        Healthy {
            pose: Vector3::new(1.0, -2.0, 0.3),
            covariance: Matrix3::new(4e-4, 1e-5, 2e-5, 1e-5, 3e-4, -1e-5, 2e-5, -1e-5, 1e-4),
            context: Context::new(
                Vector3::new(0.01, -0.03, 0.002),
                Matrix3::from_diagonal(&Vector3::new(1e-5, 2e-5, 3e-5)),
            )
            .facing(-1.0),
            wheels: WheelContext::default(),
        }
    }

    #[test]
    fn the_block_holds_it_bit_for_bit() {
        let found = Healthy::from_block(&healthy().to_block(), WheelContext::default());
        assert_eq!(found, Some(healthy()));
    }

    #[test]
    fn what_no_detector_believes_is_refused() {
        let wheels = WheelContext::default();
        assert_eq!(Healthy::from_block(&HealthyBelief::default(), wheels), None);
        for bad in [f64::NAN, f64::INFINITY, -1.0, 1e9] {
            let mut block = healthy().to_block();
            block.pose_covariance[3] = bad;
            assert_eq!(Healthy::from_block(&block, wheels), None);
            let mut block = healthy().to_block();
            block.direction = bad * 0.5;
            assert_eq!(Healthy::from_block(&block, wheels), None);
            let mut block = healthy().to_block();
            block.wheel_offset_variance[2] = bad;
            assert_eq!(Healthy::from_block(&block, wheels), None);
        }
        let mut block = healthy().to_block();
        block.pose_covariance[1] = 1.0;
        assert_eq!(Healthy::from_block(&block, wheels), None);
    }
}
