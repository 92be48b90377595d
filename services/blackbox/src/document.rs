//! What `vigil record FILE.mcap` has written, as JSON.

use schemars::JsonSchema;
use serde::Serialize;

/// What `vigil record FILE.mcap` prints with --json.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RecordDocument {
    /// Version of this document.
    pub schema_version: u32,
    /// The file that was written; null if nothing came.
    pub recording: Option<String>,
    /// Its size.
    pub bytes: u64,
    /// Time that its blocks cover.
    pub recorded_s: f64,
    /// Blocks in it.
    pub blocks: u64,
    /// Blocks that were overwritten before they were taken.
    pub lost: u64,
    /// Times at which the disk was too slow, so that blocks were left out.
    pub gaps: u64,
}
