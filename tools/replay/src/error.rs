//! Why a recording cannot be computed again.

use std::path::PathBuf;

use vigil_flight::FlightError;
use vigil_setup::SetupError;

/// Why a recording cannot be computed again.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The file.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// What the graph ran on does not stand in it.
    #[error("{}: what the graph ran on is not in the file (document.toml)", .0.display())]
    NoDocument(PathBuf),
    /// What the graph ran on cannot be read: it was another version.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// What the graph ran on does not fit together any more.
    #[error("{service}: {reason}")]
    Build {
        /// Which service.
        service: &'static str,
        /// Why.
        reason: String,
    },
}
