//! Goal problems: discount 1, against answers by hand and against discounts near 1.

use proptest::prelude::*;
use vigil_pomdp::bounds::{SolveError, fib, mdp, tib};
use vigil_pomdp::solver::{
    EndReason, Method, Options, SearchResult, bound, compact, policy_value, solve,
};
use vigil_pomdp::{Budget, PointBased, Pomdp};

use crate::simulation::earned;

fn found(model: &Pomdp, precision: f64) -> SearchResult {
    let options = Options {
        precision,
        ..Options::default()
    };
    let mut stop = || false;
    solve(model, &options, &mut Budget::new(&mut stop), &mut |_| ()).unwrap()
}

/// The search ends at a value that is known, and its policy earns it.
fn assert_solved(model: &Pomdp, value: f64) {
    let found = found(model, 1e-6);
    let bracket = found.bracket;
    assert_eq!(found.ended, EndReason::Precision);
    assert!(
        bracket.lower <= value && value <= bracket.upper && bracket.gap() <= 1e-6,
        "{bracket:?}, {value}"
    );
    let vectors = found.vectors.unwrap();
    let mut policy = PointBased::new(model, &vectors).unwrap();
    let mut stop = || false;
    let earned_surely = policy_value(model, &mut policy, 20_000, &mut Budget::new(&mut stop));
    let earned_surely = earned_surely.unwrap();
    assert!(
        earned_surely.upper >= bracket.lower - 1e-9,
        "{earned_surely:?}"
    );
    if earned_surely.beyond == 0.0 {
        assert!(
            earned_surely.lower >= bracket.lower - 1e-9,
            "{earned_surely:?}"
        );
    }
    let (mean, error) = earned(model, &vectors, 2000, 0.0);
    assert!(
        (mean - value).abs() <= 5.0 * error + 1e-6,
        "{mean} +- {error}, {value}"
    );
}

/// Something is hidden on the left or on the right; a look costs 1 and finds what is there with
/// probability `detection`.
fn search(left: f64, detection: f64, seen: &str) -> Pomdp {
    let missed = 1.0 - detection;
    let right = 1.0 - left;
    Pomdp::parse(&format!(
        "discount: 1 values: cost states: left right found actions: look-left look-right
        observations: nothing something start: {left} {right} 0
        T: * identity
        T: look-left : left {missed} 0 {detection}
        T: look-right : right 0 {missed} {detection}
        O: * : * 1 0
        O: * : found {seen}
        R: * : left : * : * 1
        R: * : right : * : * 1"
    ))
    .unwrap()
}

#[test]
fn a_search_takes_as_many_looks_as_it_must() {
    // Once, or twice where the likelier place was wrong.
    assert_solved(&search(0.75, 1.0, "0 1"), -1.25);
    assert_solved(&search(0.75, 1.0, "1 0"), -1.25);
    // In turns, where a look misses half the time: V = 1 + 3/4 (1 + 2/3 V).
    assert_solved(&search(0.5, 0.5, "0 1"), -3.5);
    assert_solved(&search(0.5, 0.5, "1 0"), -3.5);
}

#[test]
fn a_corridor_in_the_dark_takes_as_many_steps_as_it_pays() {
    // A step gets on with 1/2, unseen. Leaving costs 10 where the corridor is not at its end: the
    // least of n + 10 / 2^n is that of 3.
    let text = "discount: 1 values: cost states: begin end out actions: go leave observations: 1
        start: begin T: * identity T: go : begin 0.5 0.5 0 T: leave : * 0 0 1 O: * uniform
        R: go : begin : * : * 1 R: go : end : * : * 1 R: leave : begin : * : * 10";
    assert_solved(&Pomdp::parse(text).unwrap(), -4.25);
    // Seen, four cells of which each takes two steps.
    let text = "discount: 1 values: cost states: 5 actions: 2 observations: 5 start: 0
        T: 1 identity
        T: 0 : 0 0.5 0.5 0 0 0 T: 0 : 1 0 0.5 0.5 0 0 T: 0 : 2 0 0 0.5 0.5 0
        T: 0 : 3 0 0 0 0.5 0.5 T: 0 : 4 0 0 0 0 1
        O: * 1 0 0 0 0 0 1 0 0 0 0 0 1 0 0 0 0 0 1 0 0 0 0 0 1
        R: * : * : * : * 1 R: * : 4 : * : * 0";
    assert_solved(&Pomdp::parse(text).unwrap(), -8.0);
}

/// A tiger after whose door all is over; `seen` is what is heard then.
fn tiger_with_end(seen: &str) -> Pomdp {
    Pomdp::parse(&format!(
        "discount: 1 values: reward states: left right over actions: listen open-left open-right
        observations: hear-left hear-right start: 0.5 0.5 0
        T: listen identity T: open-left : * 0 0 1 T: open-right : * 0 0 1
        O: * : * 0.5 0.5 O: listen : left 0.85 0.15 O: listen : right 0.15 0.85
        O: * : over {seen}
        R: listen : left : * : * -1 R: listen : right : * : * -1
        R: open-left : left : * : * -100 R: open-left : right : * : * 10
        R: open-right : left : * : * 10 R: open-right : right : * : * -100"
    ))
    .unwrap()
}

#[test]
fn a_tiger_is_listened_to_as_the_sequential_test_says() {
    // Open once one side was heard k times more often: the gambler's ruin says how long that takes
    // and how often it is right (Wald 1947). The best k is the value.
    let odds: f64 = 0.85 / 0.15;
    let worth = |k: i32| {
        let right = odds.powi(k) / (1.0 + odds.powi(k));
        let steps = f64::from(k) * (2.0 * right - 1.0) / 0.7;
        10.0 * right - 100.0 * (1.0 - right) - steps
    };
    let best = (0..10).map(worth).fold(f64::NEG_INFINITY, f64::max);
    assert!((best - 5.16).abs() < 0.01 && best == worth(3));
    assert_solved(&tiger_with_end("0.5 0.5"), best);
    assert_solved(&tiger_with_end("1 0"), best);
}

#[test]
fn every_method_bounds_a_goal_problem_from_its_side() {
    for (model, value) in [
        (search(0.5, 0.5, "0 1"), -3.5),
        (tiger_with_end("1 0"), 5.159_919),
    ] {
        for method in Method::ALL {
            let mut stop = || false;
            let mut budget = Budget::new(&mut stop);
            let options = Options::default();
            let found = bound(method, &model, &options, &mut budget, &mut |_| ()).unwrap();
            let lower = found.lower.unwrap_or(f64::NEG_INFINITY);
            let upper = found.upper.unwrap_or(f64::INFINITY);
            assert!(
                lower <= value + 1e-4 && value - 1e-4 <= upper,
                "{method}: {found:?}"
            );
            assert!(lower.is_finite() || upper.is_finite(), "{method}");
        }
    }
    // Found at once by whoever knows where it is, if the look does not miss.
    let solution = mdp::solve(&search(0.5, 0.5, "0 1")).unwrap();
    assert!((solution.value(0) + 2.0).abs() < 1e-12 && (0.0..1e-9).contains(&solution.error()));
    assert_eq!(
        (solution.value(2), solution.best(0), solution.best(1)),
        (0.0, 0, 1)
    );
}

#[test]
fn few_vectors_that_never_end_are_not_taken() {
    let model = search(0.75, 1.0, "0 1");
    let vectors = found(&model, 1e-6).vectors.unwrap();
    let mut stop = || false;
    let mut budget = Budget::new(&mut stop);
    // One action alone finds one side alone.
    let small = compact(&model, &vectors, 1, &mut budget).unwrap();
    assert_eq!(small.vectors, vectors);
    let model = tiger_with_end("0.5 0.5");
    let result = found(&model, 1e-6);
    let small = compact(&model, &result.vectors.unwrap(), 4, &mut budget).unwrap();
    let promised = result.bracket.lower - small.loss_mean - 4.0 * small.loss_error;
    let (mean, error) = earned(&model, &small.vectors, 2000, 0.0);
    assert!(
        small.vectors.len() <= 4 && mean >= promised - 5.0 * error,
        "{mean} {promised}"
    );
}

#[test]
fn what_is_no_goal_problem_is_refused_and_the_reason_is_given() {
    let of = |rules: &str| {
        let text = format!(
            "discount: 1 values: cost states: a b end actions: go wait observations: 1 start: a
            T: * identity T: go : a 0 1 0 T: go : b 0 0 1 O: * uniform
            R: * : a : * : * 1 R: * : b : * : * 1 {rules}"
        );
        Pomdp::parse(&text).unwrap()
    };
    let refused = |rules: &str| {
        let errors = Method::ALL.map(|method| {
            let mut stop = || false;
            let mut budget = Budget::new(&mut stop);
            let options = Options::default();
            bound(method, &of(rules), &options, &mut budget, &mut |_| ()).err()
        });
        assert!(
            errors[1..].iter().all(|error| error == &errors[1]),
            "{errors:?}"
        );
        errors
    };
    assert!(refused("").iter().all(Option::is_none));
    let [blind, error, ..] = refused("R: wait : end : * : * 1");
    assert_eq!((&blind, &error), (&error, &Some(SolveError::NoGoal)));
    let [blind, error, ..] = refused("T: go : b 0 1 0");
    assert_eq!(
        (&blind, &error),
        (&error, &Some(SolveError::NoWay("a".to_owned())))
    );
    // Waiting for nothing, and being paid for it; and round in a circle that pays in all.
    let endless = |state: &str| Some(SolveError::Endless(state.to_owned()));
    assert_eq!(refused("R: wait : a : * : * 0")[1], endless("a"));
    assert_eq!(refused("R: wait : b : * : * -1")[1], endless("a"));
    let round = "T: wait : b 1 0 0 R: wait : b : * : * -1.5 R: go : a : * : *";
    assert_eq!(refused(&format!("{round} 1"))[1], endless("a"));
    assert_eq!(refused(&format!("{round} 1.5"))[1], endless("a"));
    assert_eq!(refused(&format!("{round} 1.6"))[1], None);
}

/// Three states and a goal, from each of which any action may end.
fn model(discount: f64, weights: &[u8]) -> Pomdp {
    let mut text = format!(
        "discount: {discount:?} values: cost states: 4 actions: 2 observations: 2\n\
         start: 0.5 0.25 0.25 0\n"
    );
    let weight = |at: usize| f64::from(weights[at % weights.len()]);
    for a in 0..2 {
        for s in 0..4 {
            let at = 8 * a + 2 * s;
            let row = [weight(at), weight(at + 1), weight(at + 3), 4.0];
            let row = if s == 3 { [0.0, 0.0, 0.0, 1.0] } else { row };
            let sum: f64 = row.iter().sum();
            let row = row.map(|w| format!("{:?}", w / sum)).join(" ");
            let (p, cost) = (
                weight(at + 5) / 40.0,
                weight(at + 7) * f64::from(u8::from(s < 3)),
            );
            text += &format!("T: {a} : {s} {row}\nO: {a} : {s} {p:?} {:?}\n", 1.0 - p);
            text += &format!(
                "R: {a} : {s} : * : * {:?}\n",
                cost + f64::from(u8::from(s < 3))
            );
        }
    }
    Pomdp::parse(&text).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn discount_one_is_the_limit_of_discounts(weights in prop::collection::vec(0_u8..40, 16..30)) {
        let goal = model(1.0, &weights);
        let upper = |model: &Pomdp| {
            let mut stop = || false;
            let mut budget = Budget::new(&mut stop);
            let relaxed = mdp::solve(model).unwrap();
            let fast = fib::solve(model, &mut budget).unwrap();
            let tighter = tib::solve(model, &mut budget).unwrap();
            let known: f64 = (0..4).map(|s| model.start()[s] * relaxed.value(s)).sum();
            [known, fast.value(model.start()), tighter.value(model.start())]
        };
        let ends = found(&goal, 1e-2);
        prop_assert_eq!(ends.ended, EndReason::Precision);
        for rest in [1e-4, 1e-6] {
            let near = model(1.0 - rest, &weights);
            // What is discounted: some thirty steps are left in the mean, whatever is done.
            for (one, other) in upper(&goal).iter().zip(upper(&near)) {
                prop_assert!(*one <= other + 1e-8, "{one} {other}");
                prop_assert!(other - one <= 100.0 * rest * one.abs() + 1e-7, "{one} {other}");
            }
            let near = found(&near, 1e-2);
            let far = 100.0 * rest * ends.bracket.lower.abs();
            prop_assert_eq!(near.ended, EndReason::Precision);
            prop_assert!(ends.bracket.lower <= near.bracket.upper);
            prop_assert!(near.bracket.lower <= ends.bracket.upper + far);
        }
    }
}
