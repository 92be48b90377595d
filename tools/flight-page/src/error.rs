//! Why a recording has no page.

use std::path::PathBuf;

use thiserror::Error;
use vigil_flight::FlightError;
use vigil_setup::SetupError;

/// Why a recording has no page.
#[derive(Debug, Error)]
pub enum PageError {
    /// It cannot be read.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// Nothing in it has a name.
    #[error("{} does not hold what its graph ran on: nothing in it has a name", path.display())]
    Nameless {
        /// The file.
        path: PathBuf,
    },
    /// What its graph ran on is not what this version reads.
    #[error("{}: what its graph ran on cannot be read: {source}", path.display())]
    Document {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: SetupError,
    },
}
