//! The black box: how much it keeps, and when it writes a recording.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

/// The black box: how much it keeps, and when it writes a recording.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Blackbox {
    /// True to keep the last seconds, and to write them at an alarm, a crash, or on demand.
    #[default(true)]
    pub enabled: bool,
    /// Folder of the recordings; empty for `/var/lib/vigil/GRAPH` where that can be written, else
    /// the user's own, `~/.local/state/vigil/GRAPH`.
    pub folder: String,
    /// Memory for the last seconds; what does not fit is dropped, the oldest first. A rover at 100
    /// Hz fills one MiB a second.
    #[default(80)]
    #[schemars(range(min = 4, max = 8192))]
    pub memory_mib: u32,
    /// Time before an event that a recording holds, if the memory does.
    #[default(60.0)]
    #[schemars(range(min = 1.0, max = 3600.0))]
    pub before_s: f64,
    /// Time after the last event that a recording holds.
    #[default(20.0)]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub after_s: f64,
    /// Largest sum of all recordings in the folder; the oldest are dropped.
    #[default(1024)]
    #[schemars(range(min = 16, max = 1_048_576))]
    pub folder_mib: u32,
    /// Time between two recordings that only missed cycles are the reason of.
    #[default(600.0)]
    #[schemars(range(min = 1.0, max = 86_400.0))]
    pub miss_pause_s: f64,
}

impl Blackbox {
    /// Folder of the recordings of `graph`; a relative one lies beside the graph file at `path`.
    #[must_use]
    pub fn folder(&self, path: &Path, graph: &str) -> PathBuf {
        if !self.folder.is_empty() {
            return path.parent().unwrap_or(Path::new(".")).join(&self.folder);
        }
        let system = PathBuf::from("/var/lib/vigil").join(graph);
        if std::fs::create_dir_all(&system).is_ok() {
            return system;
        }
        let home = |name: &str| std::env::var_os(name).map(PathBuf::from);
        let state = home("XDG_STATE_HOME").or_else(|| Some(home("HOME")?.join(".local/state")));
        state
            .unwrap_or_else(std::env::temp_dir)
            .join("vigil")
            .join(graph)
    }

    /// Bytes of memory for the last seconds.
    #[must_use]
    pub const fn memory_bytes(&self) -> u64 {
        (self.memory_mib as u64) << 20
    }

    /// Largest sum of all recordings, bytes.
    #[must_use]
    pub const fn folder_bytes(&self) -> u64 {
        (self.folder_mib as u64) << 20
    }
}
