//! The point-based solver on models of unusual shapes: large, tiny, with many actions.

use std::fmt::Write as _;

use vigil_pomdp::bounds::{SolveError, fib, tib};
use vigil_pomdp::solver::{Options, SearchResult, solve};
use vigil_pomdp::{Budget, Pomdp};

/// Solves; the budget ends after so many questions.
fn solved(model: &Pomdp, questions: usize) -> SearchResult {
    let mut left = questions;
    let mut stop = || {
        left = left.saturating_sub(1);
        left == 0
    };
    let options = Options {
        precision: 1e-4,
        ..Options::default()
    };
    solve(model, &options, &mut Budget::new(&mut stop), &mut |_| ()).unwrap()
}

/// Every step leads anywhere; looking tells whether it was to state 0, where acting pays.
fn anywhere(states: usize) -> Pomdp {
    let text = format!(
        "discount: 0.95 states: {states} actions: act look observations: 2
        T: * uniform O: act uniform O: look : * 0 1 O: look : 0 1 0
        R: act : * : * : * -1 R: act : 0 : * : * 100"
    );
    Pomdp::parse(&text).unwrap()
}

/// Its value: what is known is nothing, "in state 0", or "elsewhere".
fn anywhere_value(states: usize) -> f64 {
    let (n, discount) = (states as f64, 0.95);
    let (mut nothing, mut here, mut elsewhere) = (0.0, 0.0, 0.0);
    for _ in 0..2000 {
        let look = discount * (here + (n - 1.0) * elsewhere) / n;
        (nothing, here, elsewhere) = (
            f64::max(101.0 / n - 1.0 + discount * nothing, look),
            f64::max(100.0 + discount * nothing, look),
            f64::max(-1.0 + discount * nothing, look),
        );
    }
    nothing
}

#[test]
fn a_plan_too_large_to_be_tied_is_left_untied() {
    // A state more is where one part of a controller exceeds its memory.
    for states in [300, 500] {
        let found = solved(&anywhere(states), 50_000);
        let value = anywhere_value(states);
        let bracket = found.bracket;
        assert!(
            bracket.lower <= value && value <= bracket.upper,
            "{bracket:?} {value}"
        );
        assert!(bracket.gap() < 0.01, "{states}: {bracket:?}, {value}");
        assert!(found.progress.rounds > 0);
    }
}

/// Eight random successors and five random observations of each state.
fn sparse(states: usize, observations: usize) -> Pomdp {
    let mut text =
        format!("discount: 0.99 states: {states} actions: 4 observations: {observations}\n");
    let mut last = 1_u64;
    let mut pick = |below: usize| {
        last = last.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (last >> 33) as usize % below
    };
    for a in 0..4 {
        for s in 0..states {
            for (table, width, count) in [("T", states, 8), ("O", observations, 5)] {
                let mut to: Vec<usize> = (0..count).map(|_| pick(width)).collect();
                to.sort_unstable();
                to.dedup();
                for one in &to {
                    let p = 1.0 / to.len() as f64;
                    writeln!(text, "{table}: {a} : {s} : {one} {p:?}").unwrap();
                }
            }
            writeln!(text, "R: {a} : {s} : * : * {}", pick(13)).unwrap();
        }
    }
    Pomdp::parse(&text).unwrap()
}

#[test]
fn thousands_of_states_leave_a_bracket_whenever_time_ends() {
    let model = sparse(3000, 40);
    let mut last = f64::INFINITY;
    for questions in [1, 100, 30_000] {
        let found = solved(&model, questions);
        let bracket = found.bracket;
        assert!(bracket.lower <= bracket.upper && bracket.lower >= 0.0);
        assert!(bracket.upper <= 1200.0 + 1e-2, "{bracket:?}");
        assert!(bracket.gap() <= last, "{questions}: {bracket:?} {last}");
        last = bracket.gap();
        if questions == 30_000 {
            assert!(found.progress.rounds > 0 && found.vectors.is_some());
        }
    }
    assert!(last < 1200.0);
}

#[test]
fn one_of_everything_is_solved_at_any_discount() {
    for discount in [0.0, 0.5, 0.999_999] {
        let text = format!(
            "discount: {discount} states: 1 actions: 1 observations: 1
            T: * identity O: * uniform R: 0 : * : * : * 3"
        );
        let bracket = solved(&Pomdp::parse(&text).unwrap(), 1000).bracket;
        let value = 3.0 / (1.0 - discount);
        assert!(
            bracket.lower <= value && value <= bracket.upper,
            "{bracket:?}"
        );
        assert!(bracket.gap() <= 1e-4_f64.max(1e-6 * value), "{bracket:?}");
    }
}

#[test]
fn without_a_future_the_best_reward_counts() {
    let text = "discount: 0 states: 3 actions: 2 observations: 2 start: 0.2 0.3 0.5
        T: * uniform O: * uniform R: 0 : 0 : * : * 10 R: 1 : 2 : * : * 5";
    let bracket = solved(&Pomdp::parse(text).unwrap(), 1000).bracket;
    assert!(bracket.lower <= 2.5 && 2.5 <= bracket.upper && bracket.gap() <= 1e-4);
}

#[test]
fn what_the_tighter_bound_has_no_room_for_is_solved_without_it() {
    // 4 states, 1700 actions, 2 observations: 23 million values of what follows upon what.
    let text = "discount: 0.9 states: 4 actions: 1700 observations: 2
        T: * uniform O: * uniform R: 7 : 1 : * : * 4 R: 9 : * : * : * 0.5";
    let model = Pomdp::parse(text).unwrap();
    let mut never = || false;
    let mut budget = Budget::new(&mut never);
    let fast = fib::solve(&model, &mut budget).unwrap();
    let found = tib::solve_from(&model, &fast, &mut budget).unwrap_err();
    assert_eq!(found, SolveError::Entries(4 * 1700 * 2 * 1700));
    // Nothing is ever known: action 7 earns 1 a step.
    let bracket = solved(&model, 20_000).bracket;
    assert!(
        bracket.lower <= 10.0 && 10.0 <= bracket.upper,
        "{bracket:?}"
    );
    assert!(bracket.gap() < 1e-2, "{bracket:?}");
}

#[test]
fn what_is_observed_beside_a_problem_changes_nothing() {
    // The tiger in one of so many houses, seen from inside; a door leads into any. The start belief
    // is over all houses.
    for houses in [1, 2, 7] {
        let (mut states, mut seen, mut rules) = (String::new(), String::new(), String::new());
        for h in 0..houses {
            write!(states, " left{h} right{h}").unwrap();
            write!(seen, " hear-left{h} hear-right{h}").unwrap();
            for (side, other) in [("left", "right"), ("right", "left")] {
                for (o, p) in [(side, 0.85), (other, 0.15)] {
                    writeln!(rules, "O: listen : {side}{h} : hear-{o}{h} {p}").unwrap();
                    writeln!(rules, "O: open-left : {side}{h} : hear-{o}{h} 0.5").unwrap();
                    writeln!(rules, "O: open-right : {side}{h} : hear-{o}{h} 0.5").unwrap();
                }
                writeln!(rules, "R: open-{side} : {side}{h} : * : * -100").unwrap();
                writeln!(rules, "R: open-{side} : {other}{h} : * : * 10").unwrap();
            }
        }
        let text = format!(
            "discount: 0.95 states:{states} actions: listen open-left open-right
             observations:{seen} T: listen identity T: open-left uniform T: open-right uniform
             R: listen : * : * : * -1\n{rules}"
        );
        let bracket = solved(&Pomdp::parse(&text).unwrap(), 100_000).bracket;
        assert!(bracket.gap() < 1e-4, "{houses}: {bracket:?}");
        // That of the tiger alone.
        let value = 19.371_368_38;
        let is_inside = bracket.lower < value + 1e-8 && value - 1e-8 < bracket.upper;
        assert!(is_inside, "{houses}: {bracket:?}");
    }
}
