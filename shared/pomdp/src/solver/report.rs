//! What a search aims at, and what it found.

use crate::alpha_vectors::AlphaVectors;

/// What is known of the optimal value at the start belief, in units of reward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bracket {
    /// At least this; minus infinity if nothing is known.
    pub lower: f64,
    /// At most this; infinity if nothing is known.
    pub upper: f64,
}

impl Bracket {
    /// upper - lower.
    #[must_use]
    pub fn gap(&self) -> f64 {
        self.upper - self.lower
    }
}

impl Default for Bracket {
    fn default() -> Self {
        Self {
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        }
    }
}

/// What the solver aims at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Gap at which it ends, in units of reward.
    pub precision: f64,
    /// Memory at which it ends, bytes (of its large tables).
    pub memory_bytes_max: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            precision: 1e-6,
            memory_bytes_max: 4 << 30,
        }
    }
}

/// How far a search is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Progress {
    /// Of the optimal value at the start belief.
    pub bracket: Bracket,
    /// Walks and other rounds so far.
    pub rounds: usize,
    /// Vectors of the lower bound.
    pub vectors: usize,
    /// Points of the upper bound.
    pub points: usize,
    /// Beliefs reached.
    pub beliefs: usize,
}

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndReason {
    /// The gap is small enough.
    Precision,
    /// The budget ended.
    Stopped,
    /// The memory ended.
    Memory,
}

/// What a search found.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchResult {
    /// Of the optimal value at the start belief.
    pub bracket: Bracket,
    /// How far it came.
    pub progress: Progress,
    /// Why it ended.
    pub ended: EndReason,
    /// The policy; its value at the start belief is at least the lower bound. None if the budget
    /// ended before there was any.
    pub vectors: Option<AlphaVectors>,
}
