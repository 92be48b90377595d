//! The black box: how much it keeps, and when it writes a recording.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use vigil_blocks::{
    Action, DetectionBelief, FaultBelief, Faults, Health, Journal, ParticleBlock, SensorFrame,
    Truth,
};

/// States of the services' steps, bytes a second: as measured of the rover.
const STATES_BYTES_S: usize = 34_000;

/// The black box: how much it keeps, and when it writes a recording.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Blackbox {
    /// True to keep the last seconds, and to write them at an alarm, a crash, or on demand.
    #[default(true)]
    pub enabled: bool,
    /// Folder in which each graph has a folder of its recordings; empty for `/var/lib/vigil` where
    /// that can be written, else the user's own, `~/.local/state/vigil`.
    pub folder: String,
    /// Memory for the last seconds; what does not fit is dropped, the oldest first. A rover at 100
    /// Hz fills 1.1 MiB a second. Each killed black box takes as much again until its memory is
    /// written; two at most.
    #[default(80)]
    #[schemars(range(min = 4, max = 8192))]
    pub memory_mib: u32,
    /// Time before an event that a recording holds, if the memory does.
    #[default(60.0)]
    #[schemars(range(min = 1.0, max = 3600.0))]
    pub before_s: f64,
    /// Time after the last event that a recording holds; six times that after the first, at most.
    #[default(20.0)]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub after_s: f64,
    /// Largest sum of a graph's recordings, at least twice `memory_mib`; those of mere misses are
    /// dropped first, the oldest first.
    #[default(1024)]
    #[schemars(range(min = 16, max = 1_048_576))]
    pub folder_mib: u32,
    /// Time between two recordings that only missed cycles are the reason of.
    #[default(600.0)]
    #[schemars(range(min = 1.0, max = 86_400.0))]
    pub miss_pause_s: f64,
}

impl Blackbox {
    /// Folders for the recordings of `graph`, to be tried in order; a relative one lies beside the
    /// graph file at `path`. Each graph has one of its own.
    #[must_use]
    pub fn folders(&self, path: &Path, graph: &str) -> Vec<PathBuf> {
        if !self.folder.is_empty() {
            let beside = path.parent().unwrap_or(Path::new("."));
            return vec![beside.join(&self.folder).join(graph)];
        }
        let home = |name: &str| std::env::var_os(name).map(PathBuf::from);
        let state = home("XDG_STATE_HOME").or_else(|| Some(home("HOME")?.join(".local/state")));
        let roots = [
            Some(PathBuf::from("/var/lib")),
            state,
            Some(std::env::temp_dir()),
        ];
        let roots = roots.into_iter().flatten();
        roots.map(|root| root.join("vigil").join(graph)).collect()
    }

    /// How long a time the memory holds at this rate, s: from the sizes of the blocks, of which all
    /// but Health, faults and particles come in each cycle.
    #[must_use]
    pub fn memory_s(&self, rate_hz: f64) -> f64 {
        let each_cycle = size_of::<SensorFrame>()
            + size_of::<DetectionBelief>()
            + size_of::<FaultBelief>()
            + size_of::<Action>()
            + size_of::<Truth>()
            + 3 * size_of::<Journal>();
        let each_second = 2 * size_of::<ParticleBlock>()
            + 10 * size_of::<Faults>()
            + 4 * 20 * size_of::<Health>()
            + STATES_BYTES_S;
        self.memory_bytes() as f64 / (each_cycle as f64 * rate_hz + each_second as f64)
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
