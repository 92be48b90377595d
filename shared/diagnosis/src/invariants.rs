//! What the diagnosis guarantees of itself, whatever its input says.
//!
//! Input is checked and refused before it reaches a filter: by the border, the frame guard and the
//! readers of blocks. What is asserted here can therefore fail only by a defect of this crate or of
//! the filters below it. Such a process must end: a belief that contradicts itself is worse than
//! none, and without a valid action the robot stops. Each function states one guarantee; a test
//! below breaks it.

use vigil_blocks::{FAULT_NODES, FaultBelief, FaultSet, MODE_BLIND, MODE_MULTIPLE, MODE_UNKNOWN};

/// Sums of probabilities may exceed one by rounding: of thousands of terms at 1e-16 each. Smaller
/// would end a sound process, and every real defect is larger.
const ROUNDING: f64 = 1e-9;

/// Probability, at most, of sets without a leaf in the tree. The fusion with gyro and currents may
/// leave the others 1e-9 of what they had (`further::RATIO_MAX`); beside that, the floor of 25 such
/// sets (`set_probabilities::FLOOR`) is 2.5 %.
const UNNAMED: f64 = 0.03;

/// The detector's log-odds are finite: of the fault and of each channel.
#[track_caller]
pub(crate) fn finite_log_odds(log_odds: f64, channels: &[f64]) {
    let is_finite = channels.iter().all(|log_odds| log_odds.is_finite());
    assert!(
        log_odds.is_finite() && is_finite,
        "log-odds are finite: {log_odds}, channels {channels:?}"
    );
}

/// `p` is a probability.
#[track_caller]
pub(crate) fn probability(p: f64) {
    assert!(is_probability(p), "a probability is within [0, 1]: {p}");
}

fn is_probability(p: f64) -> bool {
    (0.0..=1.0 + ROUNDING).contains(&p)
}

/// The probabilities of all alternatives sum to one.
#[track_caller]
pub(crate) fn sums_to_one(p: impl Iterator<Item = f64>) {
    let sum: f64 = p.sum();
    assert!(
        (sum - 1.0).abs() <= ROUNDING,
        "probabilities of all alternatives sum to one: {sum}"
    );
}

/// An alarm has an onset exactly while it stands.
#[track_caller]
pub(crate) fn alarm_onset(stands: bool, onset_ns: u64) {
    assert!(
        stands == (onset_ns != 0),
        "an alarm has an onset while it stands, and only then: {stands}, {onset_ns} ns"
    );
}

/// The count of alarms never falls, and grows by one at most in a step.
#[track_caller]
pub(crate) fn alarm_count(before: u32, after: u32) {
    assert!(
        after == before || after == before.saturating_add(1),
        "the alarm count grows by one at most and never falls: {before}, then {after}"
    );
}

/// No onset lies after the newest observation.
#[track_caller]
pub(crate) fn onset(onset_ns: u64, newest_ns: u64) {
    assert!(
        onset_ns <= newest_ns,
        "an onset is never after now: {onset_ns} ns at {newest_ns} ns"
    );
}

/// Place of an observation in time, as the ring keeps it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RingPlace {
    /// The run that it belongs to.
    pub run_id: u64,
    /// When it ended, ns.
    pub t_ns: u64,
    /// True if the pose starts anew with it, as after a clock that was set back.
    pub anchor: bool,
}

/// The ring holds observations of one run, in the order of their times. Only one with which the
/// pose starts anew may be older than the one before.
#[track_caller]
pub(crate) fn ring_order(last: RingPlace, next: RingPlace) {
    let is_later = next.t_ns > last.t_ns || next.anchor;
    assert!(
        last.run_id == next.run_id && is_later,
        "the ring holds one run in the order of time: {next:?} after {last:?}"
    );
}

/// There are never more than `capacity`.
#[track_caller]
pub(crate) fn within_capacity(count: usize, capacity: usize) {
    assert!(
        count <= capacity,
        "no more are kept than the capacity: {count} of {capacity}"
    );
}

/// An identification starts with the pose that was handed over, bit for bit.
#[track_caller]
pub(crate) fn start(handed_over: [f64; 3], start: [f64; 3]) {
    assert!(
        handed_over.map(f64::to_bits) == start.map(f64::to_bits),
        "an identification starts at the pose handed over: {start:?}, not {handed_over:?}"
    );
}

/// Log-weights of hypotheses are probabilities of exclusive alternatives: their sum is one, or
/// less where a budget has dropped some.
#[track_caller]
pub(crate) fn hypothesis_weights(log_weights: impl Iterator<Item = f64>) {
    let sum: f64 = log_weights.map(f64::exp).sum();
    assert!(
        sum > 0.0 && sum <= 1.0 + ROUNDING,
        "probabilities of hypotheses sum to one at most: {sum}"
    );
}

/// All that holds of a belief over a tree with these leaves, as it is published.
#[track_caller]
pub(crate) fn fault_belief(belief: &FaultBelief, leaves: impl Iterator<Item = usize> + Clone) {
    nodes(&belief.p, belief.p_unknown, leaves.clone());
    nodes(
        &belief.p_predicted,
        belief.p_unknown_predicted,
        leaves.clone(),
    );
    probability(belief.p_mode);
    sets(belief.sets.get(..belief.set_count as usize).unwrap_or(&[]));
    entropy(belief.entropy, leaves.count());
    name(belief.mode, belief.node_count as usize);
    name(belief.reported, belief.node_count as usize);
}

/// Nodes and unknown of a belief, present or predicted, over a tree with these leaves.
#[track_caller]
pub(crate) fn nodes(p: &[f64; FAULT_NODES], unknown: f64, leaves: impl Iterator<Item = usize>) {
    assert!(
        p.iter().chain([&unknown]).all(|&p| is_probability(p)),
        "the probability of each node is within [0, 1]: {p:?}, unknown {unknown}"
    );
    // A leaf counts in every set that holds it, so that leaves may overlap and exceed what is left.
    let faults: f64 = leaves.map(|leaf| p[leaf]).sum();
    let apart = p[0] + unknown;
    assert!(
        apart <= 1.0 + ROUNDING && apart + faults >= 1.0 - UNNAMED,
        "nominal, faults and unknown account for one: {}, {faults}, {unknown}",
        p[0]
    );
}

/// The reported sets exclude each other and come in falling order.
#[track_caller]
pub(crate) fn sets(sets: &[FaultSet]) {
    let sum: f64 = sets.iter().map(|set| set.p).sum();
    assert!(
        sum <= 1.0 + ROUNDING && sets.is_sorted_by(|a, b| a.p >= b.p),
        "exact sets sum to one at most, the most probable first: {sets:?}"
    );
}

/// The entropy of a belief over the sets of so many leaves, and the unknown.
#[track_caller]
pub(crate) fn entropy(entropy: f64, leaves: usize) {
    // 2^leaves sets and the unknown are 2^(leaves + 1) alternatives at most.
    let most = (leaves + 1) as f64 * std::f64::consts::LN_2;
    assert!(
        (0.0..=most + ROUNDING).contains(&entropy),
        "entropy is within [0, ln n]: {entropy} of {most}"
    );
}

/// A reported name is a node of the tree, or one of the words that stand for none.
#[track_caller]
pub(crate) fn name(name: u32, nodes: usize) {
    let is_word = [MODE_UNKNOWN, MODE_MULTIPLE, MODE_BLIND].contains(&name);
    assert!(
        is_word || (name as usize) < nodes.max(1),
        "a reported name is a node of the tree: {name} of {nodes}"
    );
}

/// What holds a belief, blindness or an entry without a frame, changes none of its probabilities.
#[track_caller]
pub(crate) fn held(before: &[f64; FAULT_NODES], after: &[f64; FAULT_NODES]) {
    assert!(
        before.map(f64::to_bits) == after.map(f64::to_bits),
        "a held belief keeps its probabilities"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "log-odds are finite")]
    fn log_odds_of_a_channel_that_are_not_finite_are_refused() {
        finite_log_odds(-9.0, &[0.0, -3.0]);
        finite_log_odds(-9.0, &[0.0, f64::NAN]);
    }

    #[test]
    #[should_panic(expected = "log-odds are finite")]
    fn log_odds_of_a_fault_that_are_not_finite_are_refused() {
        finite_log_odds(f64::INFINITY, &[]);
    }

    #[test]
    #[should_panic(expected = "a probability is within [0, 1]")]
    fn a_probability_above_one_is_refused() {
        probability(0.0);
        probability(1.0);
        probability(1.0 + 2.0 * ROUNDING);
    }

    #[test]
    #[should_panic(expected = "a probability is within [0, 1]")]
    fn a_probability_below_zero_is_refused() {
        probability(-1e-300);
    }

    #[test]
    #[should_panic(expected = "sum to one")]
    fn alternatives_that_leave_some_out_are_refused() {
        sums_to_one([0.25, 0.75].into_iter());
        sums_to_one([0.25, 0.74].into_iter());
    }

    #[test]
    #[should_panic(expected = "an alarm has an onset")]
    fn an_alarm_without_an_onset_is_refused() {
        alarm_onset(true, 1);
        alarm_onset(false, 0);
        alarm_onset(true, 0);
    }

    #[test]
    #[should_panic(expected = "an alarm has an onset")]
    fn an_onset_without_an_alarm_is_refused() {
        alarm_onset(false, 1);
    }

    #[test]
    #[should_panic(expected = "the alarm count")]
    fn an_alarm_count_that_falls_is_refused() {
        alarm_count(2, 2);
        alarm_count(2, 3);
        alarm_count(u32::MAX, u32::MAX);
        alarm_count(2, 1);
    }

    #[test]
    #[should_panic(expected = "the alarm count")]
    fn two_alarms_in_one_step_are_refused() {
        alarm_count(2, 4);
    }

    #[test]
    #[should_panic(expected = "never after now")]
    fn an_onset_in_the_future_is_refused() {
        onset(7, 7);
        onset(8, 7);
    }

    const PLACE: RingPlace = RingPlace {
        run_id: 1,
        t_ns: 50,
        anchor: false,
    };

    #[test]
    #[should_panic(expected = "the ring holds one run")]
    fn an_observation_of_another_run_is_refused() {
        ring_order(PLACE, RingPlace { t_ns: 51, ..PLACE });
        let next = RingPlace {
            run_id: 2,
            t_ns: 51,
            ..PLACE
        };
        ring_order(PLACE, next);
    }

    #[test]
    #[should_panic(expected = "the ring holds one run")]
    fn an_observation_that_is_not_newer_is_refused_unless_the_pose_starts_anew() {
        let anchor = RingPlace {
            anchor: true,
            t_ns: 1,
            ..PLACE
        };
        ring_order(PLACE, anchor);
        ring_order(PLACE, PLACE);
    }

    #[test]
    #[should_panic(expected = "no more are kept than the capacity")]
    fn one_more_than_the_capacity_is_refused() {
        within_capacity(3, 3);
        within_capacity(4, 3);
    }

    #[test]
    #[should_panic(expected = "starts at the pose handed over")]
    fn a_start_elsewhere_is_refused() {
        start([1.0, 2.0, f64::NAN], [1.0, 2.0, f64::NAN]);
        start([1.0, 2.0, 0.0], [1.0, 2.0, -0.0]);
    }

    #[test]
    #[should_panic(expected = "hypotheses sum to one at most")]
    fn hypotheses_that_are_counted_twice_are_refused() {
        hypothesis_weights([0.5_f64.ln(), 0.5_f64.ln()].into_iter());
        hypothesis_weights([0.2_f64.ln()].into_iter());
        hypothesis_weights([0.5_f64.ln(), 0.51_f64.ln()].into_iter());
    }

    #[test]
    #[should_panic(expected = "hypotheses sum to one at most")]
    fn no_hypothesis_at_all_is_refused() {
        hypothesis_weights([f64::NEG_INFINITY].into_iter());
    }

    /// Nominal, leaves 1 and 2.
    fn belief(p: [f64; 3]) -> [f64; FAULT_NODES] {
        let mut nodes = [0.0; FAULT_NODES];
        nodes[..3].copy_from_slice(&p);
        nodes
    }

    #[test]
    #[should_panic(expected = "the probability of each node")]
    fn a_node_above_one_is_refused() {
        // Both leaves at once, with .7.
        nodes(&belief([0.1, 0.8, 0.8]), 0.0, 1..3);
        nodes(&belief([0.1, 1.1, 0.0]), 0.0, 1..3);
    }

    #[test]
    #[should_panic(expected = "account for one")]
    fn a_belief_that_leaves_some_out_is_refused() {
        nodes(&belief([0.5, 0.2, 0.2]), 0.1, 1..3);
        nodes(&belief([0.5, 0.2, 0.2]), 0.05, 1..3);
    }

    #[test]
    #[should_panic(expected = "account for one")]
    fn a_belief_in_nominal_and_unknown_above_one_is_refused() {
        nodes(&belief([0.6, 0.0, 0.0]), 0.41, 1..3);
    }

    fn set(p: f64) -> FaultSet {
        FaultSet { leaves: 2, p }
    }

    #[test]
    #[should_panic(expected = "exact sets sum to one at most")]
    fn sets_above_one_are_refused() {
        sets(&[set(0.6), set(0.4)]);
        sets(&[set(0.6), set(0.41)]);
    }

    #[test]
    #[should_panic(expected = "exact sets sum to one at most")]
    fn sets_in_another_order_are_refused() {
        sets(&[set(0.3), set(0.4)]);
    }

    #[test]
    #[should_panic(expected = "entropy is within")]
    fn an_entropy_beyond_that_of_even_odds_is_refused() {
        entropy(0.0, 0);
        entropy(2.0_f64.ln(), 0);
        entropy(8.0_f64.ln(), 2);
        entropy(8.0_f64.ln() + 1e-6, 2);
    }

    #[test]
    #[should_panic(expected = "entropy is within")]
    fn an_entropy_below_zero_is_refused() {
        entropy(-1e-6, 2);
    }

    #[test]
    #[should_panic(expected = "a reported name is a node")]
    fn a_name_beyond_the_tree_is_refused() {
        for sound in [0, 4, MODE_UNKNOWN, MODE_MULTIPLE, MODE_BLIND] {
            name(sound, 5);
        }
        name(5, 5);
    }

    #[test]
    #[should_panic(expected = "a held belief keeps its probabilities")]
    fn a_held_belief_that_moves_is_refused() {
        let before = belief([0.5, 0.5, 0.0]);
        held(&before, &before);
        held(&before, &belief([0.5, 0.5, 1e-17]));
    }
}
