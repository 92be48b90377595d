//! Blocks as messages of ROS 2.

mod action;
mod detection;
mod diagnosis;
mod event;
mod faults;
mod frame;
mod health;
mod truth;

use vigil_setup::Setup;

pub(crate) use action::ActionTranslation;
pub(crate) use detection::DetectionTranslation;
pub(crate) use diagnosis::DiagnosisTranslation;
pub(crate) use event::write_event;
pub(crate) use faults::FaultsTranslation;
pub(crate) use frame::FrameTranslation;
pub(crate) use health::HealthTranslation;
pub(crate) use truth::write_truth;

/// What was made of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// Its messages, as far as any were due.
    Messages,
    /// Nothing: its numbers are about other models than the graph's.
    OtherModels,
}

/// How each block with content is translated.
pub(crate) struct Translation {
    pub(crate) frame: FrameTranslation,
    pub(crate) detection: DetectionTranslation,
    pub(crate) diagnosis: DiagnosisTranslation,
    pub(crate) action: ActionTranslation,
    pub(crate) faults: FaultsTranslation,
    pub(crate) health: HealthTranslation,
}

impl Translation {
    /// With the names that a graph's models give.
    pub(crate) fn new(setup: &Setup) -> Self {
        Self {
            frame: FrameTranslation::new(&setup.robot),
            detection: DetectionTranslation::new(&setup.robot),
            diagnosis: DiagnosisTranslation::new(setup),
            action: ActionTranslation::new(setup),
            faults: FaultsTranslation::new(setup),
            health: HealthTranslation::new(setup),
        }
    }
}
