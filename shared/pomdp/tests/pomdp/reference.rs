//! Against exact answers worked by hand, and the reference values of public models.

use vigil_pomdp::bounds::fib;
use vigil_pomdp::policy::{FastInformed, choose, choose_among};
use vigil_pomdp::{
    ActionVoting, AlphaVectors, Budget, Evidence, MostLikelyState, PointBased, Policy, Pomdp, QMdp,
    Tracker, mdp,
};

use crate::public;
use crate::public::TIGER;
use crate::public::bounds::BOUNDS;

#[test]
fn tiger_beliefs_are_exact() {
    let tiger = Pomdp::parse(TIGER).unwrap();
    let mut tracker = Tracker::new(&tiger);
    assert_eq!(tracker.update(&tiger, 0, 0), Evidence::Taken(0.5));
    assert!((tracker.belief()[0] - 0.85).abs() < 1e-15);
    let Evidence::Taken(p) = tracker.update(&tiger, 0, 0) else {
        unreachable!()
    };
    assert!((p - 0.745).abs() < 1e-15);
    assert!((tracker.belief()[0] - 0.969_798_657_718).abs() < 1e-12);
}

#[test]
fn tiger_values_are_exact() {
    let solution = mdp::solve(&Pomdp::parse(TIGER).unwrap()).unwrap();
    // Open the right door for ever: 10 / (1 - 0.95).
    for s in 0..2 {
        assert!((solution.value(s) - 200.0).abs() < 1e-9);
        assert!((solution.q(s, 0) - 189.0).abs() < 1e-9);
    }
    let mut values = [0.0; 3];
    let choice = QMdp::new(solution).evaluate(&[0.5, 0.5], &mut values);
    assert_eq!(choice.action, 0);
    assert!((values[0] - 189.0).abs() < 1e-9 && (values[1] - 145.0).abs() < 1e-9);
}

#[test]
fn the_other_policies_follow_their_definitions() {
    let solution = mdp::solve(&Pomdp::parse(TIGER).unwrap()).unwrap();
    let mut values = [0.0; 3];
    // A tiger on the left: open the right door.
    let mls = MostLikelyState::new(&solution).evaluate(&[0.6, 0.4], &mut values);
    assert_eq!((mls.action, values), (2, [0.0, 0.0, 0.6]));
    let av = ActionVoting::new(&solution).evaluate(&[0.3, 0.7], &mut values);
    assert_eq!((av.action, values), (1, [0.0, 0.7, 0.3]));
    assert!((av.margin - 0.4).abs() < 1e-15);
    // An exact tie of both doors, in votes too: the lowest index.
    let tie = MostLikelyState::new(&solution).evaluate(&[0.5, 0.5], &mut values);
    assert_eq!((tie.action, tie.margin), (1, 0.0));
}

#[test]
fn ties_go_to_the_lowest_index_and_rounding_does_not_break_them() {
    assert_eq!(choose(&[1.0, 3.0, 2.0], &[]).action, 1);
    assert_eq!(choose(&[1.0, 3.0, 2.0], &[]).margin, 1.0);
    let tie = choose(&[0.0, 0.3, 0.1 + 0.2], &[]);
    assert_eq!(tie.action, 1);
    assert!(tie.margin >= 0.0 && tie.margin < 1e-15);
    assert_eq!(choose(&[1e6, 1e6 + 1e-4], &[]).action, 0);
    assert_eq!(choose(&[1e6, 1e6 + 1e-2], &[]).action, 1);
    assert_eq!(choose(&[f64::NAN, -1.0], &[]).action, 1);
    assert_eq!(choose_among(&[1.0, 3.0, 2.0], &[], |a| a != 1).action, 2);
    assert_eq!(choose(&[], &[]).margin, 0.0);
}

#[test]
fn the_states_votes_break_ties_of_every_policy() {
    // One step is all that counts. At equal weights both actions are worth 1; a alone speaks for
    // the first, b and c for the second.
    let text = "discount: 0 values: reward states: a b c actions: 2 observations: 1 T: * identity\n\
                O: * uniform R: 0 : a : * : * 3 R: 1 : b : * : * 1 R: 1 : c : * : * 2\n";
    let model = Pomdp::parse(text).unwrap();
    let solution = mdp::solve(&model).unwrap();
    let fast = fib::solve(&model, &mut Budget::new(&mut || false)).unwrap();
    let vectors = [(0, vec![3.0, 0.0, 0.0]), (1, vec![0.0, 1.0, 2.0])];
    let vectors = AlphaVectors::new(3, 2, vectors).unwrap();
    let policies: [Box<dyn Policy>; 3] = [
        Box::new(QMdp::new(solution)),
        Box::new(FastInformed::new(fast)),
        Box::new(PointBased::new(&model, &vectors).unwrap()),
    ];
    for mut policy in policies {
        let mut chosen = |belief: [f64; 3]| policy.evaluate(&belief, &mut [0.0; 2]).action;
        assert_eq!(chosen([1.0 / 3.0; 3]), 1);
        // No tie: 1.5 against 0.75.
        assert_eq!(chosen([0.5, 0.25, 0.25]), 0);
        // A tie, both are worth 1.2.
        assert_eq!(chosen([0.4, 0.0, 0.6]), 1);
    }
}

#[test]
fn values_without_bound_are_refused() {
    let endless = TIGER.replace("discount: 0.95", "discount: 1");
    assert!(mdp::solve(&Pomdp::parse(&endless).unwrap()).is_err());
    // Staying is worth -1e308, a double still; going costs more than any double holds.
    let dear = "discount: 0.95 states: 1 actions: stay go observations: 1 T: * identity\n\
                O: * uniform\nR: stay : * : * : * -5e306\nR: go : * : * : * -1.7e308\n";
    assert!(mdp::solve(&Pomdp::parse(dear).unwrap()).is_err());
}

#[test]
fn impossible_observations_are_survived() {
    let text = TIGER.replace("0.85 0.15\n0.15 0.85", "1 0\n0 1");
    let tiger = Pomdp::parse(&text).unwrap();
    let mut tracker = Tracker::new(&tiger);
    tracker.update(&tiger, 0, 0);
    assert_eq!(tracker.belief(), [1.0, 0.0]);
    assert_eq!(tracker.update(&tiger, 0, 1), Evidence::Impossible);
    let sum: f64 = tracker.belief().iter().sum();
    assert!((sum - 1.0).abs() < 1e-12 && tracker.belief()[1] > 0.0);
    assert_eq!(tracker.weigh(&[f64::NAN, f64::NAN]), Evidence::Impossible);
    assert!(tracker.belief().iter().all(|b| b.is_finite()));
}

#[test]
fn small_probabilities_survive() {
    let text = "discount: 0.5\nstates: 2\nactions: 1\nobservations: 1\n\
                T: 0 : 0 : 0 0.999999999999 T: 0 : 0 : 1 1e-12 T: 0 : 1 : 1 1.0\nO: * uniform\n";
    let model = Pomdp::parse(text).unwrap();
    let mut tracker = Tracker::new(&model);
    assert!(tracker.anchor(&[1.0, 0.0]));
    tracker.predict(&model, 0);
    assert!((tracker.belief()[1] / 1e-12 - 1.0).abs() < 1e-3);
}

#[test]
fn the_forms_of_the_grammar_that_public_files_lack_are_read() {
    let text = "discount: 0.9\nvalues: cost\nstates: a b c\nactions: go\nobservations: x y\n\
                start exclude: b\nT: go : a reset\nT: go : b uniform\nT : go :c 0 0 1\n\
                O: * : a 0.5 0.5 O: * : b uniform O: go : c : x 1.\n\
                R: go : a : b 2 4\nR: go : c 1 1 1 1 6 0\r\n";
    let model = Pomdp::parse(text).unwrap();
    assert_eq!(model.start(), [0.5, 0.0, 0.5]);
    assert_eq!(model.successors(0, 0), [(0, 0.5), (2, 0.5)]);
    assert_eq!(model.likelihood(0, 0), [0.5, 0.5, 1.0]);
    assert_eq!(
        model.reward(2, 0),
        -6.0,
        "a cost counts negative; only x is seen in c"
    );
    assert_eq!(model.reward(0, 0), 0.0, "b is not reached from a");
}

#[test]
fn later_rules_win_over_earlier_ones() {
    let text = TIGER.replace(
        "R: listen : * : * : * -1",
        "R: listen : left : * : * 5\nR: listen : * : * : * -1",
    );
    assert_eq!(Pomdp::parse(&text).unwrap().reward(0, 0), -1.0);
}

#[test]
fn comments_and_layout_do_not_change_the_hash_and_numbers_do() {
    let hash = |text: &str| Pomdp::parse(text).unwrap().hash();
    assert_eq!(hash(TIGER), hash(&TIGER.replace('\n', "\n  # a comment\n")));
    assert_ne!(hash(TIGER), hash(&TIGER.replace("0.95", "0.949")));
}

#[test]
fn errors_name_line_column_and_what_is_allowed() {
    let cases = [
        (
            TIGER.replace("0.85 0.15", "0.85 0.25"),
            "line 10",
            "sums to 1.1",
        ),
        (
            TIGER.replace("discount: 0.95", "discount: 1.5"),
            "line 2, column 1",
            "0 to 1",
        ),
        (
            TIGER.replace("T: listen identity", "T: lissen identity"),
            "line 7, column 4",
            "'lissen'",
        ),
        (
            TIGER.replace("R: listen : * : * : * -1", "R: listen : * : * : * x"),
            "line 15",
            "a number",
        ),
        (TIGER.replace("states: left right", ""), "line 7", "states"),
        (
            TIGER.replace("0.85 0.15", "1.85 0.15"),
            "line 11, column 1",
            "probability",
        ),
        (
            TIGER.replace("states: left right", "states: left left"),
            "line 4",
            "twice",
        ),
        (
            "discount: 0.9 states: 99999 actions: 9999 observations: 99".into(),
            "line 1",
            "entries",
        ),
    ];
    for (text, place, part) in cases {
        let message = Pomdp::parse(&text).unwrap_err().to_string();
        assert!(
            message.contains(place) && message.contains(part),
            "{place}, {part}: {message}"
        );
    }
}

#[test]
fn public_models_have_their_reference_values() {
    let Some(folder) = public::folder() else {
        return;
    };
    for (name, [.., qmdp, v_mdp]) in BOUNDS {
        let model = public::read(&folder, name);
        let solution = mdp::solve(&model).unwrap();
        let b0 = model.start();
        let got_mdp: f64 = b0
            .iter()
            .enumerate()
            .map(|(s, b)| b * solution.value(s))
            .sum();
        let mut values = vec![0.0; model.actions().len()];
        let choice = QMdp::new(solution).evaluate(b0, &mut values);
        let close = |got: f64, want: f64| (got - want).abs() <= 1e-6 * want.abs();
        assert!(
            close(got_mdp, v_mdp),
            "{name}: MDP {got_mdp}, reference {v_mdp}"
        );
        let got = values[choice.action];
        assert!(close(got, qmdp), "{name}: Q-MDP {got}, reference {qmdp}");
    }
}
