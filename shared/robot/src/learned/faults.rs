//! What faults may do to the motion, as far as the detector cares: anything, or what the learned
//! ones do. Trying those besides the unknown lets the detector see them sooner, and nothing later.

use vigil_blocks::WHEELS;
use vigil_checkpoint::Checkpoint;
use vigil_inference::departure::Kind;
use vigil_inference::track::{Displacement, MotionNoise};

use super::motion_modes::unknown_noise;
use super::{Model, MotionModel, Observation};
use crate::description::Description;

/// Kinds of faults: anything, and each wheel stuck.
pub const KINDS: usize = 1 + WHEELS;
/// Share of faults that do anything. Even: it costs the learned faults ln 2.
const SHARE_ANYTHING: f64 = 0.5;

/// Kinds of faults.
#[derive(Debug, Clone, Checkpoint)]
pub struct Faults {
    #[checkpoint(fixed)]
    anything: MotionNoise,
    /// Whether ground has a tolerance, within which a departure is no fault.
    is_bounded: bool,
    #[checkpoint(fixed)]
    learned: [Option<(MotionModel, MotionNoise)>; WHEELS],
}

impl Faults {
    /// The faults that a model knows.
    #[must_use]
    pub fn new(model: &Model, robot: &Description) -> Self {
        let stuck = |wheel: usize| model.stuck(wheel).map(|stuck| stuck.motion);
        let drifting = |noise| robot.with_ground_drift(noise);
        Self {
            anything: drifting(unknown_noise(model)),
            is_bounded: robot.tolerance.is_some(),
            learned: std::array::from_fn(|w| {
                stuck(w).map(|motion| (motion, drifting(motion.noise())))
            }),
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
        let known = self.learned.iter().flatten().count();
        let anything = if known == 0 { 1.0 } else { SHARE_ANYTHING };
        let mut kinds = [Kind {
            share: anything,
            step: *step,
            noise: self.anything,
            is_unknown: self.is_bounded,
        }; KINDS];
        for (kind, learned) in kinds[1..].iter_mut().zip(&self.learned) {
            (kind.share, kind.is_unknown) = (0.0, false);
            if let Some((motion, noise)) = learned {
                *kind = Kind {
                    share: (1.0 - SHARE_ANYTHING) / known as f64,
                    step: observation.displacement(model, motion),
                    noise: *noise,
                    is_unknown: false,
                };
            }
        }
        kinds
    }
}
