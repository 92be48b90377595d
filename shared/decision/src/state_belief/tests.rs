use super::*;

const fn state(node: Option<usize>, stuck: bool) -> StateMeaning {
    StateMeaning {
        subject: match node {
            Some(node) => Subject::Node(node),
            None => Subject::Unknown,
        },
        leaves: match node {
            None | Some(0) => 0,
            Some(node) => match 1_u64.checked_shl(node as u32) {
                Some(bit) => bit,
                None => 0,
            },
        },
        wheel: None,
        stuck,
    }
}

#[test]
fn the_state_of_all_faults_has_the_probability_of_any_of_them() {
    let any = StateMeaning {
        subject: Subject::Others,
        leaves: 0b110,
        ..state(None, false)
    };
    let states = [state(Some(0), false), any, state(None, false)];
    let said = diagnosis(&[0.2, 0.5, 0.4], 0.1);
    let found = weighed_over(&states, said, &[(0b10, 0.3), (0b110, 0.2), (0b100, 0.2)]);
    for (found, expected) in found.into_iter().zip([0.2, 0.7, 0.1]) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

#[test]
fn a_state_of_leaves_that_come_together_counts_each_set_once() {
    let any = StateMeaning {
        subject: Subject::Others,
        leaves: 0b110,
        ..state(None, false)
    };
    let none = StateMeaning { leaves: 0, ..any };
    let states = [state(Some(0), false), any, none, state(None, false)];
    let said = diagnosis(&[0.1, 0.9, 0.6], 0.0);
    let found = weighed_over(&states, said, &[(0b110, 0.6), (0b10, 0.3)]);
    for (found, expected) in found.into_iter().zip([0.1, 0.9, 0.0, 0.0]) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

/// Nominal, two stuck wheels, two encoders, unknown.
const STATES: [StateMeaning; 6] = [
    state(Some(0), false),
    state(Some(1), true),
    state(Some(2), true),
    state(Some(3), false),
    state(Some(4), false),
    state(None, false),
];

fn diagnosis(p: &[f64], p_unknown: f64) -> FaultBelief {
    let mut diagnosis = FaultBelief {
        tree_hash: 7,
        p_unknown,
        p_unknown_predicted: 0.25,
        ..FaultBelief::default()
    };
    diagnosis.p[..p.len()].copy_from_slice(p);
    diagnosis.p_predicted[..5].fill(0.5);
    diagnosis
}

#[test]
fn a_quotient_is_bounded_and_says_nothing_where_it_is_none() {
    assert_eq!(log_ratio(0.5, 0.25), 2.0_f64.ln());
    assert_eq!(log_ratio(0.0, 0.5), -LOG_RATIO_MAX);
    assert_eq!(log_ratio(1.0, 1e-300), LOG_RATIO_MAX);
    for (p, predicted) in [
        (0.5, 0.0),
        (-0.5, 0.5),
        (0.5, -0.5),
        (f64::NAN, 0.5),
        (0.5, f64::NAN),
        (1e300, 1e-300),
    ] {
        assert_eq!(log_ratio(p, predicted), 0.0, "{p} {predicted}");
    }
}

#[test]
fn evidence_sums_over_an_epoch_within_its_bound_and_is_used_once() {
    let mut gathered = EpochEvidence::new();
    let said = diagnosis(&[0.25, 1.0, 0.0, 0.5, 0.5], 0.25);
    assert_eq!(gathered.add(&said, &STATES, true), Effect::Anchor);
    assert_eq!(gathered.add(&said, &STATES, true), Effect::Wait);
    assert_eq!(gathered.add(&said, &STATES, true), Effect::Wait);
    let mut likelihood = [0.0; 6];
    gathered.take(&mut likelihood);
    // Relative to the first wheel, which data favour twice as much as predicted, twice.
    let expected = [1.0 / 16.0, 1.0, (-40.0_f64).exp() / 4.0, 0.25, 0.25, 0.25];
    for (l, e) in likelihood.iter().zip(expected) {
        assert!((l - e).abs() < 1e-12 * e, "{likelihood:?}");
    }
    gathered.take(&mut likelihood);
    assert_eq!(likelihood, [1.0; 6]);
    for _ in 0..100 {
        gathered.add(&said, &STATES, true);
    }
    assert_eq!(gathered.log_likelihood[2], -LOG_EPOCH_MAX);
}

#[test]
fn another_start_mode_or_alarm_of_the_identifier_is_taken_over() {
    let said = diagnosis(&[0.5; 5], 0.25);
    let effect = |change: &dyn Fn(&mut FaultBelief), alarm| {
        let mut gathered = EpochEvidence::new();
        gathered.add(&said, &STATES, true);
        gathered.add(&said, &STATES, true);
        let mut next = said;
        change(&mut next);
        let effect = gathered.add(&next, &STATES, alarm);
        assert!(effect == Effect::Wait || gathered.log_likelihood == [0.0; DECISION_STATES]);
        effect
    };
    assert_eq!(effect(&|_| {}, true), Effect::Wait);
    assert_eq!(effect(&|_| {}, false), Effect::Anchor);
    assert_eq!(effect(&|d| d.identifying = 1, true), Effect::Anchor);
    assert_eq!(effect(&|d| d.mode_change_count = 1, true), Effect::Anchor);
    assert_eq!(effect(&|d| d.header.epoch = 1, true), Effect::Anchor);
    let mut gathered = EpochEvidence::new();
    gathered.add(&said, &STATES, true);
    gathered.forget();
    assert_eq!(gathered.add(&said, &STATES, true), Effect::Anchor);
}

#[test]
fn before_an_alarm_the_unknown_is_nominal() {
    let said = diagnosis(&[0.5, 0.125], 0.375);
    let both = |node, alarm| probabilities(&said, state(node, false), alarm);
    assert_eq!(both(None, true), (0.375, 0.25));
    assert_eq!(both(None, false), (0.0, 0.0));
    assert_eq!(both(Some(0), true), (0.5, 0.5));
    assert_eq!(both(Some(0), false), (0.875, 0.75));
    assert_eq!(both(Some(1), false), (0.125, 0.5));
    assert_eq!(both(Some(10_000), true), (0.0, 0.0));
    let full = diagnosis(&[0.9], 0.9);
    assert_eq!(probabilities(&full, STATES[0], false).0, 1.0);
}

/// Weights where the sets are these: their leaves as bits, their probability.
fn weighed(p: &[f64], sets: &[(u64, f64)]) -> [f64; 6] {
    weighed_over(&STATES, diagnosis(p, 0.0), sets)
}

fn weighed_over<const N: usize>(
    states: &[StateMeaning; N],
    mut said: FaultBelief,
    sets: &[(u64, f64)],
) -> [f64; N] {
    said.set_count = sets.len() as u32;
    for (set, (leaves, p)) in said.sets.iter_mut().zip(sets) {
        (set.leaves, set.p) = (*leaves, *p);
    }
    let mut out = [0.0; N];
    weights(&said, states, true, &[0.0; N], &mut out);
    out
}

#[test]
fn a_set_goes_to_its_stuck_wheel_to_its_encoders_or_to_the_unknown() {
    let single = weighed(&[0.0, 1.0], &[(0b00010, 1.0)]);
    assert_eq!(single, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    let stuck_and_encoder = weighed(&[0.0, 0.75, 0.0, 0.75], &[(0b01010, 0.75)]);
    assert_eq!(stuck_and_encoder, [0.0, 0.75, 0.0, 0.0, 0.0, 0.0]);
    let encoders = weighed(&[0.25, 0.0, 0.0, 0.5, 0.75], &[(0b11000, 0.5)]);
    assert_eq!(encoders, [0.25, 0.0, 0.0, 0.25, 0.5, 0.0]);
    let two_stuck = weighed(&[0.0, 0.75, 0.5], &[(0b00110, 0.5)]);
    assert_eq!(two_stuck, [0.0, 0.25, 0.0, 0.0, 0.0, 0.5]);
}

#[test]
fn a_state_of_several_faults_has_their_sets_whole() {
    let several = StateMeaning {
        subject: Subject::Several,
        ..state(None, false)
    };
    let states = [STATES[0], STATES[1], STATES[3], several];
    let said = diagnosis(&[0.25, 0.5, 0.0, 0.75], 0.0);
    let sets = [(0b01010, 0.5), (0b01000, 0.25)];
    assert_eq!(weighed_over(&states, said, &sets), [0.25, 0.0, 0.25, 0.5]);
    // Their evidence is how their probability changes.
    let cycle = |p| {
        let mut said = said;
        said.set_count = 1;
        (said.sets[0].leaves, said.sets[0].p) = (0b01010, p);
        said
    };
    let mut gathered = EpochEvidence::new();
    for p in [0.125, 0.25, 0.5] {
        gathered.add(&cycle(p), &states, true);
    }
    assert!((gathered.log_likelihood[3] - 4.0_f64.ln()).abs() < 1e-12);
}

#[test]
fn states_of_the_unknown_share_it_as_before_and_the_end_is_never_believed() {
    let done = StateMeaning {
        subject: Subject::Done,
        ..state(None, false)
    };
    let unknown = state(None, false);
    let states = [STATES[0], unknown, unknown, done];
    let said = diagnosis(&[0.5], 0.5);
    for (belief, wanted) in [
        ([0.2, 0.1, 0.3, 0.4], [0.5, 0.125, 0.375, 0.0]),
        ([1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]),
    ] {
        let mut found = [0.0; 4];
        weights(&said, &states, true, &belief, &mut found);
        let distance = found.iter().zip(wanted).map(|(f, w)| (f - w).abs());
        assert!(distance.fold(0.0, f64::max) < 1e-12, "{found:?}");
    }
    let mut gathered = EpochEvidence::new();
    gathered.add(&said, &states, true);
    gathered.add(&said, &states, true);
    assert_eq!(gathered.log_likelihood[3], -LOG_RATIO_MAX);
}

#[test]
fn a_diagnosis_is_sound_if_all_it_says_is_a_probability_of_this_tree() {
    let sound = |change: &dyn Fn(&mut FaultBelief)| {
        let mut said = diagnosis(&[0.5, 0.5], 0.25);
        change(&mut said);
        is_sound(&said, &STATES, 7)
    };
    assert!(sound(&|_| {}));
    assert!(sound(&|d| d.p[1] = 1.0 + 0.9 * P_TOLERANCE));
    assert!(!sound(&|d| d.p[1] = 1.0 + 2.0 * P_TOLERANCE));
    assert!(!sound(&|d| d.p[4] = -1e-9));
    assert!(!sound(&|d| d.p_predicted[2] = f64::NAN));
    assert!(!sound(&|d| d.p_unknown = f64::INFINITY));
    assert!(!sound(&|d| d.p_unknown_predicted = -1.0));
    assert!(!sound(&|d| d.tree_hash = 8));
    assert!(!sound(&|d| (d.p[0], d.p[1], d.p_unknown) = (0.0, 0.0, 0.0)));
    assert!(sound(&|d| d.sets[0].p = 9.0), "a set that is not in use");
    assert!(!sound(&|d| (d.sets[0].p, d.set_count) = (1.1, 1)));
    assert!(sound(&|d| d.set_count = u32::MAX), "no more than there are");
}

#[test]
fn a_belief_has_drifted_beyond_a_twentieth() {
    assert!(!has_drifted(&[0.5, 0.5], &[1.09, 0.91]));
    assert!(has_drifted(&[0.5, 0.5], &[1.11, 0.89]));
    assert!(has_drifted(&[0.5, 0.5], &[0.89, 1.11]));
}

#[test]
#[should_panic(expected = "likelihoods lie between 0 and 1, the largest being 1")]
fn likelihoods_without_a_largest_of_one_are_caught() {
    let mut gathered = EpochEvidence::new();
    gathered.take(&mut [0.0; 6]);
    gathered.log_likelihood[0] = f64::NAN;
    gathered.take(&mut [0.0; 6]);
}
