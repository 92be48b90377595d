//! How a graph is, in one word.

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::OverallState;

/// How a graph is: the supervisor's overall state, unless something worse is the matter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GraphState {
    /// Nothing is wrong.
    Ok,
    /// Warnings at most.
    Degraded,
    /// A fault is present, or was and nobody has acknowledged it.
    Fault,
    /// A fault is present, and the robot is told to stand.
    SafeStop,
    /// How the robot is, is not known.
    Stale,
    /// No fault, but no launcher either: nobody restarts a service.
    Unsupervised,
    /// The graph runs no longer.
    Ended,
}

impl GraphState {
    /// From the overall state; `None` if nobody says it.
    pub const fn new(overall: Option<OverallState>, has_launcher: bool) -> Self {
        match (overall, has_launcher) {
            (None | Some(OverallState::Stale), _) => Self::Stale,
            (Some(OverallState::Fault), _) => Self::Fault,
            (Some(OverallState::SafeStop), _) => Self::SafeStop,
            (Some(_), false) => Self::Unsupervised,
            (Some(OverallState::Ok), true) => Self::Ok,
            (Some(OverallState::Degraded), true) => Self::Degraded,
        }
    }

    /// The word for people.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Ok => "OK",
            Self::Degraded => "DEGRADED",
            Self::Fault => "FAULT",
            Self::SafeStop => "SAFE STOP",
            Self::Stale => "STALE",
            Self::Unsupervised => "UNSUPERVISED",
            Self::Ended => "ENDED",
        }
    }
}
