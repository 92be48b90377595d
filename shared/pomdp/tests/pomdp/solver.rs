//! The point-based solver against exact answers, itself, simulation, and public models.

use std::fmt::Write as _;

use proptest::prelude::*;
use vigil_pomdp::bounds::{blind, fib, tib};
use vigil_pomdp::solver::{EndReason, Options, Progress, SearchResult, solve};
use vigil_pomdp::{Budget, Pomdp};

use crate::public;
use crate::public::TIGER;
use crate::simulation::earned;

/// A dense model from weights; `order` permutes its states.
#[derive(Debug, Clone)]
struct Dense {
    n: usize,
    discount: f64,
    weights: Vec<u8>,
}

impl Dense {
    const ACTIONS: usize = 2;
    const SEEN: usize = 2;

    fn row(&self, at: usize, width: usize) -> Vec<f64> {
        let weight = |i: usize| {
            let w = self.weights[(at * 7 + i * 3) % self.weights.len()];
            // Many zeros: sparse beliefs, observations that cannot be.
            f64::from(if w.is_multiple_of(3) { 0 } else { w })
        };
        let row: Vec<f64> = (0..width)
            .map(|i| weight(i) + f64::from(u8::from(i == at % width)))
            .collect();
        let sum: f64 = row.iter().sum();
        row.iter().map(|w| w / sum).collect()
    }

    fn transition(&self, a: usize, s: usize) -> Vec<f64> {
        self.row(a * self.n + s, self.n)
    }

    fn seen(&self, a: usize, s: usize) -> Vec<f64> {
        self.row(50 + a * self.n + s, Self::SEEN)
    }

    fn reward(&self, a: usize, s: usize) -> f64 {
        f64::from(self.weights[(a * 11 + s * 5 + 2) % self.weights.len()]) - 100.0
    }

    fn model(&self, order: &[usize]) -> Pomdp {
        let n = self.n;
        let mut text = format!(
            "discount: {}\nstates: {n}\nactions: 2\nobservations: 2\nstart:",
            self.discount
        );
        let mut start = vec![0.0; n];
        start[..2].fill(0.5);
        let mut row = |values: Vec<f64>| {
            for value in values {
                write!(text, " {value:?}").unwrap();
            }
            text.push('\n');
        };
        row(order.iter().map(|&s| start[s]).collect());
        for a in 0..Self::ACTIONS {
            for (at, &s) in order.iter().enumerate() {
                let t = self.transition(a, s);
                writeln!(text, "T: {a} : {at}").unwrap();
                for &to in order {
                    write!(text, " {:?}", t[to]).unwrap();
                }
                writeln!(text, "\nO: {a} : {at}").unwrap();
                for p in self.seen(a, s) {
                    write!(text, " {p:?}").unwrap();
                }
                writeln!(text, "\nR: {a} : {at} : * : * {:?}", self.reward(a, s)).unwrap();
            }
        }
        Pomdp::parse(&text).unwrap()
    }
}

/// The best reward of `depth` steps, by trying everything.
fn exhaustive(model: &Pomdp, belief: &[f64], depth: usize) -> f64 {
    if depth == 0 {
        return 0.0;
    }
    let mut best = f64::NEG_INFINITY;
    for a in 0..model.actions().len() {
        let mut next = vec![0.0; belief.len()];
        let mut value = 0.0;
        for (s, b) in belief.iter().enumerate() {
            value += b * model.reward(s, a);
            for (to, p) in model.successors(s, a) {
                next[*to] += b * p;
            }
        }
        for o in 0..model.observations().len() {
            let joint: Vec<f64> = next
                .iter()
                .zip(model.likelihood(a, o))
                .map(|(b, z)| b * z)
                .collect();
            let mass: f64 = joint.iter().sum();
            if mass > 0.0 {
                let after: Vec<f64> = joint.iter().map(|b| b / mass).collect();
                value += model.discount() * mass * exhaustive(model, &after, depth - 1);
            }
        }
        best = best.max(value);
    }
    best
}

/// Solves; the budget ends after so many questions.
pub fn solved(model: &Pomdp, precision: f64, questions: usize) -> (SearchResult, Vec<Progress>) {
    let mut left = questions;
    let mut stop = || {
        left = left.saturating_sub(1);
        left == 0
    };
    let mut course = Vec::new();
    let options = Options {
        precision,
        ..Options::default()
    };
    let watch = &mut |p: &Progress| course.push(*p);
    let found = solve(model, &options, &mut Budget::new(&mut stop), watch).unwrap();
    (found, course)
}

fn demand_order(name: &str, model: &Pomdp, found: &SearchResult, course: &[Progress]) {
    let mut never = || false;
    let mut budget = Budget::new(&mut never);
    let fast = fib::solve(model, &mut budget).unwrap().value(model.start());
    let lower = blind::solve(model, &mut budget)
        .unwrap()
        .value(model.start());
    let bracket = found.bracket;
    assert!(
        lower <= bracket.lower && bracket.upper <= fast,
        "{name}: {bracket:?}"
    );
    assert!(bracket.lower <= bracket.upper, "{name}: {bracket:?}");
    for pair in course.windows(2) {
        let (before, after) = (pair[0].bracket, pair[1].bracket);
        assert!(before.lower <= after.lower, "{name}: the lower bound fell");
        assert!(before.upper >= after.upper, "{name}: the upper bound rose");
    }
}

#[test]
fn tiger_is_solved() {
    let model = Pomdp::parse(TIGER).unwrap();
    let (found, course) = solved(&model, 1e-7, usize::MAX);
    assert_eq!(found.ended, EndReason::Precision);
    assert!(found.bracket.gap() <= 1e-7);
    assert!((found.bracket.lower - 19.371_368).abs() < 1e-6, "{found:?}");
    demand_order("tiger", &model, &found, &course);
}

#[test]
fn a_simulated_policy_earns_the_lower_bound() {
    let model = Pomdp::parse(TIGER).unwrap();
    let (found, _) = solved(&model, 0.1, usize::MAX);
    let vectors = found.vectors.clone().unwrap();
    assert!((vectors.value(model.start()) - found.bracket.lower).abs() < 1e-6);
    let (mean, sigma) = earned(&model, &vectors, 2000, 1e-4);
    // What is cut off after the last step: at most 1e-4 of 200.
    assert!(
        mean >= found.bracket.lower - 3.0 * sigma - 0.02,
        "{mean} +- {sigma}"
    );
    assert!(
        mean <= found.bracket.upper + 3.0 * sigma + 0.02,
        "{mean} +- {sigma}"
    );
}

#[test]
fn a_budget_that_ends_leaves_a_valid_bracket() {
    let model = Pomdp::parse(TIGER).unwrap();
    let mut last = f64::INFINITY;
    for questions in [1, 2, 3, 5, 10, 30] {
        let (found, _) = solved(&model, 0.0, questions);
        let bracket = found.bracket;
        assert!(
            bracket.lower <= 19.371_37 && bracket.upper >= 19.371_36,
            "{bracket:?}"
        );
        assert!(bracket.gap() <= last);
        last = bracket.gap();
    }
    assert!(last < 4000.0);
}

#[test]
fn the_same_model_takes_the_same_course() {
    let model = Pomdp::parse(TIGER).unwrap();
    assert_eq!(
        solved(&model, 1e-5, usize::MAX),
        solved(&model, 1e-5, usize::MAX)
    );
    assert_eq!(solved(&model, 0.0, 50), solved(&model, 0.0, 50));
}

#[test]
fn a_discount_of_one_is_refused() {
    let model = Pomdp::parse(&TIGER.replace("0.95", "1")).unwrap();
    let mut never = || false;
    let mut budget = Budget::new(&mut never);
    assert!(solve(&model, &Options::default(), &mut budget, &mut |_| ()).is_err());
}

fn dense() -> impl Strategy<Value = Dense> {
    let weights = prop::collection::vec(1_u8..=200, 40..60);
    (2_usize..5, weights).prop_map(|(n, weights)| Dense {
        n,
        discount: 0.5,
        weights,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_bracket_holds_the_value_of_trying_everything(dense in dense()) {
        let model = dense.model(&(0..dense.n).collect::<Vec<_>>());
        let (found, course) = solved(&model, 1e-3, 2000);
        let depth = 9;
        let value = exhaustive(&model, model.start(), depth);
        // Rewards are -100 to 100.
        let rest = 0.5_f64.powi(9) * 100.0 / 0.5;
        prop_assert!(found.bracket.lower <= value + rest && value - rest <= found.bracket.upper);
        prop_assert!(found.bracket.gap() < 0.1, "{:?}", found.bracket);
        demand_order("dense", &model, &found, &course);
    }

    #[test]
    fn the_order_of_states_does_not_matter(dense in dense(), turn in 1_usize..4) {
        let order: Vec<usize> = (0..dense.n).collect();
        let turned: Vec<usize> = (0..dense.n).map(|s| (s + turn) % dense.n).rev().collect();
        let all = |order: &[usize]| {
            let model = dense.model(order);
            let mut never = || false;
            let mut budget = Budget::new(&mut never);
            let b0 = model.start();
            [
                blind::solve(&model, &mut budget).unwrap().value(b0),
                fib::solve(&model, &mut budget).unwrap().value(b0),
                tib::solve(&model, &mut budget).unwrap().value(b0),
                solved(&model, 1e-2, 2000).0.bracket.lower,
                solved(&model, 1e-2, 2000).0.bracket.upper,
            ]
        };
        let tolerance = [1e-9, 1e-9, 1e-9, 2e-2, 2e-2];
        for ((one, other), tolerance) in all(&order).iter().zip(all(&turned)).zip(tolerance) {
            prop_assert!((one - other).abs() <= tolerance * one.abs().max(1.0), "{one} {other}");
        }
    }
}

/// File, precision that is reached, and questions (of some 20 us) that it may take.
const SOLVED: [(&str, f64, usize); 7] = [
    ("tiger.95", 1e-6, 5_000),
    ("tiger.aaai", 1e-6, 5_000),
    ("cheese.95", 1e-5, 5_000),
    ("mini-hall2", 1e-5, 5_000),
    ("shuttle95-zmdp", 1e-3, 5_000),
    ("paint95-zmdp", 1e-6, 5_000),
    ("4x3.95", 1e-3, 25_000),
];

/// File, questions, and the gap that is left at most; the bars of longer runs are for the bench.
const NARROWED: [(&str, usize, f64); 7] = [
    ("hallway", 20_000, 0.25),
    ("tiger-grid", 20_000, 0.6),
    ("network", 15_000, 4.0),
    ("web-ad", 10_000, 2e-3),
    ("cheng.D3-5", 5_000, 700.0),
    ("bridge-repair", 5_000, 20_000.0),
    ("machine", 20_000, 600.0),
];

#[test]
fn public_models_are_solved_or_narrowed() {
    let Some(folder) = public::folder() else {
        return;
    };
    for (name, precision, questions) in SOLVED {
        let model = public::read(&folder, name);
        let (found, course) = solved(&model, precision, questions);
        assert_eq!(
            found.ended,
            EndReason::Precision,
            "{name}: {:?}",
            found.bracket
        );
        demand_order(name, &model, &found, &course);
    }
    for (name, questions, gap) in NARROWED {
        let model = public::read(&folder, name);
        let (found, course) = solved(&model, 0.0, questions);
        assert!(found.bracket.gap() <= gap, "{name}: {:?}", found.bracket);
        demand_order(name, &model, &found, &course);
    }
}
