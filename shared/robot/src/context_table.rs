//! A change that is no fault, which a robot's description names in a `[[context]]` table.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Such changes of a robot at most.
pub const CONTEXTS_MAX: usize = 4;

/// A change that is no fault, as of the ground: a `[[context]]` table of a robot's description.
/// Labelled runs say how it shows. It raises no alarm and changes no action.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeclaredContext {
    /// Name: that of its events, and the `mode` of its runs in a file of labels.
    pub name: String,
    /// Channels in which it shows; left out: all. Of the velocity of a pose `forward` stands for
    /// the part along the way, and `lateral` for that across it.
    #[serde(default)]
    pub shows: Vec<String>,
}
