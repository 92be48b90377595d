//! Prior rates at which faults begin and end.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Prior rates of faults, per second of motion: at rest nothing changes them. They are assumed,
/// since no log is long enough to learn them, and decide only while the measurements do not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FaultPrior {
    /// The first fault, once the detector suspects one, 1/s. The rate over a robot's life would
    /// make the diagnosis slow without making it more often right.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub suspected_1_s: f64,
    /// A further fault of a robot whose motion shows one already, 1/s; at most the first one's
    /// rate.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub further_1_s: f64,
    /// Rate at which a fault ends, 1/s.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub mended_1_s: f64,
    /// Rate at which the fault of an alarm returns once it has ended, 1/s.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub again_1_s: f64,
}

impl Default for FaultPrior {
    fn default() -> Self {
        Self {
            // Chosen: its logarithm is the delay; a rate of once an hour costs 3.6 nats more.
            suspected_1_s: 0.01,
            // Chosen: one an hour.
            further_1_s: 1.0 / 3600.0,
            // Chosen: after five minutes, as loose contacts and stones do.
            mended_1_s: 1.0 / 300.0,
            // Chosen: an intermittent fault, in a quarter of an hour.
            again_1_s: 1e-3,
        }
    }
}
