//! A fault that a robot's description names in a `[[fault]]` table.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Such faults of a robot at most.
pub const DECLARED_MAX: usize = 8;
/// Channels in which one may be declared to show at most.
pub const SHOWN_MAX: usize = 4;

/// A fault that is none of a single sensor or drive: a `[[fault]]` table of a robot's description.
/// It is recognized by the channels in which it is declared to show, by the labelled runs that the
/// model was learned from, or by both.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeclaredFault {
    /// Name: of its leaf, and the `mode` of its runs in a file of labels.
    pub name: String,
    /// Abstract node above its leaf; left out: none.
    #[serde(default)]
    pub group: Option<String>,
    /// Channels that it shifts, each by an amount of its own, up to four; left out: labelled runs
    /// alone say how it shows.
    #[serde(default)]
    #[schemars(length(max = SHOWN_MAX))]
    pub shows: Vec<String>,
    /// Wheel with each turn of which it comes back, as a flat tyre or a bent axle does: labelled
    /// runs say what channels show in the first five orders of its angle. The wheel's rate is
    /// measured.
    #[serde(default)]
    pub wheel: Option<String>,
}
