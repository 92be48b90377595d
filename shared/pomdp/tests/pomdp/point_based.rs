//! The point-based policy: what it says every action is worth.

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_pomdp::policy::{DespotOptions, Measure, PolicyKind};
use vigil_pomdp::solver::{Options, solve};
use vigil_pomdp::{AlphaVectors, Budget, PointBased, Policy, Pomdp, mdp};

use crate::public::TIGER;

const NAVIGATION: &str = include_str!("../models/navigation.pomdp");
const FAULTS: &str = include_str!("../models/faults.pomdp");

fn solved(model: &Pomdp, precision: f64) -> AlphaVectors {
    let options = Options {
        precision,
        ..Options::default()
    };
    let found = solve(
        model,
        &options,
        &mut Budget::new(&mut || false),
        &mut |_| (),
    );
    found.unwrap().vectors.unwrap()
}

/// R(b,a) + gamma sum_o p(o|b,a) V(b_o), V being the best of the vectors: dense, by the definition.
pub fn look_ahead(model: &Pomdp, vectors: &AlphaVectors, belief: &[f64], action: usize) -> f64 {
    let mut predicted = vec![0.0; belief.len()];
    let mut sum = 0.0;
    for (s, b) in belief.iter().enumerate() {
        sum += b * model.reward(s, action);
        for (to, p) in model.successors(s, action) {
            predicted[*to] += b * p;
        }
    }
    for o in 0..model.observations().len() {
        let column = model.likelihood(action, o);
        let next: Vec<f64> = predicted.iter().zip(column).map(|(b, z)| b * z).collect();
        sum += model.discount() * vectors.value(&next);
    }
    sum
}

/// Dense and sparse ones.
fn beliefs(states: usize) -> impl Iterator<Item = Vec<f64>> {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    (0..500).map(move |i| {
        let power = [1, 4, 16][i % 3];
        let mut b: Vec<f64> = (0..states)
            .map(|_| rng.random::<f64>().powi(power))
            .collect();
        let sum: f64 = b.iter().sum();
        b.iter_mut().for_each(|b| *b /= sum);
        b
    })
}

#[test]
fn values_are_those_of_one_step_of_planning_if_the_state_is_certain_else_at_most() {
    for (model, precision) in [(TIGER, 1e-3), (NAVIGATION, 0.3), (FAULTS, 0.3)] {
        let model = Pomdp::parse(model).unwrap();
        let (states, actions) = (model.states().len(), model.actions().len());
        let vectors = solved(&model, precision);
        let mut policy = PointBased::new(&model, &vectors).unwrap();
        let mut values = vec![0.0; actions];
        let certain = (0..states).map(|s| (0..states).map(|i| f64::from(i == s)).collect());
        let certain = certain.chain([model.start().to_vec()]);
        for (belief, is_exact) in certain
            .map(|b: Vec<f64>| (b, true))
            .chain(beliefs(states).map(|b| (b, false)))
        {
            let choice = policy.evaluate(&belief, &mut values);
            // Never less than the vectors, and by their action where that is the best.
            assert!(values[choice.action] >= vectors.value(&belief) - 1e-9);
            for (action, value) in values.iter().enumerate() {
                let wanted = look_ahead(&model, &vectors, &belief, action);
                assert!(*value <= wanted + 1e-6, "{action}: {value}, {wanted}");
                if is_exact {
                    assert!(*value >= wanted - 1e-6, "{action}: {value}, {wanted}");
                }
            }
        }
    }
}

#[test]
fn an_action_that_no_vector_begins_with_has_a_value() {
    let model = Pomdp::parse(TIGER).unwrap();
    // To listen for ever: -20 in both states.
    let vectors = AlphaVectors::new(2, 3, [(0, [-20.0, -20.0])]).unwrap();
    let mut policy = PointBased::new(&model, &vectors).unwrap();
    let mut values = [0.0; 3];
    // Opening the left door finds the tiger, or 10; then -20, discounted by .95.
    policy.evaluate(&[0.5, 0.5], &mut values);
    for (value, wanted) in values.iter().zip([-20.0, -64.0, -64.0]) {
        assert!((value - wanted).abs() < 1e-9, "{values:?}");
    }
    policy.evaluate(&[0.0, 1.0], &mut values);
    assert!((values[1] - (10.0 - 19.0)).abs() < 1e-9, "{values:?}");
    assert_eq!(policy.measure(), Measure::Value);
}

#[test]
fn the_policy_goes_by_its_name_and_needs_its_vectors() {
    let model = Pomdp::parse(TIGER).unwrap();
    let solution = mdp::solve(&model).unwrap();
    let kind: PolicyKind = "point-based".parse().unwrap();
    assert_eq!(
        (kind.to_string(), kind.is_dual()),
        ("point-based".into(), false)
    );
    let options = DespotOptions::default();
    let build = |solved| kind.build(&model, &solution, |_| unreachable!(), solved, &options);
    let error = build(None).err().unwrap().to_string();
    assert!(error.contains("solved beforehand"), "{error}");
    let policy = PointBased::new(&model, &solved(&model, 1e-6)).unwrap();
    let mut decider = build(Some(&policy)).unwrap();
    let decision = decider.decide(&[0.5, 0.5]);
    assert_eq!((decision.action, decision.measure), (0, Measure::Value));
    assert!((decider.values()[0] - 19.371_368).abs() < 1e-5);
    let wrong = "dm-point-based"
        .parse::<PolicyKind>()
        .unwrap_err()
        .to_string();
    assert!(
        wrong.ends_with("adm-X of each, despot, and point-based"),
        "{wrong}"
    );
}

proptest! {
    #[test]
    fn any_vectors_make_a_policy_with_finite_values_or_are_refused(
        values in prop::collection::vec(any::<f64>(), 2..12), first in 0_usize..4
    ) {
        let model = Pomdp::parse(TIGER).unwrap();
        let rows = values.chunks_exact(2).enumerate().map(|(i, v)| ((first + i) % 4, v));
        let Ok(vectors) = AlphaVectors::new(2, 4, rows) else { return Ok(()) };
        if let Ok(mut policy) = PointBased::new(&model, &vectors) {
            let mut values = [f64::NAN; 3];
            let choice = policy.evaluate(&[0.25, 0.75], &mut values);
            prop_assert!(values.iter().all(|v| v.is_finite()) && choice.action < 3);
        }
    }
}

#[test]
fn an_action_that_shows_a_part_of_the_state_is_answered_part_by_part() {
    // Two parts of two states; action 0 is worth most in the first part, by one plan or another.
    let vectors = [
        (0, vec![4.0, 4.0, -9.0, -9.0]),
        (0, vec![-9.0, -9.0, 3.0, 1.0]),
        (1, vec![1.0, 1.0, 1.0, 1.0]),
    ];
    let text = "discount: 0.5\nvalues: reward\nstates: 4\nactions: 2\nobservations: 1\n\
                T: * identity\nO: * uniform\nR: * : * : * : * -20\n";
    let model = Pomdp::parse(text).unwrap();
    let vectors = AlphaVectors::new(4, 2, vectors).unwrap();
    let belief = [0.25, 0.25, 0.25, 0.25];
    let mut values = [0.0; 2];
    let mut plain = PointBased::new(&model, &vectors).unwrap();
    assert_eq!(plain.evaluate(&belief, &mut values).action, 1);
    assert_eq!(values, [-2.5, 1.0]);
    let part_of = [0, 0, 1, 1];
    let mut shown = plain.clone().shown(&part_of, &[true, false]);
    assert_eq!(shown.evaluate(&belief, &mut values).action, 0);
    assert_eq!(values, [3.0, 1.0], "0.5 * 4 + 0.25 * 3 + 0.25 * 1");
    // A robot that stands is shown nothing; where the part is known there is nothing to show.
    let mut standing = plain.clone().shown(&part_of, &[false, false]);
    standing.evaluate(&belief, &mut values);
    assert_eq!(values, [-2.5, 1.0]);
    let known = [0.5, 0.5, 0.0, 0.0];
    shown.evaluate(&known, &mut values);
    let of_shown = values;
    plain.evaluate(&known, &mut values);
    assert_eq!(values, of_shown);
}
