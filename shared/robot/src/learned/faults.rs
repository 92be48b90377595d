//! What faults may do to the motion, as far as the detector cares: something, or about what the
//! learned faults do that turn the robot to the left, or to the right.

use nalgebra::{Matrix3, Vector3};
use vigil_inference::departure::Kind;
use vigil_inference::track::{Displacement, MotionNoise};

use super::model::StuckModel;
use super::motion_modes::unknown_noise;
use super::{Model, Observation};

/// Kinds of faults: anything, like those learned that turn left, like those that turn right.
pub const KINDS: usize = 3;
/// Share of faults that do anything.
const SHARE_ANYTHING: f64 = 0.5;

/// Kinds of faults.
#[derive(Debug, Clone)]
pub struct Faults {
    anything: MotionNoise,
    learned: [Vec<StuckModel>; KINDS - 1],
}

impl Faults {
    /// The faults that a model knows, divided by the way they turn the robot on a straight path.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let straight = model.nominal.motion.yaw.curvature[0];
        let turning = |left: bool| {
            let of = |stuck: &&StuckModel| (stuck.motion.yaw.curvature[0] > straight) == left;
            model.stuck.iter().filter(of).cloned().collect()
        };
        Self {
            anything: unknown_noise(model),
            learned: [turning(true), turning(false)],
        }
    }

    /// The kinds at the command of an observation, over the nominal displacement `step`.
    #[must_use]
    pub fn kinds(
        &self,
        model: &Model,
        observation: &Observation,
        step: &Displacement,
    ) -> [Kind; KINDS] {
        let mut kinds = [Kind {
            share: 1.0,
            step: *step,
            noise: self.anything,
        }; KINDS];
        for (kind, faults) in kinds[1..].iter_mut().zip(&self.learned) {
            kind.share = 0.0;
            if faults.is_empty() {
                continue;
            }
            let limit = model.command.curvature_max_1_m;
            let share = 1.0 / faults.len() as f64;
            let (mut mean, mut square) = (Vector3::zeros(), Matrix3::zeros());
            let mut noise = MotionNoise {
                offset: Matrix3::zeros(),
                deviation: Matrix3::zeros(),
                length_m: 0.0,
                white: Vector3::zeros(),
            };
            for fault in faults {
                let motion = &fault.motion;
                let at = motion.per_metre(observation.curvature, observation.speed, limit);
                let (at, own) = (Vector3::from(at), motion.noise());
                mean += at * share;
                square += at * at.transpose() * share;
                noise.offset += own.offset * share;
                noise.deviation += own.deviation * share;
                noise.length_m += own.length_m * share;
                noise.white += own.white * share;
            }
            noise.offset += square - mean * mean.transpose();
            kind.step.per_metre = mean.into();
            kind.noise = noise;
            kind.share = (1.0 - SHARE_ANYTHING) / self.learned.len() as f64;
        }
        kinds[0].share = 1.0 - kinds[1].share - kinds[2].share;
        kinds
    }
}
