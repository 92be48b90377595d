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
//! With discount 1 the blind bound is another: one action, then any by lot, as one action for ever
//! may never end. The preconditions are in [`SolveError`].
//!
//! All are found by policy iteration, that is by linear systems, so that a discount near 1 costs
//! nothing. What is left of their error is accounted for: added to upper bounds, taken from lower
//! ones; of [`mdp`], whose values serve policies as they are, [`mdp::Solution::error`] says it.

pub mod blind;
pub mod fib;
mod informed;
pub(crate) mod linear;
pub mod mdp;
mod proper;
#[cfg(feature = "solver")]
pub mod tib;

use crate::budget::StopRequest;

/// Times that a slack is raised: from about 1e-13 to 1e-7.
const SLACKS: i32 = 6;
const SLACK_FACTOR: f64 = 16.0;

/// What a backup over so many `terms` may lose by rounding, relative to the largest value; upper
/// bounds are moved up by it and lower ones down, so that such as are equal in truth never cross.
pub(crate) fn rounding(terms: usize) -> f64 {
    (32.0 + terms as f64) * f64::EPSILON
}

/// What is added to every step, relative to the largest value, until the result of policy iteration
/// is certainly beyond its own backup, which may be off by `error`: with a discount below 1
/// nothing, as what is left is accounted for otherwise; with 1 ever more.
pub(crate) fn slacks(discount: f64, error: f64) -> impl Iterator<Item = f64> {
    let count = if discount < 1.0 { 1 } else { SLACKS };
    let first = if discount < 1.0 { 0.0 } else { 8.0 * error };
    (0..count).map(move |power| first * SLACK_FACTOR.powi(power))
}

/// The factor by which errors shrink with every step: discount times the largest sum of a row.
///
/// # Errors
/// [`SolveError::Unbounded`] if that is no less than 1, or no number.
pub(crate) fn contraction(discount: f64, mass_max: f64) -> Result<f64, SolveError> {
    let factor = discount * mass_max;
    if factor < 1.0 {
        Ok(factor)
    } else if discount < 1.0 && mass_max.is_finite() {
        Err(SolveError::Mass(discount, mass_max))
    } else {
        Err(SolveError::Unbounded(discount))
    }
}

/// One vector q_a over the states for each action: `Q[a][s]`, in units of reward.
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
    pub fn values(&self, action: usize) -> &[f64] {
        &self.values[action * self.states..][..self.states]
    }

    /// How many states.
    pub(crate) const fn states(&self) -> usize {
        self.states
    }

    /// max_a sum_s b(s) q_a(s); `belief` has one probability a state.
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
    /// The values are unbounded: rewards too large for a double, or, with a discount of 1, a policy
    /// that never ends.
    #[error(
        "the values are not bounded with discount {0}: allowed are rewards whose sums are finite, \
         and with discount 1 policies that come to an end"
    )]
    Unbounded(f64),
    /// Discount 1, and no goal.
    #[error(
        "discount 1 needs a goal, a set of states that no action leaves and in which none earns \
         or pays anything; there is none"
    )]
    NoGoal,
    /// Discount 1, and a state from which no goal can be reached.
    #[error("discount 1 needs a way to a goal from every state; from '{0}' there is none")]
    NoWay(String),
    /// Discount 1, and a state from which never ending costs nothing, or pays.
    #[error(
        "discount 1 needs a price of never ending; from '{0}' a policy can go on for ever without \
         loss: let each step outside the goals cost something"
    )]
    Endless(String),
    /// The discount, and the sum of a row that grows faster than it shrinks.
    #[error(
        "with discount {0} the values are not bounded, as a row of T, or of T and O together, sums \
         to {1}; allowed are sums below {max:.12}", max = 1.0 / .0
    )]
    Mass(f64, f64),
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

impl From<StopRequest> for SolveError {
    fn from(_: StopRequest) -> Self {
        Self::Stopped
    }
}
