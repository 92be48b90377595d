//! Policies: from a belief to an action. Definitions: Verma, Fernandez, Simmons (2002), section 2.
//!
//! | name | rule |
//! |---|---|
//! | `mls` | [`MostLikelyState`]: pi_CO(argmax_s b(s)) |
//! | `av` | [`ActionVoting`]: argmax_a w(a), w(a) = sum_s b(s) [pi_CO(s) = a] |
//! | `qmdp` | [`QMdp`]: argmax_a sum_s b(s) Q_CO(s,a) |
//! | `point-based` | [`PointBased`]: the action of argmax_alpha alpha . b, solved beforehand |
//! | `fib` | [`FastInformed`]: argmax_a b . q_a, q from the fast informed bound |
//! | `despot` | [`Despot`]: the first action of the best plan that a search has found so far |
//! | `dm-X`, `adm-X` | [`DualControl`]: X while the belief is certain enough, else information |
//!
//! pi_CO and Q_CO are those of the fully observable relaxation, [`crate::mdp`].
//!
//! **Ties** decide results (a tiger's start belief is one), hence one rule for all: whatever is
//! within 1e-9 of the best, relative to the best or to 1, is as good as the best. Of these actions
//! the one with the most votes ([`Votes`]) wins, and of equal votes, by the same tolerance, the
//! lowest index. A state votes by pi_CO; under `fib` and `point-based` by the policy's own values
//! where the state is certain. A state's own ties go to the lowest index. The margin to the
//! runner-up is part of every choice, so that a tie is visible.
//!
//! A [`Decider`] adds to a policy what a record needs to explain a decision: the votes and both
//! entropies.

mod completion;
mod decider;
mod despot;
mod dual;
mod entropy;
mod fast_informed;
mod look_ahead;
mod most_likely_state;
mod name;
mod point_based;
mod qmdp;
mod votes;
mod voting;

pub use decider::{Decider, Decision};
pub use despot::{Despot, DespotError, DespotOptions};
pub use dual::{Dual, DualControl, DualError, Gate, Information};
pub use entropy::normalised_entropy;
pub use fast_informed::FastInformed;
pub use look_ahead::LookAhead;
pub use most_likely_state::MostLikelyState;
pub use name::{Base, BuildError, KindError, NameError, PolicyKind, PolicyName};
pub use point_based::PointBased;
pub use qmdp::QMdp;
pub use votes::Votes;
pub use voting::ActionVoting;

/// What an action was chosen for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// For its worth.
    Policy,
    /// To gather information (dual control).
    Dual,
    /// For its worth, although the belief is uncertain: gathering information has stalled.
    Stalled,
}

/// A chosen action.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Index of the action.
    pub action: usize,
    /// Its value (or votes) minus the runner-up's; 0 at a tie or with one action.
    pub margin: f64,
    /// What it was chosen for.
    pub control: Control,
}

/// What the numbers are that a policy writes for the actions; of all the larger is the better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// Discounted reward to come: what the policy expects, or earns for certain.
    Value,
    /// How much of the belief speaks for the action, 0 to 1.
    Votes,
    /// The entropy to expect after the action, 0 to 1, negative.
    Entropy,
}

/// A policy over beliefs. Deciding allocates nothing. `Send`, so that it may be built on one thread
/// and decide on another.
pub trait Policy: Send {
    /// Writes the value (or votes) of every action into `values`, and chooses; of two actions the
    /// one with the larger value is the better in the policy's eyes. `belief` holds one probability
    /// a state and sums to 1, `values` has one place an action.
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice;

    /// What the values are, in a step that is not for information.
    fn measure(&self) -> Measure {
        Measure::Value
    }

    /// Spends a share of spare time on `belief`: later decisions about it may be better. Allocates
    /// nothing; most policies have nothing to improve.
    fn improve(&mut self, _belief: &[f64]) {}

    /// Forgets what it remembers of earlier decisions: a new mission begins.
    fn reset(&mut self) {}

    /// Gives away what it remembers as numbers. Most policies remember nothing.
    fn keep(&self, _put: &mut dyn FnMut(f64)) {}

    /// Goes on from what [`Policy::keep`] gave away under the same model and settings.
    fn resume(&mut self, _take: &mut dyn FnMut() -> f64) {}
}

/// Values within this much of the largest, relative to it (at least to 1), are a tie. Chosen by
/// hand, far above what rounding leaves of equal values (about 1e-13) and far below any difference
/// of rewards that somebody would write into a model.
const TIE: f64 = 1e-9;

/// The largest value; ties (within 1e-9 of the largest value or of 1, whichever is larger) go to
/// the most `votes` (none that is missing), then to the lowest index, so that rounding never
/// decides. Values that are NaN are passed over.
#[must_use]
pub fn choose(values: &[f64], votes: &[f64]) -> Choice {
    choose_among(values, votes, |_| true)
}

/// As [`choose`], among the actions that are `allowed`; the margin is to the best of the others
/// that are. Action 0 if none is.
#[must_use]
pub fn choose_among(values: &[f64], votes: &[f64], allowed: impl Fn(usize) -> bool) -> Choice {
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
    let least = least_of_best(best);
    let tied = || candidates().filter(|&(_, value)| value >= least);
    let votes = |action: usize| votes.get(action).copied().unwrap_or(0.0);
    let most = tied().fold(f64::NEG_INFINITY, |max, (action, _)| max.max(votes(action)));
    let action = tied().find(|&(action, _)| votes(action) >= least_of_best(most));
    let action = action.map_or(0, |(action, _)| action);
    assert_best(values, action, best);
    // Below 0 only by what still counts as a tie.
    let margin = (best - largest(Some(action))).max(0.0);
    Choice {
        action,
        margin: if margin.is_finite() { margin } else { 0.0 },
        control: Control::Policy,
    }
}

/// The least value that is as good as `best`.
const fn least_of_best(best: f64) -> f64 {
    if best.is_finite() {
        best - TIE * best.abs().max(1.0)
    } else {
        best
    }
}

/// What every policy claims: nothing that is allowed is worth more than what it chooses. Without
/// anything to choose from `best` is minus infinity, and nothing is claimed.
fn assert_best(values: &[f64], action: usize, best: f64) {
    let value = values.get(action).copied().unwrap_or(f64::NEG_INFINITY);
    assert!(
        best == f64::NEG_INFINITY || value >= least_of_best(best),
        "the action chosen has the largest value of those allowed: {value} of {best}"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn infinite_values_are_chosen_among_too() {
        let chosen = |values: &[f64]| (choose(values, &[]).action, choose(values, &[]).margin);
        assert_eq!(chosen(&[1.0, f64::INFINITY]), (1, 0.0));
        assert_eq!(chosen(&[f64::NAN, f64::NEG_INFINITY]), (1, 0.0));
        assert_eq!(chosen(&[f64::NAN, f64::NAN]), (0, 0.0));
    }

    #[test]
    fn votes_decide_among_equal_values_alone() {
        let votes = [0.1, 0.2, 0.2 + 1e-10, 0.9];
        assert_eq!(choose(&[5.0, 5.0, 5.0, 4.9], &votes).action, 1);
        assert_eq!(choose(&[5.0, 4.9, 5.0 - 1e-9, 4.9], &votes).action, 2);
        assert_eq!(choose(&[5.0, 4.9, 5.0 - 1e-8, 4.9], &votes).action, 0);
        assert_eq!(choose_among(&[5.0; 4], &votes, |a| a < 3).action, 1);
        assert_eq!(choose(&[5.0; 4], &[]).action, 0);
        assert_eq!(choose(&[5.0; 2], &[f64::NAN; 2]).action, 0);
    }

    #[test]
    #[should_panic(expected = "largest value of those allowed: 1 of 2")]
    fn a_choice_below_the_best_is_caught() {
        assert_best(&[1.0, 2.0], 1, 2.0);
        assert_best(&[1.0, 2.0], 0, 2.0);
    }
}
