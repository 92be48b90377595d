//! An event as it came.

use vigil_blocks::Event;
use vigil_cycle::topic::ServiceName;

/// An event as it came.
#[derive(Debug, Clone)]
pub(crate) struct Record {
    pub(crate) service: ServiceName,
    pub(crate) event: Event,
    /// What it says, if no block can carry that.
    pub(crate) text: Option<String>,
}
