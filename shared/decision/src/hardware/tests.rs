//! Exact answers for small beliefs.

use super::*;

/// States: fine, hardware, lost. Actions: wait, repair, seek.
const MODEL: &str = "discount: 0.9\nvalues: reward\nstates: fine hardware lost\n\
    actions: wait repair seek\nobservations: 1\nstart: 0.75 0.125 0.125\n\
    T: wait identity\nT: repair\n1 0 0\n0.5 0.5 0\n0 0 1\n\
    T: seek\n1 0 0\n0 1 0\n0.75 0 0.25\nO: *\nuniform\n";
const WAIT: usize = 0;
const REPAIR: usize = 1;
const SEEK: usize = 2;

fn evidence(lost: Option<usize>) -> HardwareEvidence {
    HardwareEvidence::new(&Pomdp::parse(MODEL).unwrap(), 1, lost, 7)
}

/// p: nominal and unknown; so predicted.
fn diagnosis(p: [f64; 2], predicted: [f64; 2]) -> FaultBelief {
    let mut diagnosis = FaultBelief {
        tree_hash: 7,
        identifying: 1,
        p_unknown: p[1],
        p_unknown_predicted: predicted[1],
        ..FaultBelief::default()
    };
    (diagnosis.p[0], diagnosis.p_predicted[0]) = (p[0], predicted[0]);
    diagnosis
}

fn near(found: &[f64], expected: [f64; 3]) {
    let is_near = |(f, e): (&f64, f64)| (f - e).abs() < 1e-9;
    assert!(found.iter().zip(expected).all(is_near), "{found:?}");
}

#[test]
fn an_action_mends_what_it_leads_out_of_more_than_others_do() {
    let found = evidence(Some(2)).mends;
    let pairs: Vec<_> = found.iter().map(|r| (r.hardware, r.place)).collect();
    assert_eq!(pairs, [(false, false), (true, false), (false, true)]);
    assert!(evidence(None).mends.iter().all(|r| !r.place));
}

#[test]
fn likelihoods_are_quotients_of_the_explanations_that_fit() {
    let mut hardware = evidence(Some(2));
    let predicted = [0.5, 0.25];
    assert!(
        hardware.add(&diagnosis(predicted, predicted)),
        "it begins to identify"
    );
    assert!(!hardware.add(&diagnosis([0.25, 0.5], predicted)));
    let mut likelihood = [0.0; 3];
    hardware.take(&mut likelihood);
    // Any fault 0.75 of 0.5, no modelled one 0.75 of 0.75, nothing 0.25 of 0.5.
    near(&likelihood, [0.5 / 1.5, 1.0, 1.0 / 1.5]);
    hardware.take(&mut likelihood);
    near(&likelihood, [1.0; 3]);
    // Without a state of its own a lost robot counts with the others.
    let mut alone = evidence(None);
    alone.add(&diagnosis(predicted, predicted));
    alone.add(&diagnosis([0.25, 0.5], predicted));
    alone.take(&mut likelihood);
    near(&likelihood, [0.5 / 1.5, 1.0, 0.5 / 1.5]);
    for _ in 0..100 {
        alone.add(&diagnosis([0.0, 0.5], predicted));
    }
    assert_eq!(alone.log.others, -LOG_EPOCH_MAX);
}

#[test]
fn a_quotient_is_bounded_and_says_nothing_where_it_is_none() {
    assert_eq!((log(1.0), log(2.0)), (0.0, 2.0_f64.ln()));
    assert_eq!((log(0.0), log(1e-300)), (-LOG_RATIO_MAX, -LOG_RATIO_MAX));
    assert_eq!(log(1e300), LOG_RATIO_MAX);
    assert_eq!([log(-1.0), log(f64::NAN), log(f64::INFINITY)], [0.0; 3]);
}

#[test]
fn another_context_is_taken_over_only_where_one_of_both_speaks_of_faults() {
    let said = diagnosis([0.5, 0.25], [0.5, 0.25]);
    let taken_over = |change: &dyn Fn(&mut FaultBelief)| {
        let mut hardware = evidence(None);
        hardware.add(&said);
        let mut next = said;
        change(&mut next);
        hardware.add(&next)
    };
    assert!(!taken_over(&|_| {}));
    assert!(taken_over(&|d| d.identifying = 0));
    assert!(taken_over(&|d| d.mode_change_count = 3));
    assert!(taken_over(&|d| d.header.epoch = 3));
    let mut hardware = evidence(None);
    let watching = FaultBelief {
        identifying: 0,
        ..said
    };
    assert!(!hardware.add(&watching));
    assert!(hardware.add(&said));
    assert!(hardware.add(&watching), "what was said before was a fault");
    assert!(!hardware.add(&watching));
    hardware.add(&said);
    hardware.forget();
    assert!(hardware.add(&said), "diagnoses were lost");
    hardware.reset();
    assert!(!hardware.add(&watching));
}

#[test]
fn the_detectors_alarm_is_something_unknown() {
    let mut hardware = evidence(Some(2));
    let mut detection = DetectionBelief {
        p_fault: 0.75,
        ..DetectionBelief::default()
    };
    assert!(!hardware.add_alarm(&detection));
    detection.alarm = 1;
    assert!(hardware.add_alarm(&detection));
    assert!(!hardware.add_alarm(&detection));
    assert_eq!((hardware.p.modelled, hardware.p.unknown), (0.0, 0.75));
    detection.alarm_count = 1;
    assert!(hardware.add_alarm(&detection));
    // The identifier in its place is another context, though its numbers are the same.
    let mut said = diagnosis([0.25, 0.75], [0.25, 0.75]);
    said.mode_change_count = 1;
    assert!(hardware.add(&said));
}

#[test]
fn what_is_taken_over_is_shared_as_it_was_believed() {
    let mut hardware = evidence(Some(2));
    hardware.add(&diagnosis([0.25, 0.25], [0.25, 0.25]));
    let start = [0.75, 0.125, 0.125];
    let mut weights = [0.0; 3];
    // Modelled 0.5, unknown 0.25, of which hardware has three quarters.
    hardware.anchored(&[0.6, 0.3, 0.1], &start, &mut weights);
    let nothing = 0.3125 * 0.25 / 0.3125;
    near(
        &weights,
        [nothing * 0.6 / 0.7, 0.6875, 0.0625 + nothing * 0.1 / 0.7],
    );
    // Neither is believed: as the start has it, half and half.
    hardware.anchored(&[1.0, 0.0, 0.0], &start, &mut weights);
    near(&weights, [0.25, 0.625, 0.125]);
    // Nothing else is believed: the rest as the start has it.
    hardware.anchored(&[0.0, 1.0, 0.0], &start, &mut weights);
    near(&weights, [0.25 * 0.75 / 0.875, 0.75, 0.25 * 0.125 / 0.875]);
    // Once the place was sought, what is unknown is the hardware's.
    hardware.sought();
    hardware.anchored(&[0.6, 0.3, 0.1], &start, &mut weights);
    near(&weights, [0.25 * 0.6 / 0.7, 0.75, 0.25 * 0.1 / 0.7]);
    // Never below the start's, never certain.
    let mut hardware = evidence(None);
    hardware.anchored(&[0.9, 0.1, 0.0], &start, &mut weights);
    near(&weights, [0.875, 0.125, 0.0]);
    hardware.add(&diagnosis([0.0, 0.0], [0.0, 0.0]));
    hardware.anchored(&[0.9, 0.1, 0.0], &start, &mut weights);
    near(&weights, [1e-6, 1.0 - 1e-6, 0.0]);
}

#[test]
fn a_belief_has_drifted_below_what_the_identifier_holds() {
    let mut hardware = evidence(Some(2));
    assert!(!hardware.has_drifted(&[1.0, 0.0, 0.0]), "nothing was said");
    hardware.add(&diagnosis([0.25, 0.25], [0.25, 0.25]));
    assert!(!hardware.has_drifted(&[0.29, 0.46, 0.25]));
    assert!(hardware.has_drifted(&[0.29, 0.44, 0.27]), "modelled");
    assert!(hardware.has_drifted(&[0.31, 0.46, 0.23]), "either");
    hardware.sought();
    assert!(hardware.has_drifted(&[0.29, 0.46, 0.25]));
    assert!(!hardware.has_drifted(&[0.29, 0.71, 0.0]));
}

#[test]
fn while_something_is_wrong_only_a_remedy_is_allowed() {
    let mut hardware = evidence(Some(2));
    let allowed = |h: &HardwareEvidence| [WAIT, REPAIR, SEEK].map(|action| h.allows(action));
    assert_eq!(allowed(&hardware), [true; 3]);
    hardware.add(&diagnosis([0.5, 0.5], [0.5, 0.5]));
    assert_eq!(allowed(&hardware), [true; 3], "even odds are not wrong");
    hardware.add(&diagnosis([0.25, 0.25], [0.5, 0.5]));
    assert_eq!(allowed(&hardware), [false, true, true]);
    hardware.sought();
    assert_eq!(allowed(&hardware), [false, true, false]);
    hardware.quiet();
    assert_eq!(
        allowed(&hardware),
        [false, true, false],
        "it still identifies"
    );
    hardware.add(&FaultBelief::default());
    hardware.quiet();
    hardware.add(&diagnosis([0.25, 0.25], [0.5, 0.5]));
    assert_eq!(allowed(&hardware), [false, true, true]);
    hardware.mends.clear();
    assert!(hardware.allows(WAIT), "where nothing mends, all is allowed");
}

#[test]
fn a_diagnosis_is_sound_if_it_holds_probabilities_of_this_tree() {
    let hardware = evidence(None);
    let sound = |change: &dyn Fn(&mut FaultBelief)| {
        let mut said = diagnosis([0.5, 0.5], [0.5, 0.5]);
        change(&mut said);
        hardware.is_sound(&said)
    };
    assert!(sound(&|d| d.p[0] = 1.0 + 0.9 * P_TOLERANCE));
    assert!(!sound(&|d| d.p[0] = 1.0 + 2.0 * P_TOLERANCE));
    assert!(!sound(&|d| d.p_unknown = -0.1));
    assert!(!sound(&|d| d.p_predicted[0] = f64::NAN));
    assert!(!sound(&|d| d.p_unknown_predicted = 2.0));
    assert!(!sound(&|d| d.tree_hash = 8));
}
