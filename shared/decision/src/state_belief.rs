//! The identifier's belief, over the decision model's states.
//!
//! States exclude each other, faults do not: a set of several faults counts once. It belongs to
//! SEVERAL_DRIVABLE if a robot can be driven home with it, and to SEVERAL if not, or if the model
//! does not tell them apart. In a model without these states it belongs to the one that holds all
//! of its leaves; else to UNKNOWN. What the sets that are reported leave of a leaf's probability
//! counts for the leaf.
//!
//! States that stand for the same (UNKNOWN and UNKNOWN_OLD) share its probability as the predicted
//! belief does: the identifier says nothing of a fault's age, the decision model's transitions do.
//! What has no name is nothing before the fused alarm: the odds of a departure wander on a healthy
//! robot too, and the alarm alone is calibrated.

use vigil_blocks::{DetectionBelief, FaultBelief, FaultSet};

use crate::drivable::DrivableSets;
use crate::states::{StateMeaning, Subject};

/// A probability may exceed 1 by this much, for rounding. Chosen: far beyond what sums round to.
/// Smaller might refuse sound input; larger might take damaged input.
pub(crate) const P_TOLERANCE: f64 = 1e-6;

/// A belief that has moved by more than this since the last decision (half the sum of absolute
/// differences) opens another at once. Chosen by hand: it changes no value by more than a twentieth
/// of its range. Smaller decides in almost every cycle; larger lets a decision wait for its epoch.
pub(crate) const MOVED: f64 = 0.05;

/// A diagnosis says at least this much in all; a sound one sums to 1 or more.
const P_SUM_MIN: f64 = 0.5;

/// Writes the identifier's belief over the states into `weights`, which need not sum to 1;
/// `predicted` is the decision model's own belief.
pub(crate) fn write_weights(
    diagnosis: &FaultBelief,
    states: &[StateMeaning],
    drivable: &DrivableSets,
    alarm: bool,
    predicted: &[f64],
    weights: &mut [f64],
) {
    for (weight, meaning) in weights.iter_mut().zip(states) {
        *weight = probability(diagnosis, *meaning, alarm);
    }
    let several = position(states, Subject::Several);
    let driven = position(states, Subject::Drivable);
    for set in sets_of_several(diagnosis) {
        let driven = driven.filter(|_| drivable.holds(set.leaves));
        divide(set, states, driven.or(several), weights);
    }
    share_unknown(states, predicted, weights);
}

/// The same without an identifier: the detector says how probable a fault is, the belief before
/// the loss which one, and without that it is unknown. Before an alarm the detector's odds mean
/// nothing.
pub(crate) fn write_fallback(
    detection: &DetectionBelief,
    states: &[StateMeaning],
    alarm: bool,
    before: &[f64],
    weights: &mut [f64],
) {
    let p_fault = match alarm {
        true => detection.p_fault.clamp(0.0, 1.0),
        false => 0.0,
    };
    let is_fault =
        |meaning: &StateMeaning| !matches!(meaning.subject, Subject::Nominal | Subject::Done);
    let of_faults = before.iter().zip(states).filter(|(_, m)| is_fault(m));
    let faulty: f64 = of_faults.map(|(b, _)| b).sum();
    let unknown = position(states, Subject::Unknown);
    let weights = weights.iter_mut().enumerate();
    for (((state, weight), b), meaning) in weights.zip(before).zip(states) {
        *weight = match meaning.subject {
            Subject::Nominal => 1.0 - p_fault,
            Subject::Done => 0.0,
            _ if faulty > 0.0 => p_fault * (b / faulty),
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

fn position(states: &[StateMeaning], subject: Subject) -> Option<usize> {
    states.iter().position(|meaning| meaning.subject == subject)
}

/// Probability of a state; without an alarm, the unknown is nominal. Those of leaves add up, to
/// more than 1 where they may be present together.
fn probability(diagnosis: &FaultBelief, meaning: StateMeaning, alarm: bool) -> f64 {
    match meaning.subject {
        Subject::Unknown if alarm => diagnosis.p_unknown,
        Subject::Nominal if !alarm => (diagnosis.p[0] + diagnosis.p_unknown).min(1.0),
        Subject::Nominal => diagnosis.p[0],
        Subject::Fault => leaves(diagnosis, meaning).sum(),
        Subject::Unknown | Subject::Several | Subject::Drivable | Subject::Done => 0.0,
    }
}

fn leaves(diagnosis: &FaultBelief, meaning: StateMeaning) -> impl Iterator<Item = f64> {
    let is_held = move |(leaf, _): &(usize, &f64)| meaning.leaves >> leaf & 1 == 1;
    let found = diagnosis.p.iter().enumerate().filter(is_held);
    found.map(|(_, p)| *p)
}

/// Takes the probability of a set of several faults from its leaves, and gives it to the one state
/// that it is.
fn divide(set: &FaultSet, states: &[StateMeaning], several: Option<usize>, weights: &mut [f64]) {
    for (weight, meaning) in weights.iter_mut().zip(states) {
        let own = f64::from((set.leaves & meaning.leaves).count_ones());
        *weight = (*weight - own * set.p).max(0.0);
    }
    let holds = |meaning: &StateMeaning| set.leaves & !meaning.leaves == 0;
    let state = several
        .or_else(|| states.iter().position(holds))
        .or_else(|| position(states, Subject::Unknown));
    if let Some(weight) = state.and_then(|state| weights.get_mut(state)) {
        *weight += set.p;
    }
}

/// Divides the probability of the unknown among its states as `predicted` does; the first has it
/// all where that holds none of it possible.
fn share_unknown(states: &[StateMeaning], predicted: &[f64], weights: &mut [f64]) {
    let is_unknown = |meaning: &StateMeaning| meaning.subject == Subject::Unknown;
    let of_unknown = || states.iter().zip(predicted).filter(|(m, _)| is_unknown(m));
    let sum: f64 = of_unknown().map(|(_, b)| b).sum();
    let mut weight: f64 = 0.0;
    let shares = weights.iter_mut().zip(states).zip(predicted);
    let shares = shares.filter(|((_, m), _)| is_unknown(m));
    for (at, ((share, _), b)) in shares.enumerate() {
        if at == 0 {
            weight = *share;
        }
        *share = match (sum > 0.0, at) {
            (true, _) => weight * (b / sum),
            (false, 0) => weight,
            (false, _) => 0.0,
        };
    }
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
        .flat_map(|meaning| leaves(diagnosis, *meaning));
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
