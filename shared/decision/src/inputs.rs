//! What one cycle takes.

use vigil_blocks::{DetectionBelief, FaultBelief};

/// What a cycle of the supervisor takes; at least one of the two is there.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// The identifier's belief, if it came.
    pub diagnosis: Option<&'a FaultBelief>,
    /// The newest belief of the detector, if it is new. One that a missed deadline caused says
    /// whether the detector is blind, and nothing else.
    pub detection: Option<&'a DetectionBelief>,
}
