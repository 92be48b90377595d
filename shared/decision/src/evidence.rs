//! Soft evidence from the identifier, each piece used once.
//!
//! The likelihood of a node is its probability divided by its predicted probability: what this
//! cycle's data said, without what the identifier believed before. The identifier speaks every
//! cycle and decisions are slower, so the logarithms are summed over the cycles of an epoch. This
//! is the more robust of the two known forms: tracking anew from a flat prior each epoch would
//! throw away what the decision model itself knows (which faults mend, and how fast).
//!
//! When the identifier changes what it reports about (it begins to identify, returns to watching,
//! names another mode), its belief is taken over as it is: quotients across such a change mean
//! little, and rounding in long products must not make the two beliefs drift apart. For the same
//! reason it is taken over when the tracked belief has drifted from it: products lose what lost
//! diagnoses carried, and a fault that the decision model expects to mend must not fade while the
//! robot stands still and shows nothing. Clearing needs evidence, and the identifier has it.
//!
//! States exclude each other, faults do not: what is taken over goes by the identifier's exact sets
//! of faults. A set of several is the state SEVERAL. In a model without that state a set of one
//! stuck wheel, whatever encoders are broken with it, is the state of that wheel, a set of encoders
//! is shared among them, and a set of two or more stuck wheels is UNKNOWN: the yaw of one wheel
//! alone is not what the robot does, and counter-steering for it would lead off the path. What the
//! sets that are reported leave of a leaf's probability counts for the leaf. States that stand for
//! the same (UNKNOWN and UNKNOWN_OLD) share its probability as they did before: the identifier says
//! nothing of a fault's age, the decision model's transitions do. What has no name is nothing
//! before the fused alarm: the odds of a departure wander on a healthy robot too, and the alarm
//! alone is calibrated. From the alarm on it is what the identifier says. Quotients are of single
//! leaves, and the drift from the sets, which is looked at in each epoch, bounds what they may say
//! about several.

use vigil_blocks::{DECISION_STATES, FaultBelief, FaultSet};

use crate::mapping::{StateMeaning, Subject};

/// One cycle can change the odds of a state by this factor at most, as a logarithm. Chosen by hand:
/// e^20 is beyond any odds that a decision turns on, and one wild cycle cannot outweigh an epoch.
pub(crate) const LOG_RATIO_MAX: f64 = 20.0;
/// An epoch can change them by this factor at most. e^-300 is 5e-131: times a belief it is still a
/// normal double, the least of which is 2e-308.
pub(crate) const LOG_EPOCH_MAX: f64 = 300.0;
/// The tracked belief may differ from the identifier's by this much (half the sum of absolute
/// differences); beyond it, it is taken over. Chosen by hand: it changes no value by more than a
/// twentieth of its range. Smaller discards what the decision model knows about mending; larger
/// lets a fault fade that the identifier still holds.
pub(crate) const DRIFT_MAX: f64 = 0.05;
/// A probability may exceed 1 by this much, for rounding. Chosen: far beyond what sums round to.
/// Smaller might refuse sound input; larger might take damaged input.
pub(crate) const P_TOLERANCE: f64 = 1e-6;

/// Evidence gathered since the last epoch.
#[derive(Debug, Clone)]
pub(crate) struct EpochEvidence {
    log_likelihood: [f64; DECISION_STATES],
    /// Probability of several faults in the cycle before: sets have no predicted one.
    several: f64,
    /// Whether the identifier identifies, and whether an alarm stands.
    reports: Option<(u32, bool)>,
    mode_changes: u32,
    writer_epoch: u64,
}

/// What a diagnosis asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Effect {
    /// Wait for the end of the epoch.
    Wait,
    /// The reporting or the reported mode has changed: take the belief over and decide now.
    Anchor,
}

impl EpochEvidence {
    pub(crate) const fn new() -> Self {
        Self {
            log_likelihood: [0.0; DECISION_STATES],
            several: 0.0,
            reports: None,
            mode_changes: 0,
            writer_epoch: 0,
        }
    }

    /// Takes a diagnosis. One from another start of the identifier is taken over: what it
    /// predicted has nothing to do with what was said before.
    pub(crate) fn add(
        &mut self,
        diagnosis: &FaultBelief,
        states: &[StateMeaning],
        alarm: bool,
    ) -> Effect {
        let reports = Some((diagnosis.identifying, alarm));
        let before = std::mem::replace(&mut self.reports, reports);
        let changes = std::mem::replace(&mut self.mode_changes, diagnosis.mode_change_count);
        let writer = std::mem::replace(&mut self.writer_epoch, diagnosis.header.epoch);
        let several = std::mem::replace(&mut self.several, p_several(diagnosis));
        if before != reports
            || changes != diagnosis.mode_change_count
            || writer != diagnosis.header.epoch
        {
            self.clear();
            return Effect::Anchor;
        }
        for (sum, meaning) in self.log_likelihood.iter_mut().zip(states) {
            let (p, predicted) = probabilities(diagnosis, *meaning, alarm);
            let log_ratio = match meaning.subject {
                Subject::Done => -LOG_RATIO_MAX,
                Subject::Several => log_ratio(p, several),
                _ => log_ratio(p, predicted),
            };
            *sum = (*sum + log_ratio).clamp(-LOG_EPOCH_MAX, LOG_EPOCH_MAX);
        }
        Effect::Wait
    }

    /// Writes the likelihoods, the largest being 1, and begins anew.
    pub(crate) fn take(&mut self, likelihood: &mut [f64]) {
        let used = &self.log_likelihood[..likelihood.len()];
        let max = used.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for (out, log) in likelihood.iter_mut().zip(used) {
            *out = (log - max).exp();
        }
        assert_likelihoods(likelihood);
        self.clear();
    }

    /// The next diagnosis is taken over as it is.
    pub(crate) fn forget(&mut self) {
        self.reports = None;
        self.clear();
    }

    fn clear(&mut self) {
        self.log_likelihood.fill(0.0);
    }
}

/// The largest is 1, so that none overflows and some state is left.
pub(crate) fn assert_likelihoods(likelihood: &[f64]) {
    assert!(
        likelihood.iter().all(|l| (0.0..=1.0).contains(l)) && likelihood.contains(&1.0),
        "likelihoods lie between 0 and 1, the largest being 1: {likelihood:?}"
    );
}

/// Probability and predicted probability of a state; without an alarm, the unknown is nominal.
/// Those of several leaves add up, to more than 1 where they may be present together.
fn probabilities(diagnosis: &FaultBelief, meaning: StateMeaning, alarm: bool) -> (f64, f64) {
    let unknown = (diagnosis.p_unknown, diagnosis.p_unknown_predicted);
    match meaning.subject {
        Subject::Unknown if alarm => unknown,
        Subject::Unknown | Subject::Done => (0.0, 0.0),
        Subject::Several => (p_several(diagnosis), 0.0),
        Subject::Others => {
            let leaves = || (0..64).filter(|leaf| meaning.leaves >> leaf & 1 == 1);
            let sum = |p: &[f64]| leaves().filter_map(|leaf| p.get(leaf)).sum();
            (sum(&diagnosis.p), sum(&diagnosis.p_predicted))
        }
        Subject::Node(0) if !alarm => (
            (diagnosis.p[0] + unknown.0).min(1.0),
            (diagnosis.p_predicted[0] + unknown.1).min(1.0),
        ),
        Subject::Node(node) => (
            diagnosis.p.get(node).copied().unwrap_or(0.0),
            diagnosis.p_predicted.get(node).copied().unwrap_or(0.0),
        ),
    }
}

/// ln(p / predicted), bounded; no evidence where it has no meaning.
fn log_ratio(p: f64, predicted: f64) -> f64 {
    let ratio = p / predicted;
    if !(p >= 0.0 && predicted > 0.0 && ratio.is_finite()) {
        return 0.0;
    }
    ratio.ln().clamp(-LOG_RATIO_MAX, LOG_RATIO_MAX)
}

/// Writes the identifier's belief over the decision model's states into `weights`; `belief` is the
/// one before.
pub(crate) fn weights(
    diagnosis: &FaultBelief,
    states: &[StateMeaning],
    alarm: bool,
    belief: &[f64],
    weights: &mut [f64],
) {
    for (weight, meaning) in weights.iter_mut().zip(states) {
        *weight = probabilities(diagnosis, *meaning, alarm).0;
    }
    for set in sets_of_several(diagnosis) {
        divide(set, states, weights);
    }
    share_unknown(states, belief, weights);
}

/// Divides the probability of the unknown among its states as `belief` does; the first has it all
/// where that holds none of it possible.
fn share_unknown(states: &[StateMeaning], belief: &[f64], weights: &mut [f64]) {
    let is_unknown = |meaning: &StateMeaning| meaning.subject == Subject::Unknown;
    let believed = states.iter().zip(belief).filter(|(m, _)| is_unknown(m));
    let sum: f64 = believed.map(|(_, b)| b).sum();
    let mut is_first = true;
    let shares = weights.iter_mut().zip(states).zip(belief);
    for ((weight, _), b) in shares.filter(|((_, m), _)| is_unknown(m)) {
        *weight *= match (sum > 0.0, is_first) {
            (true, _) => b / sum,
            (false, true) => 1.0,
            (false, false) => 0.0,
        };
        is_first = false;
    }
}

/// Sets in use of two faults or more.
fn sets_of_several(diagnosis: &FaultBelief) -> impl Iterator<Item = &FaultSet> {
    reported(diagnosis).filter(|set| set.leaves.count_ones() > 1)
}

fn p_several(diagnosis: &FaultBelief) -> f64 {
    sets_of_several(diagnosis).map(|set| set.p).sum()
}

/// The sets in use.
fn reported(diagnosis: &FaultBelief) -> impl Iterator<Item = &FaultSet> {
    diagnosis.sets.iter().take(diagnosis.set_count as usize)
}

/// Takes the probability of a set of several faults from its leaves, and gives it to the one state
/// that it is.
fn divide(set: &FaultSet, states: &[StateMeaning], weights: &mut [f64]) {
    let is_in = |meaning: &StateMeaning| set.leaves & meaning.leaves != 0;
    if states.iter().any(|m| m.subject == Subject::Several) {
        for (weight, meaning) in weights.iter_mut().zip(states).filter(|(_, m)| is_in(m)) {
            let own = f64::from((set.leaves & meaning.leaves).count_ones());
            *weight = (*weight - own * set.p).max(0.0);
        }
        return;
    }
    let stuck = states.iter().filter(|m| is_in(m) && m.stuck).count();
    let share = match stuck {
        0 => set.p / f64::from(set.leaves.count_ones()),
        _ => 0.0,
    };
    for (weight, meaning) in weights.iter_mut().zip(states) {
        if is_in(meaning) && meaning.subject == Subject::Others {
            // Several leaves of one state: the set counts once.
            let own = f64::from((set.leaves & meaning.leaves).count_ones());
            let kept = if stuck == 0 { own * share } else { 0.0 };
            *weight = (*weight - own * set.p).max(0.0) + kept;
        } else if is_in(meaning) && !(stuck == 1 && meaning.stuck) {
            *weight = (*weight - set.p).max(0.0) + share;
        } else if stuck > 1 && meaning.subject == Subject::Unknown {
            *weight += set.p;
        }
    }
}

/// True if a diagnosis is about the tree with `tree_hash` and gives every state a probability, some
/// state more than 0, and every set a probability.
pub(crate) fn is_sound(diagnosis: &FaultBelief, states: &[StateMeaning], tree_hash: u64) -> bool {
    let mut sum = 0.0;
    for meaning in states {
        let (mut p, mut predicted) = probabilities(diagnosis, *meaning, true);
        if meaning.leaves.count_ones() > 1 {
            (p, predicted) = (p.min(1.0), predicted.min(1.0));
        }
        if ![p, predicted]
            .iter()
            .all(|p| (0.0..=1.0 + P_TOLERANCE).contains(p))
        {
            return false;
        }
        sum += p;
    }
    let sets = reported(diagnosis).all(|set| (0.0..=1.0 + P_TOLERANCE).contains(&set.p));
    sets && sum > 0.0 && diagnosis.tree_hash == tree_hash
}

/// True if `belief` is too far from the identifier's, given as `weights` that need not sum to 1.
pub(crate) fn has_drifted(belief: &[f64], weights: &[f64]) -> bool {
    let sum: f64 = weights.iter().sum();
    let difference = |(b, w): (&f64, &f64)| (b - w / sum).abs();
    let distance: f64 = belief.iter().zip(weights).map(difference).sum();
    distance > 2.0 * DRIFT_MAX
}

#[cfg(test)]
mod tests;
