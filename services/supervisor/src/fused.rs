//! The alarm that a user sees.

use vigil_blocks::{Action, DetectionBelief};

/// The fused alarm of a cycle. The supervisor, which alone sees both stages, is to publish it as
/// `action.alarm`; until it does, and without a supervisor, the detector's stands for it.
#[must_use]
pub const fn fused_alarm(detection: &DetectionBelief, _action: Option<&Action>) -> bool {
    detection.alarm != 0
}
