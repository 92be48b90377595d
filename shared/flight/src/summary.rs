//! What was written.

use std::collections::BTreeMap;
use std::path::PathBuf;

/// What was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FlightSummary {
    /// The file.
    pub path: PathBuf,
    /// Its size, bytes.
    pub bytes: u64,
    /// Messages by the topic of their channel.
    pub messages: BTreeMap<String, u64>,
    /// When the earliest message was, since 1970, ns; `None` of a file without messages.
    pub first_unix_ns: Option<u64>,
    /// When the latest message was, since 1970, ns.
    pub last_unix_ns: Option<u64>,
    /// Blocks from which no messages could be made: of another version, or of other models than
    /// the graph's.
    pub raw_only: u64,
}
