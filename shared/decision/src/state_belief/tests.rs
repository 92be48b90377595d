use super::*;

const fn state(subject: Subject, leaves: u64) -> StateMeaning {
    StateMeaning {
        subject,
        leaves,
        settles_to: None,
    }
}

const NOMINAL: StateMeaning = state(Subject::Nominal, 0);
const UNKNOWN: StateMeaning = state(Subject::Unknown, 0);
const SEVERAL: StateMeaning = state(Subject::Several, 0);
const DRIVABLE: StateMeaning = state(Subject::Drivable, 0);
/// Leaves 1 and 2 are stuck wheels, 3 and 4 are encoders.
const STUCK: StateMeaning = state(Subject::Fault, 0b00110);
const ENCODERS: StateMeaning = state(Subject::Fault, 0b11000);
const STATES: [StateMeaning; 4] = [NOMINAL, STUCK, ENCODERS, UNKNOWN];

fn diagnosis(p: &[f64], p_unknown: f64) -> FaultBelief {
    let mut diagnosis = FaultBelief {
        tree_hash: 7,
        p_unknown,
        ..FaultBelief::default()
    };
    diagnosis.p[..p.len()].copy_from_slice(p);
    diagnosis
}

/// Weights where the sets are these: their leaves as bits, their probability.
fn weighed<const N: usize>(
    states: &[StateMeaning; N],
    said: FaultBelief,
    sets: &[(u64, f64)],
) -> [f64; N] {
    weighed_for(&AnswerableFaults::default(), states, said, sets)
}

/// The same where an action answers some faults.
fn weighed_for<const N: usize>(
    answerable: &AnswerableFaults,
    states: &[StateMeaning; N],
    mut said: FaultBelief,
    sets: &[(u64, f64)],
) -> [f64; N] {
    said.set_count = sets.len() as u32;
    for (set, (leaves, p)) in said.sets.iter_mut().zip(sets) {
        (set.leaves, set.p) = (*leaves, *p);
    }
    let mut out = [0.0; N];
    write_weights(&said, states, answerable, true, &mut out);
    out
}

fn near(found: &[f64], wanted: &[f64]) {
    let distance = found.iter().zip(wanted).map(|(f, w)| (f - w).abs());
    assert!(
        found.len() == wanted.len() && distance.fold(0.0, f64::max) < 1e-12,
        "{found:?} {wanted:?}"
    );
}

#[test]
fn a_state_has_the_probability_of_all_of_its_leaves() {
    let single = diagnosis(&[0.125, 0.25, 0.25, 0.125, 0.0], 0.25);
    let sets = [(0b00010, 0.25), (0b00100, 0.25), (0b01000, 0.125)];
    near(&weighed(&STATES, single, &sets), &[0.125, 0.5, 0.125, 0.25]);
    near(&weighed(&STATES, single, &[]), &[0.125, 0.5, 0.125, 0.25]);
}

#[test]
fn a_set_of_one_state_counts_once() {
    let both = diagnosis(&[0.25, 0.0, 0.0, 0.5, 0.75], 0.0);
    let sets = [(0b11000, 0.5), (0b10000, 0.25)];
    near(&weighed(&STATES, both, &sets), &[0.25, 0.0, 0.75, 0.0]);
}

#[test]
fn a_set_of_several_faults_is_several_or_else_what_holds_it_or_unknown() {
    let said = diagnosis(&[0.125, 0.75, 0.0, 0.5], 0.125);
    let sets = [(0b01010, 0.5), (0b00010, 0.25)];
    near(&weighed(&STATES, said, &sets), &[0.125, 0.25, 0.0, 0.625]);
    let states = [SEVERAL, NOMINAL, STUCK, ENCODERS, UNKNOWN];
    near(
        &weighed(&states, said, &sets),
        &[0.5, 0.125, 0.25, 0.0, 0.125],
    );
    // Both may be of one state: what answers one does not answer both.
    let states = [NOMINAL, state(Subject::Fault, 0b11110), SEVERAL, UNKNOWN];
    near(&weighed(&states, said, &sets), &[0.125, 0.25, 0.5, 0.125]);
    let states = [NOMINAL, state(Subject::Fault, 0b11110), UNKNOWN];
    near(&weighed(&states, said, &sets), &[0.125, 0.75, 0.125]);
}

#[test]
fn before_an_alarm_the_unknown_is_nominal() {
    let said = diagnosis(&[0.5, 0.125], 0.375);
    for (alarm, wanted) in [
        (true, [0.5, 0.125, 0.0, 0.375]),
        (false, [0.875, 0.125, 0.0, 0.0]),
    ] {
        let mut found = [0.0; 4];
        write_weights(
            &said,
            &STATES,
            &AnswerableFaults::default(),
            alarm,
            &mut found,
        );
        near(&found, &wanted);
    }
    // What two readers rounded apart is still a probability.
    let mut found = [0.0; 4];
    write_weights(
        &diagnosis(&[0.9], 0.9),
        &STATES,
        &AnswerableFaults::default(),
        false,
        &mut found,
    );
    near(&found, &[1.0, 0.0, 0.0, 0.0]);
}

#[test]
fn new_states_and_the_end_are_nothing_that_a_diagnosis_says() {
    let new = StateMeaning {
        settles_to: Some(0),
        ..UNKNOWN
    };
    let states = [UNKNOWN, new, NOMINAL, state(Subject::Done, 0)];
    let said = diagnosis(&[0.5], 0.5);
    near(&weighed(&states, said, &[]), &[0.5, 0.0, 0.5, 0.0]);
}

#[test]
fn what_is_less_probable_alone_is_answered_by_driving_home() {
    let robot = AnswerableFaults::drivable(0b11110);
    let states = [NOMINAL, STUCK, ENCODERS, SEVERAL, DRIVABLE, UNKNOWN];
    // Leaf 1 alone has 0.0625, leaf 2 as much; leaves 1 and 3 together have 0.75.
    let said = diagnosis(&[0.0, 0.8125, 0.0625, 0.75], 0.125);
    near(
        &weighed_for(&robot, &states, said, &[(0b01010, 0.75)]),
        &[0.0, 0.0625, 0.0, 0.0, 0.8125, 0.125],
    );
    // Leaf 1 is more probable alone, and then nobody knows.
    let said = diagnosis(&[0.0, 0.875, 0.0, 0.25], 0.125);
    near(
        &weighed_for(&robot, &states, said, &[(0b01010, 0.25)]),
        &[0.0, 0.625, 0.0, 0.0, 0.25, 0.125],
    );
}

#[test]
fn what_is_answered_one_at_a_time_is_only_the_most_probable() {
    let steered_and_ignored = AnswerableFaults::singles(0b11110);
    // Leaf 1 alone has 0.25, leaf 2 has 0.1875; no action on one wheel answers the pair of 1 and 3.
    let said = diagnosis(&[0.0625, 0.5, 0.1875, 0.375], 0.125);
    let sets = [(0b01010, 0.25), (0b00010, 0.25)];
    let states = [NOMINAL, STUCK, ENCODERS, SEVERAL, UNKNOWN];
    near(
        &weighed_for(&steered_and_ignored, &states, said, &sets),
        &[0.0625, 0.25, 0.125, 0.25, 0.125 + 0.1875],
    );
    // Without counter-steering, every stuck wheel is answered alike.
    let ignored = AnswerableFaults::singles(0b11000);
    near(
        &weighed_for(&ignored, &states, said, &sets),
        &[0.0625, 0.4375, 0.125, 0.25, 0.125],
    );
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
    assert!(!sound(&|d| d.p[2] = f64::NAN));
    assert!(!sound(&|d| d.p_unknown = f64::INFINITY));
    assert!(!sound(&|d| d.tree_hash = 8));
    assert!(!sound(&|d| (d.p[0], d.p[1], d.p_unknown) = (0.0, 0.0, 0.0)));
    assert!(sound(&|d| d.sets[0].p = 9.0), "a set that is not in use");
    assert!(!sound(&|d| (d.sets[0].p, d.set_count) = (1.1, 1)));
    assert!(sound(&|d| d.set_count = u32::MAX), "no more than there are");
}
