//! What an identifier does at present.

use vigil_checkpoint::CheckpointValue;

/// What the identifier is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, CheckpointValue)]
pub(crate) enum Phase {
    /// No alarm, no fault believed.
    Watching,
    /// The next observation of the ring to take has this index.
    Identifying(usize),
}
