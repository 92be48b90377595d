//! The check before deployment.

use vigil_missions::learning::{Record, check};
use vigil_pomdp::Pomdp;

use crate::recorded::missions;

const LAMP: &str = "
discount: 0.8 values: reward states: on off
actions: wait press observations: light dark
start: 0.5 0.5
T: wait identity
T: press
0.3 0.7
0.9 0.1
O: *
0.95 0.05
0.1 0.9
R: * : on : * : * 1
R: press : * : off : * -2
";

#[test]
fn a_true_model_predicts_what_is_measured_and_a_wrong_one_is_refused() {
    let truth = Pomdp::parse(LAMP).unwrap();
    let records = missions(&truth, 8, 4000, 12, false);
    let followed = check::follow(&truth, &records).unwrap();
    assert_eq!(followed.missions, 4000);
    let (predicted, measured) = (followed.predicted, followed.measured);
    let error = followed.check().unwrap();
    assert!(!error.is_weak);
    assert!(
        (predicted.mean - measured.mean).abs() < measured.half_width + predicted.half_width,
        "{error:?}"
    );
    // Predictions vary less than what happens.
    assert!(predicted.half_width < 0.7 * measured.half_width);
    // Pressing switches the lamp off for good, and it is dark by night only: an optimist's model.
    let wrong = LAMP
        .replace("0.3 0.7", "0.9 0.1")
        .replace("0.1 0.9\nR", "0.7 0.3\nR");
    let wrong = Pomdp::parse(&wrong).unwrap();
    let followed = check::follow(&wrong, &records).unwrap();
    let refusal = followed.check().unwrap_err();
    assert!(refusal.error > check::ERROR_MAX && refusal.predicted > refusal.measured);
    assert!(refusal.to_string().starts_with("not to be deployed: "));
    let silent = Record {
        rewards: Vec::new(),
        ..records[0].clone()
    };
    assert_eq!(check::follow(&truth, &[silent]), None);
}

#[test]
fn a_fifth_is_allowed_and_no_more() {
    let error = |predicted, measured| check::within(predicted, measured, 0.0).map(|a| a.error);
    assert_eq!(error(12.0, 10.0).ok(), Some(0.2));
    assert!(error(12.1, 10.0).is_err() && error(-8.1, -10.0).is_ok());
    assert!(error(10.0, -10.0).is_err() && error(0.1, 0.0).is_err());
    assert_eq!(error(0.0, 0.0).ok(), Some(0.0));
    assert!(error(f64::NAN, 1.0).is_err() && error(1.0, f64::NAN).is_err());
    // What chance may do does not count against the model, but it is told.
    let found = check::within(0.059, 0.175, 0.333).unwrap();
    assert!(found.is_weak && (found.error - 0.663).abs() < 1e-3);
    assert!(!check::within(12.9, 10.0, 1.0).unwrap().is_weak);
    let message = check::within(13.1, 10.0, 1.0).unwrap_err().to_string();
    assert!(
        message.ends_with(
            "allowed are 20 % and the 1.000000 by which chance may set them apart (95 %)"
        )
    );
    // One mission tells nothing.
    assert!(check::within(1.0, 1.0, f64::NAN).is_err());
}

#[test]
fn rewards_of_what_happened_have_the_expected_mean() {
    let model = Pomdp::parse(LAMP).unwrap();
    let records = missions(&model, 1, 4000, 3, false);
    let all = || {
        records
            .iter()
            .flat_map(|r| r.actions.iter().zip(&r.rewards))
    };
    let pressed: Vec<f64> = all().filter(|(a, _)| **a == 1).map(|(_, r)| *r).collect();
    // Each of the outcomes: from on or off, to on or off.
    for value in [1.0, 0.0, -2.0] {
        assert!(pressed.iter().any(|r| (r - value).abs() < 1e-12), "{value}");
    }
    assert!((model.reward(1, 1) - -0.2).abs() < 1e-12 && (model.reward(0, 1) - -1.1).abs() < 1e-12);
}
