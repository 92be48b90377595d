//! Where a model comes from.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where a model comes from.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Hash over the frames that were learned from.
    pub data_hash: String,
    /// Runs learned from.
    pub runs_learned: Vec<u32>,
    /// Runs left out, for the test.
    pub runs_held_out: Vec<u32>,
    /// End of what was learned from in each run, s; absent if runs were learned from whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until_s: Option<f64>,
    /// Name of the file with the frames, without its folder.
    pub frames_file: String,
    /// Name of the file with the labels, without its folder.
    pub labels_file: String,
    /// Seed of the split and of the detector's calibration.
    pub seed: u64,
    /// Part of the runs of every mode and kind that was left out.
    pub test_fraction: f64,
    /// Ground on which the runs were driven, as their labels call it; empty if they do not say.
    pub terrain: String,
    /// Version of the program that learned the model.
    pub software_version: String,
}
