//! Why a recording cannot be computed again.

use vigil_flight::FlightError;

/// Why a recording cannot be computed again.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The file, or what the graph ran on.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// What the graph ran on does not fit together any more.
    #[error("{service}: {reason}")]
    Build {
        /// Which service.
        service: &'static str,
        /// Why.
        reason: String,
    },
}
