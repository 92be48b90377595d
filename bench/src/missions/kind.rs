//! Kinds of missions, by what breaks.

use serde::Deserialize;

/// Kind of a mission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Nothing breaks.
    Nothing,
    /// A wheel sticks.
    Stuck,
    /// An encoder breaks.
    Encoder,
    /// Two of these, one after the other.
    Two,
    /// Something happens that no model contains.
    Unmodelled,
    /// A wheel sticks or an encoder breaks, again and again for a while.
    Intermittent,
    /// Something begins from nothing and grows.
    Growing,
}

impl Kind {
    /// All.
    pub const ALL: [Self; 7] = [
        Self::Nothing,
        Self::Stuck,
        Self::Encoder,
        Self::Two,
        Self::Unmodelled,
        Self::Intermittent,
        Self::Growing,
    ];

    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Stuck => "stuck wheel",
            Self::Encoder => "broken encoder",
            Self::Two => "two faults",
            Self::Unmodelled => "unmodelled",
            Self::Intermittent => "intermittent",
            Self::Growing => "growing",
        }
    }
}
