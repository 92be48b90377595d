//! Bounds of the optimal value, from cheap and loose to dear and tight.
//!
//! At every belief: blind <= V* <= TIB <= FIB <= Q-MDP <= MDP.
//!
//! | bound | what it allows the controller | cost |
//! |---|---|---|
//! | [`blind`] (lower) | one action for ever | linear in the model |
//! | [`mdp`] (upper) | to see the state from now on; Q-MDP: after one step | linear |
//! | [`fib`] (upper) | as Q-MDP, but its next action follows the observation | times observations |
//! | [`tib`] (upper) | the same, one step later | about the square |
//!
//! All are found by policy iteration, that is by linear systems, so that a discount near 1 costs
//! nothing. Upper bounds are published with what is left of their error added.

pub mod blind;
pub mod fib;
mod informed;
pub(crate) mod linear;
pub mod mdp;
pub mod tib;

use crate::budget::Stopped;

/// What a backup and its value may lose by rounding, relative to the largest value; upper bounds
/// are moved up by it, so that a lower and an upper one that are equal in truth never cross.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Q[a][.], one row per action.
#[derive(Debug, Clone, PartialEq)]
pub struct ActionValues {
    states: usize,
    values: Vec<f64>,
}

impl ActionValues {
    pub(crate) const fn new(states: usize, values: Vec<f64>) -> Self {
        Self { states, values }
    }

    /// One row per action: the vector q_a over states.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks(self.states)
    }

    /// q_a over states.
    #[must_use]
    pub fn of(&self, action: usize) -> &[f64] {
        &self.values[action * self.states..][..self.states]
    }

    /// max_a sum_s b(s) q_a(s).
    #[must_use]
    pub fn value(&self, belief: &[f64]) -> f64 {
        self.rows()
            .map(|row| row.iter().zip(belief).map(|(q, b)| q * b).sum())
            .fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Why a model could not be solved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// The values are unbounded, or the equations singular: a discount of 1 without an end, or
    /// rewards too large for a double.
    #[error(
        "the values are not bounded with discount {0}: allowed is a discount below 1, or policies \
         that come to an end, and rewards whose sums are finite"
    )]
    Unbounded(f64),
    /// A linear system that iteration does not solve, too large for a dense solve.
    #[error(
        "iteration does not solve {0} equations; a dense solve is allowed up to {max}",
        max = linear::DENSE_MAX
    )]
    Size(usize),
    /// The tables of the bound would take too much memory.
    #[error("the bound needs {0} table entries, allowed are {max}", max = informed::ENTRIES_MAX)]
    Entries(usize),
    /// The budget ended first.
    #[error("stopped before the end")]
    Stopped,
}

impl From<Stopped> for SolveError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}
