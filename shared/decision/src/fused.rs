//! The alarm that a user sees.

use vigil_blocks::{Action, DetectionBelief};

/// The fused alarm of a cycle: what the supervisor, which alone sees both stages, has published.
/// Without a supervisor the detector's stands for it.
#[must_use]
pub const fn fused_alarm(detection: &DetectionBelief, action: Option<&Action>) -> bool {
    match action {
        Some(action) => action.alarm != 0,
        None => detection.alarm != 0,
    }
}
