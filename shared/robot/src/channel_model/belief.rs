//! What is believed of a robot's components.

use vigil_blocks::SizeKind;
use vigil_checkpoint::CheckpointValue;

use super::fault_kind::FaultKind;

/// What is believed of one component, given that something is wrong.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct ComponentBelief {
    /// Probability that it is this one.
    pub p: f64,
    /// Most probable kind.
    pub kind: FaultKind,
    /// The same with the unit of its size.
    pub size_kind: SizeKind,
    /// Size.
    pub size: f64,
    /// Deviation of the size.
    pub size_sd: f64,
    /// For how long it has been there at most, s.
    pub age_s: f64,
}

pub(super) const NO_BELIEF: ComponentBelief = ComponentBelief {
    p: 0.0,
    kind: FaultKind::Erratic,
    size_kind: SizeKind::None,
    size: 0.0,
    size_sd: 0.0,
    age_s: 0.0,
};

/// Two faults at once.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct PairBelief {
    /// Probability that it is two at once, most likely these, given that something is wrong.
    pub p: f64,
    /// Their components.
    pub components: [usize; 2],
}
