//! Untrusted text and beliefs: no panic, no NaN.

use proptest::prelude::*;
use vigil_pomdp::{Pomdp, Tracker};

const MODEL: &str = "discount: 0.9\nstates: a b\nactions: go stay\nobservations: x y\n\
    start: 0.5 0.5\nT: go identity\nT: stay uniform\nO: * uniform\nR: * : * : * : * -1.5\n";

/// What may stand after the places that a rule names.
const TAILS: &str = "uniform|identity|reset|0|1|0.5|-2|1e-12|0.5 0.5|1 0 0 1|0.25 0.75 1 0|1 2 3 4";
/// Makes most of what came before a model.
const GOOD_END: &str = "T: * : a reset T: * : b : * 0.5 O: go uniform O: stay : * 0.5 0.5\n";

proptest! {
    #[test]
    fn any_text_is_read_or_refused(text in ".{0,400}") {
        let _ = Pomdp::parse(&text);
    }

    #[test]
    fn a_damaged_model_is_read_or_refused(
        at in 0..MODEL.len(), length in 0_usize..8, with in "[-0-9a-zTOR:*.# \n]{0,8}"
    ) {
        let end = (at + length).min(MODEL.len());
        let text = format!("{}{with}{}", &MODEL[..at], &MODEL[end..]);
        if let Ok(model) = Pomdp::parse(&text) {
            prop_assert!(model.discount() >= 0.0 && model.discount() <= 1.0);
        }
    }

    #[test]
    fn any_rules_are_read_or_refused(
        rules in prop::collection::vec(("[TOR]", "( ?: ?(\\*|[0-3]|go|a|b|x)){1,4}", TAILS), 0..12)
    ) {
        let rules: String = rules.iter().map(|(table, picks, tail)| {
            format!("{table}{picks} {tail}\n")
        }).collect();
        let text = format!("{}{rules}{GOOD_END}", &MODEL[..MODEL.find("T:").unwrap()]);
        if let Ok(model) = Pomdp::parse(&text) {
            prop_assert_eq!(&model, &Pomdp::parse(&model.to_cassandra()).unwrap());
        }
    }

    #[test]
    fn no_likelihood_makes_a_belief_bad(values in prop::collection::vec(any::<f64>(), 2)) {
        let model = Pomdp::parse(MODEL).unwrap();
        let mut tracker = Tracker::new(&model);
        tracker.weigh(&values);
        tracker.anchor(&values);
        tracker.update(&model, 1, 0);
        let sum: f64 = tracker.belief().iter().sum();
        prop_assert!((sum - 1.0).abs() < 1e-9);
        prop_assert!(tracker.belief().iter().all(|b| b.is_finite() && *b >= 0.0));
    }
}
