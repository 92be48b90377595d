//! Policies: from a belief to an action. Definitions: Verma, Fernandez, Simmons (2002), section 2.

mod most_likely_state;
mod point_based;
mod qmdp;
mod voting;

pub use most_likely_state::MostLikelyState;
pub use point_based::PointBased;
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

/// A policy over beliefs. Deciding allocates nothing.
pub trait Policy {
    /// Writes the value (or votes) of every action into `values`, and chooses. Ties go to the
    /// lowest index.
    fn evaluate(&self, belief: &[f64], values: &mut [f64]) -> Choice;
}

/// Values within this much of the largest, relative to it (at least to 1), are a tie.
const TIE: f64 = 1e-9;

/// The largest value; ties (within 1e-9 of the largest value or of 1, whichever is larger) go to
/// the lowest index, so that rounding never decides. Values that are NaN are passed over.
#[must_use]
pub fn choose(values: &[f64]) -> Choice {
    choose_among(values, |_| true)
}

/// As [`choose`], among the actions that are `allowed`; the margin is to the best of the others
/// that are. Action 0 if none is.
#[must_use]
pub fn choose_among(values: &[f64], allowed: impl Fn(usize) -> bool) -> Choice {
    let candidates = || {
        values
            .iter()
            .copied()
            .enumerate()
            .filter(|&(action, _)| allowed(action))
    };
    let largest = |besides: Option<usize>| {
        candidates()
            .filter(|&(action, _)| Some(action) != besides)
            .fold(f64::NEG_INFINITY, |max, (_, value)| max.max(value))
    };
    let best = largest(None);
    let least = best - TIE * best.abs().max(1.0);
    let action = candidates().find(|&(_, value)| value >= least);
    let action = action.map_or(0, |(action, _)| action);
    // Below 0 only by what still counts as a tie.
    let margin = (best - largest(Some(action))).max(0.0);
    Choice {
        action,
        margin: if margin.is_finite() { margin } else { 0.0 },
    }
}
