//! Why a flight cannot be written.

use std::path::PathBuf;

use thiserror::Error;

/// Why a flight cannot be written. What was flushed before stays in the partial file.
#[derive(Debug, Error)]
pub enum FlightError {
    /// The file cannot be created, synchronised or renamed.
    #[error("cannot write {}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The container refuses a record, or the disk does.
    #[error("cannot write {}: {source}", path.display())]
    Container {
        /// The file.
        path: PathBuf,
        /// What the container says.
        source: mcap::McapError,
    },
}
