//! Policies: from a belief to an action. Definitions: Verma, Fernandez, Simmons (2002), section 2.

mod most_likely_state;
mod qmdp;
mod voting;

pub use most_likely_state::MostLikelyState;
pub use qmdp::QMdp;
pub use voting::ActionVoting;

/// A chosen action.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Index of the action.
    pub action: usize,
    /// Its value (or votes) minus the runner-up's; 0 at a tie or with one action.
    pub margin: f64,
}

/// A policy over beliefs. Allocates nothing.
pub trait Policy {
    /// Writes the value (or votes) of every action into `values`, and chooses. Ties go to the
    /// lowest index.
    fn evaluate(&self, belief: &[f64], values: &mut [f64]) -> Choice;
}

/// The largest value, the lowest index at a tie.
#[must_use]
pub fn choose(values: &[f64]) -> Choice {
    let mut best = (0, f64::NEG_INFINITY);
    let mut second = f64::NEG_INFINITY;
    for (action, &value) in values.iter().enumerate() {
        if value > best.1 {
            second = best.1;
            best = (action, value);
        } else if value > second {
            second = value;
        }
    }
    let margin = best.1 - second;
    Choice {
        action: best.0,
        margin: if margin.is_finite() { margin } else { 0.0 },
    }
}
