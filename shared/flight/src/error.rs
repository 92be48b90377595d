//! Why a flight cannot be written or read.

use std::path::PathBuf;

use thiserror::Error;
use vigil_setup::SetupError;

/// Why a flight cannot be written or read. What was flushed before stays in the partial file.
#[derive(Debug, Error)]
pub enum FlightError {
    /// The file cannot be created, written, synchronised or renamed.
    #[error("cannot write {}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The container refuses a record.
    #[error("cannot write {}: {source}", path.display())]
    Container {
        /// The file.
        path: PathBuf,
        /// What the container says.
        source: mcap::McapError,
    },
    /// The file cannot be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file does not begin as MCAP files do.
    #[error("{} is no MCAP file", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
    /// Another program's file.
    #[error("{} is an MCAP file, but no recording of Vigil", path.display())]
    NotOfVigil {
        /// The file.
        path: PathBuf,
    },
    /// Another program has compressed the file.
    #[error("{} is compressed ({how}): `mcap decompress` writes it anew", path.display())]
    Compressed {
        /// The file.
        path: PathBuf,
        /// The name of the compression.
        how: String,
    },
    /// The file does not hold what its graph ran on, so nothing in it has a name.
    #[error("{} does not hold what its graph ran on (document.toml)", path.display())]
    NoDocument {
        /// The file.
        path: PathBuf,
    },
    /// What the graph ran on is not what this version reads.
    #[error("what the graph ran on cannot be read: {source}")]
    Document {
        /// What is wrong with it, and in which file.
        source: SetupError,
    },
    /// The file has an end: there is nothing to mend.
    #[error("{} is whole", path.display())]
    Whole {
        /// The file.
        path: PathBuf,
    },
    /// What stands in the file is not what was written.
    #[error("{} is damaged: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where it contradicts itself.
        what: String,
    },
}
