//! The identifier's belief, over the decision model's states.
//!
//! States exclude each other, faults do not: a set of several faults counts once. It belongs to
//! SEVERAL_DRIVABLE if a robot can be driven home with it, and to SEVERAL if not, or if the model
//! does not tell them apart. In a model without these states it belongs to the one that holds all
//! of its leaves, unless an action answers only one of them; else to UNKNOWN. What the sets that
//! are reported leave of a leaf's probability counts for the leaf.
//!
//! An action that is about one wheel answers the most probable one. If another wheel of the same
//! state has the fault, that counts as unknown. All drivable sets share one state: driving home for
//! one answers most of another. A single fault that is less probable than the most probable such
//! set counts for that state, too.
//!
//! The identifier does not say whether evidence still comes: what it says is of settled states.
//! What has no name is nothing before the fused alarm: the odds of a departure wander on a healthy
//! robot too, and the alarm alone is calibrated.

use vigil_blocks::{FaultBelief, FaultSet};

use crate::alarm_fusion::Situation;
use crate::answerable::AnswerableFaults;
use crate::states::{StateMeaning, Subject};

/// A probability may exceed 1 by this much, for rounding. Chosen: far beyond what sums round to.
/// Smaller might refuse sound input; larger might take damaged input.
pub(crate) const P_TOLERANCE: f64 = 1e-6;

/// A belief that has moved by more than this since the last decision (half the sum of absolute
/// differences) opens another at once. Chosen by hand: it changes no value by more than a twentieth
/// of its range. Smaller decides in almost every cycle; larger lets a decision wait for its epoch.
pub const MOVED: f64 = 0.05;

/// Less than this changes no decision, whichever state it belongs to.
const NEGLIGIBLE: f64 = 1e-6;

/// A diagnosis says at least this much in all; a sound one sums to 1 or more.
const P_SUM_MIN: f64 = 0.5;

/// Writes the identifier's belief over the states into `weights`, which need not sum to 1.
pub(crate) fn write_weights(
    diagnosis: &FaultBelief,
    states: &[StateMeaning],
    answerable: &AnswerableFaults,
    alarm: bool,
    weights: &mut [f64],
) {
    for (weight, meaning) in weights.iter_mut().zip(states) {
        *weight = probability(diagnosis, *meaning, alarm);
    }
    let several = position(states, Subject::Several);
    let driven = position(states, Subject::Drivable);
    for set in sets_of_several(diagnosis) {
        let driven = driven.filter(|_| answerable.are_drivable(set.leaves));
        divide(set, states, driven.or(several), weights);
    }
    let driven =
        driven.and_then(|state| Some((state, most_probable_drivable(diagnosis, answerable)?)));
    let (mut unsure, mut driven_too) = (0.0, 0.0);
    for (weight, meaning) in weights.iter_mut().zip(states) {
        let is_divided = meaning.subject == Subject::Fault && *weight > NEGLIGIBLE;
        if is_divided && answerable.are_singles(meaning.leaves) {
            let part = AnsweredPart::new(diagnosis, *meaning, driven.map(|(_, set)| set));
            let answered = part.answered.min(*weight);
            let also = part.driven_too.min(*weight - answered);
            unsure += *weight - answered - also;
            driven_too += also;
            *weight = answered;
        }
    }
    for (state, more) in [
        (position(states, Subject::Unknown), unsure),
        (driven.map(|(state, _)| state), driven_too),
    ] {
        if let Some(weight) = state.and_then(|state| weights.get_mut(state)) {
            *weight += more;
        }
    }
}

/// The same while no identifier is heard: the detector says how probable a fault is, the belief
/// before which one, and without that it is unknown. Before an alarm the detector's odds mean
/// nothing.
pub(crate) fn write_fallback(
    situation: Situation,
    states: &[StateMeaning],
    before: &[f64],
    weights: &mut [f64],
) {
    let is_fault =
        |meaning: &StateMeaning| !matches!(meaning.subject, Subject::Nominal | Subject::Done);
    let of_faults = before.iter().zip(states).filter(|(_, m)| is_fault(m));
    let faulty: f64 = of_faults.map(|(b, _)| b).sum();
    // A detector that has just raised an alarm of its own may hold a fault for less probable than
    // what was known: that stands while another identifier is waited for.
    let p_fault = match (situation.alarm, situation.hearing.waits()) {
        (true, true) => situation.p_fault.clamp(faulty.min(1.0), 1.0),
        (true, false) => situation.p_fault.clamp(0.0, 1.0),
        (false, _) => 0.0,
    };
    let unknown = position(states, Subject::Unknown);
    let weights = weights.iter_mut().enumerate();
    for (((state, weight), b), meaning) in weights.zip(before).zip(states) {
        *weight = match meaning.subject {
            Subject::Nominal if meaning.settles_to.is_some() => 0.0,
            Subject::Nominal => 1.0 - p_fault,
            Subject::Done => 0.0,
            _ if faulty > MOVED => p_fault * (b / faulty),
            _ if Some(state) == unknown => p_fault,
            _ => 0.0,
        };
    }
}

/// Makes weights sum to 1. Some is more than 0: a diagnosis that has none is not sound.
pub(crate) fn normalise(weights: &mut [f64]) {
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|weight| *weight /= sum);
}

/// Half the sum of absolute differences.
pub(crate) fn distance(one: &[f64], other: &[f64]) -> f64 {
    let differences = one.iter().zip(other).map(|(a, b)| (a - b).abs());
    0.5 * differences.sum::<f64>()
}

/// The settled state of a subject that has only one.
pub(crate) fn position(states: &[StateMeaning], subject: Subject) -> Option<usize> {
    let is_it = |meaning: &StateMeaning| meaning.subject == subject && meaning.settles_to.is_none();
    states.iter().position(is_it)
}

/// Probability of a state; without an alarm, the unknown is nominal. Those of leaves add up, to
/// more than 1 where they may be present together.
fn probability(diagnosis: &FaultBelief, meaning: StateMeaning, alarm: bool) -> f64 {
    match meaning.subject {
        _ if meaning.settles_to.is_some() => 0.0,
        Subject::Unknown if alarm => diagnosis.p_unknown,
        Subject::Nominal if !alarm => (diagnosis.p[0] + diagnosis.p_unknown).min(1.0),
        Subject::Nominal => diagnosis.p[0],
        Subject::Fault => leaves(diagnosis, meaning).map(|(_, p)| p).sum(),
        Subject::Unknown | Subject::Several | Subject::Drivable | Subject::Done => 0.0,
    }
}

/// A state's leaves, and their probabilities.
fn leaves(diagnosis: &FaultBelief, meaning: StateMeaning) -> impl Iterator<Item = (usize, f64)> {
    let all = diagnosis.p.iter().copied().enumerate();
    all.filter(move |(leaf, _)| meaning.leaves >> leaf & 1 == 1)
}

/// Takes the probability of a set of several faults from its leaves, and gives it to the one state
/// that it is.
fn divide(set: &FaultSet, states: &[StateMeaning], several: Option<usize>, weights: &mut [f64]) {
    for (weight, meaning) in weights.iter_mut().zip(states) {
        let own = f64::from((set.leaves & meaning.leaves).count_ones());
        *weight = (*weight - own * set.p).max(0.0);
    }
    let holds =
        |meaning: &StateMeaning| meaning.settles_to.is_none() && set.leaves & !meaning.leaves == 0;
    let state = several
        .or_else(|| states.iter().position(holds))
        .or_else(|| position(states, Subject::Unknown));
    if let Some(weight) = state.and_then(|state| weights.get_mut(state)) {
        *weight += set.p;
    }
}

/// What actions answer of a state whose leaves are answered one at a time. The rest is a fault, but
/// nobody knows of which wheel.
struct AnsweredPart {
    /// By the action that is about one wheel: the most probable leaf.
    answered: f64,
    /// By driving home with the most probable set: leaves of that set that are less probable alone.
    driven_too: f64,
}

impl AnsweredPart {
    fn new(diagnosis: &FaultBelief, meaning: StateMeaning, driven: Option<&FaultSet>) -> Self {
        let mut part = Self {
            answered: 0.0,
            driven_too: 0.0,
        };
        for (leaf, p) in leaves(diagnosis, meaning) {
            let p = alone(diagnosis, leaf, p);
            match driven {
                Some(set) if set.leaves >> leaf & 1 == 1 && set.p > p => part.driven_too += p,
                _ => part.answered = part.answered.max(p),
            }
        }
        part
    }
}

/// The most probable of the sets that an action can answer as one.
fn most_probable_drivable<'a>(
    diagnosis: &'a FaultBelief,
    answerable: &AnswerableFaults,
) -> Option<&'a FaultSet> {
    let drivable = sets_of_several(diagnosis).filter(|set| answerable.are_drivable(set.leaves));
    drivable.reduce(|best, set| if set.p > best.p { set } else { best })
}

/// What the sets that are reported leave of a leaf's probability.
fn alone(diagnosis: &FaultBelief, leaf: usize, p: f64) -> f64 {
    let holds = |set: &&FaultSet| set.leaves >> leaf & 1 == 1;
    let in_sets: f64 = sets_of_several(diagnosis)
        .filter(holds)
        .map(|set| set.p)
        .sum();
    (p - in_sets).max(0.0)
}

/// Sets in use of two faults or more.
fn sets_of_several(diagnosis: &FaultBelief) -> impl Iterator<Item = &FaultSet> {
    reported(diagnosis).filter(|set| set.leaves.count_ones() > 1)
}

/// The sets in use.
fn reported(diagnosis: &FaultBelief) -> impl Iterator<Item = &FaultSet> {
    diagnosis.sets.iter().take(diagnosis.set_count as usize)
}

/// True if a diagnosis is about the tree with `tree_hash`, and what it says of every state and set
/// are probabilities, together those of something.
pub(crate) fn is_sound(diagnosis: &FaultBelief, states: &[StateMeaning], tree_hash: u64) -> bool {
    let is_probability = |p: f64| (0.0..=1.0 + P_TOLERANCE).contains(&p);
    let own = [diagnosis.p[0], diagnosis.p_unknown];
    let of_leaves = states
        .iter()
        .flat_map(|meaning| leaves(diagnosis, *meaning))
        .map(|(_, p)| p);
    let of_sets = reported(diagnosis).map(|set| set.p);
    let are_probabilities = own
        .into_iter()
        .chain(of_leaves)
        .chain(of_sets)
        .all(is_probability);
    let sum: f64 = states
        .iter()
        .map(|m| probability(diagnosis, *m, true))
        .sum();
    are_probabilities && sum >= P_SUM_MIN && diagnosis.tree_hash == tree_hash
}

#[cfg(test)]
mod tests;
