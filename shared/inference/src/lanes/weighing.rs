//! An observation as the kernels read it: one table for the wheels, three parabolas for the pose.

use std::f64::consts::{LOG2_E, TAU};

use super::model::{MAGNITUDE_MAX, PlanarModel, WHEELS_MAX};
use super::vector::Block;
use crate::angle::wrap;

/// What is measured in one step. A channel that is not finite, or beyond
/// [`MAGNITUDE_MAX`], is left out of the likelihood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// x m, y m, yaw rad (of any number of turns).
    pub pose: [f64; 3],
    /// Wheel rates, rad/s; those behind the model's number of wheels are ignored.
    pub wheel_rates: [f64; WHEELS_MAX],
}

impl Observation {
    /// Nothing measured: every channel is missing.
    pub const MISSING: Self = Self {
        pose: [f64::NAN; 3],
        wheel_rates: [f64::NAN; WHEELS_MAX],
    };
}

/// Likelihoods in units of `log 2`, relative to the best mode's at the measured pose: never
/// positive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weighing {
    /// Measured pose; where it is missing the given reference.
    pub reference: [f32; 3],
    /// What multiplies the squared distance from it; 0 where it is missing.
    pub precision: [f32; 3],
    /// For each mode what its wheel rates say.
    pub modes: Block<f32>,
    /// `ln` of the density at the measured pose in the best mode; not finite if the wheel rates
    /// are beyond all numbers in every mode.
    pub log_best: f64,
    /// Channels in use.
    pub used: usize,
    /// Channels that had to be left out.
    pub missing: usize,
}

/// What is less likely than this, relative to the best mode, is as good as impossible; keeps the
/// arithmetic finite.
const LOG2_MIN: f64 = -1e9;

impl Weighing {
    /// Nothing measured.
    pub(super) fn nothing(reference: [f64; 3]) -> Self {
        Self {
            reference: reference.map(|at| at as f32),
            precision: [0.0; 3],
            modes: Block::splat(0.0),
            log_best: 0.0,
            used: 0,
            missing: 0,
        }
    }

    /// `reference` stands in for a missing pose.
    pub(super) fn new(model: &PlanarModel, z: &Observation, reference: [f64; 3]) -> Self {
        let mut weighing = Self::nothing(reference);
        let usable = |value: f64| value.abs() <= MAGNITUDE_MAX;
        let pose = [z.pose[0], z.pose[1], wrap(z.pose[2])];
        for (axis, (&at, &sd)) in pose.iter().zip(&model.pose_sd).enumerate() {
            if usable(at) {
                weighing.reference[axis] = at as f32;
                weighing.precision[axis] = (0.5 * LOG2_E / (sd * sd)) as f32;
                weighing.log_best -= 0.5 * (TAU * sd * sd).ln();
                weighing.used += 1;
            } else {
                weighing.missing += 1;
            }
        }
        let wheels = &z.wheel_rates[..model.wheels];
        let used = wheels.iter().filter(|rate| usable(**rate)).count();
        weighing.used += used;
        weighing.missing += model.wheels - used;
        let variance = model.wheel_rate_sd * model.wheel_rate_sd;
        weighing.log_best -= 0.5 * used as f64 * (TAU * variance).ln();
        weighing.weigh_wheels(
            model,
            wheels.iter().map(|&z| usable(z).then_some(z)),
            variance,
        );
        weighing
    }

    fn weigh_wheels(
        &mut self,
        model: &PlanarModel,
        wheels: impl Iterator<Item = Option<f64>> + Clone,
        variance: f64,
    ) {
        let means = &model.wheel_rates[..model.modes];
        let distance = |means: &[f64; WHEELS_MAX]| -> f64 {
            let apart = wheels.clone().zip(means);
            let squares = apart.map(|(z, mean)| z.map_or(0.0, |z| (z - mean) * (z - mean)));
            squares.sum::<f64>() / variance
        };
        let mut distances = [0.0; super::model::MODES_MAX];
        let mut least = f64::INFINITY;
        for (to, means) in distances.iter_mut().zip(means) {
            *to = distance(means);
            least = least.min(*to);
        }
        self.log_best -= 0.5 * least;
        for (to, distance) in self.modes.0.iter_mut().zip(distances).take(model.modes) {
            *to = (-0.5 * LOG2_E * (distance - least)).max(LOG2_MIN) as f32;
        }
    }
}
