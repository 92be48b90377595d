//! The planner against exact solutions, its limits, and input that no tracker gives.

use proptest::prelude::*;
use vigil_pomdp::policy::{DespotError, DespotOptions, Measure, PolicyKind};
use vigil_pomdp::solver::{Options, solve};
use vigil_pomdp::{AlphaVectors, Budget, Despot, PointBased, Policy, Pomdp, mdp};

use crate::point_based::look_ahead;
use crate::public::TIGER;

/// Look at a lamp, or say which it is. Nothing moves.
const LAMP: &str = "discount: 0.6\nvalues: reward\nstates: red green blue\n\
    actions: look red green blue\nobservations: warm cold\nstart: 0.5 0.3 0.2\nT: * identity\n\
    O: * uniform\nO: look\n0.9 0.1\n0.2 0.8\n0.4 0.6\nR: look : * : * : * -1\n\
    R: red : * : * : * -8\nR: red : red : * : * 1\nR: green : * : * : * -8\n\
    R: green : green : * : * 1\nR: blue : * : * : * -8\nR: blue : blue : * : * 1\n";

fn parse(text: &str) -> Pomdp {
    Pomdp::parse(text).unwrap()
}

fn exact(model: &Pomdp) -> AlphaVectors {
    let options = Options {
        precision: 1e-6,
        ..Options::default()
    };
    let mut never = || false;
    let found = solve(model, &options, &mut Budget::new(&mut never), &mut |_| ());
    found.unwrap().vectors.unwrap()
}

fn planner(model: &Pomdp, options: &DespotOptions) -> Despot {
    Despot::new(model, &mdp::solve(model).unwrap(), None, options).unwrap()
}

fn options(scenarios: usize, trials: usize) -> DespotOptions {
    DespotOptions {
        scenarios,
        trials,
        ..DespotOptions::default()
    }
}

/// The exact value of every action, one step and then the best.
fn exact_values(model: &Pomdp, vectors: &AlphaVectors, belief: &[f64]) -> Vec<f64> {
    let actions = 0..model.actions().len();
    actions
        .map(|action| look_ahead(model, vectors, belief, action))
        .collect()
}

#[test]
fn a_tiger_is_listened_to_in_doubt_and_its_choices_are_those_of_the_exact_policy() {
    let model = parse(TIGER);
    let vectors = exact(&model);
    let mut policy = planner(&model, &options(100, 300));
    let mut values = [0.0; 3];
    assert_eq!(policy.evaluate(&[0.5, 0.5], &mut values).action, 0);
    assert_eq!(policy.measure(), Measure::Value);
    assert_eq!(policy.evaluate(&[0.97, 0.03], &mut values).action, 2);
    assert_eq!(policy.evaluate(&[0.03, 0.97], &mut values).action, 1);
    let mut agreed = 0;
    for step in 0..=200 {
        let left = f64::from(step) / 200.0;
        let belief = [left, 1.0 - left];
        let action = policy.evaluate(&belief, &mut values).action;
        let worth = exact_values(&model, &vectors, &belief);
        let best = worth.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // Near a threshold two actions are worth nearly the same.
        assert!(best - worth[action] < 0.5, "{left}: {action} of {worth:?}");
        agreed += u32::from(best - worth[action] < 1e-9);
    }
    assert!(agreed >= 195, "{agreed} of 201");
}

#[test]
fn with_a_scenario_for_each_state_the_bounds_hold_the_exact_value_and_close() {
    for belief in [
        [0.5, 0.3, 0.2],
        [0.2, 0.4, 0.4],
        [0.0, 0.5, 0.5],
        [0.01, 0.98, 0.01],
    ] {
        // A solver is exact at the start belief.
        let [red, green, blue] = belief;
        let start = format!("start: {red} {green} {blue}");
        let model = parse(&LAMP.replace("start: 0.5 0.3 0.2", &start));
        let value = exact(&model).value(&belief);
        let mut policy = planner(&model, &options(7, 1));
        let mut values = [0.0; 4];
        policy.evaluate(&belief, &mut values);
        let mut before = policy.bounds().unwrap();
        for _ in 0..40 {
            policy.search(50);
            let (lower, upper) = policy.bounds().unwrap();
            assert!(
                lower <= value + 1e-6 && value <= upper + 1e-6,
                "{lower} {value} {upper}"
            );
            assert!(lower >= before.0 - 1e-9 && upper <= before.1 + 1e-9);
            before = (lower, upper);
        }
        assert!(before.1 - before.0 < 0.2, "{before:?}");
        let choice = policy.evaluate(&belief, &mut values);
        let (lower, upper) = policy.action_bounds(choice.action).unwrap();
        assert!(lower <= upper && values[choice.action] >= lower - 1e-12);
    }
}

#[test]
fn equal_seeds_and_calls_give_equal_bits_whatever_was_decided_before() {
    let model = parse(LAMP);
    // Fewer scenarios than states, so that there is something to sample.
    let seeded = |seed| {
        let options = DespotOptions {
            seed,
            ..options(2, 20)
        };
        planner(&model, &options)
    };
    let mut values = [0.0; 4];
    let mut bits = |policy: &mut Despot, belief: &[f64]| {
        policy.evaluate(belief, &mut values);
        policy.improve(belief);
        policy.improve(belief);
        policy.evaluate(belief, &mut values);
        values.map(f64::to_bits)
    };
    let (mut one, mut same, mut other) = (seeded(1), seeded(1), seeded(2));
    let mut differs = false;
    for red in [0.5, 0.35, 0.1, 0.6, 0.3] {
        let belief = [red, 0.7 - red, 0.3];
        let ours = bits(&mut one, &belief);
        assert_eq!(ours, bits(&mut same, &belief));
        assert_eq!(ours, bits(&mut seeded(1), &belief));
        differs |= ours != bits(&mut other, &belief);
    }
    assert!(differs);
    let first = bits(&mut one, &[0.5, 0.2, 0.3]);
    one.reset();
    assert_eq!(first, bits(&mut one, &[0.5, 0.2, 0.3]));
}

#[test]
fn spare_time_improves_the_plan_for_the_belief_that_stands() {
    let model = parse(LAMP);
    let mut policy = planner(&model, &options(7, 2));
    let (belief, mut values) = ([0.5, 0.3, 0.2], [0.0; 4]);
    policy.evaluate(&belief, &mut values);
    let planned = policy.bounds();
    // The decision itself was this cycle's share.
    policy.improve(&belief);
    assert_eq!(policy.bounds(), planned);
    for _ in 0..200 {
        policy.improve(&belief);
    }
    assert!(policy.bounds().unwrap().0 > planned.unwrap().0 + 1e-3);
    let better = policy.bounds();
    policy.evaluate(&belief, &mut values);
    assert_eq!(policy.bounds(), better);
    // A belief that hardly moves keeps its plan, another does not.
    policy.evaluate(&[0.5005, 0.2995, 0.2], &mut values);
    assert_eq!(policy.bounds(), better);
    policy.evaluate(&[0.4, 0.4, 0.2], &mut values);
    assert_ne!(policy.bounds(), better);
}

#[test]
fn a_tree_without_room_decides_by_the_plans_that_are_known() {
    let model = parse(TIGER);
    let mut values = [0.0; 3];
    for nodes in 1..=6 {
        let mut policy = planner(
            &model,
            &DespotOptions {
                nodes,
                ..options(10, 5)
            },
        );
        let choice = policy.evaluate(&[0.5, 0.5], &mut values);
        assert!(!policy.search(1) && policy.action_bounds(0).is_none());
        assert_eq!(choice.action, 0);
        // To listen for ever costs 1 a step.
        assert!((values[0] + 20.0).abs() < 1e-9, "{values:?}");
    }
    let mut policy = planner(
        &model,
        &DespotOptions {
            nodes: 7,
            ..options(10, 5)
        },
    );
    policy.evaluate(&[0.5, 0.5], &mut values);
    assert!(!policy.search(1) && policy.action_bounds(2).is_some());
}

#[test]
fn without_a_discount_a_goal_ends_what_is_planned() {
    let model = parse(
        "discount: 1\nvalues: cost\nstates: away home\nactions: walk fly\nobservations: 1\n\
         start: away\nT: walk\n0.5 0.5\n0 1\nT: fly\n0 1\n0 1\nO: * uniform\n\
         R: walk : away : * : * 1\nR: fly : away : * : * 3\n",
    );
    // To walk takes two steps on average.
    let mut policy = planner(&model, &options(2, 200));
    let mut values = [0.0; 2];
    let choice = policy.evaluate(&[1.0, 0.0], &mut values);
    assert_eq!(choice.action, 0);
    let (lower, upper) = policy.bounds().unwrap();
    assert!(
        (-2.001..=-1.999).contains(&lower) && upper >= lower,
        "{lower} {upper}"
    );
    assert!((values[1] + 3.0).abs() < 1e-9, "{values:?}");
}

#[test]
fn a_plan_that_costs_more_than_it_gains_is_not_followed() {
    let model = parse(TIGER);
    let dear = DespotOptions {
        regularisation: 200.0,
        ..options(20, 50)
    };
    let mut values = [0.0; 3];
    let choice = planner(&model, &dear).evaluate(&[0.97, 0.03], &mut values);
    assert_eq!(choice.action, 0);
    assert!((values[0] + 20.0).abs() < 1e-9, "{values:?}");
}

#[test]
fn a_search_ends_with_what_a_solver_has_found() {
    let model = parse(TIGER);
    let vectors = exact(&model);
    let solved = PointBased::new(&model, &vectors).unwrap();
    let solution = mdp::solve(&model).unwrap();
    let mut policy = Despot::new(&model, &solution, Some(&solved), &options(2, 1)).unwrap();
    let mut values = [0.0; 3];
    policy.evaluate(&[0.5, 0.5], &mut values);
    assert!(values[0] >= vectors.value(&[0.5, 0.5]) - 1e-9, "{values:?}");
}

#[test]
fn the_planner_goes_by_its_name_and_refuses_what_no_search_can_do() {
    let model = parse(TIGER);
    let solution = mdp::solve(&model).unwrap();
    let kind: PolicyKind = "despot".parse().unwrap();
    assert_eq!(
        (kind, kind.to_string().as_str()),
        (PolicyKind::Despot, "despot")
    );
    let good = options(10, 10);
    let mut decider = kind
        .build(&model, &solution, |_| unreachable!(), None, &good)
        .unwrap();
    assert_eq!(decider.decide(&[0.5, 0.5]).action, 0);
    let refused = |change: fn(&mut DespotOptions)| {
        let mut wrong = options(10, 10);
        change(&mut wrong);
        Despot::new(&model, &solution, None, &wrong).unwrap_err()
    };
    assert_eq!(refused(|o| o.scenarios = 0), DespotError::Scenarios(0));
    assert_eq!(refused(|o| o.depth = 0), DespotError::Depth(0));
    assert_eq!(refused(|o| o.nodes = 0), DespotError::Nodes);
    assert_eq!(
        refused(|o| o.regularisation = -1.0),
        DespotError::Regularisation(-1.0)
    );
    assert!(matches!(
        refused(|o| o.regularisation = f64::NAN),
        DespotError::Regularisation(_)
    ));
    let large = refused(|o| o.nodes = usize::MAX);
    assert!(matches!(large, DespotError::Memory { .. }), "{large}");
    // Ten trials, three actions: two states with two successors; two observations of each, with
    // an upper and a lower bound of each action.
    let products = 10 * 3 * (2 * 2 + 2 * 2 * 6);
    assert_eq!(good.products(&model, None), products);
}

proptest! {
    #[test]
    fn no_belief_makes_it_panic(
        belief in prop::collection::vec(
            prop_oneof![any::<f64>(), Just(0.0), Just(1.0), 0.0..1.0], 0..6,
        ),
        seed in any::<u64>(),
    ) {
        let model = parse(LAMP);
        let mut policy = planner(&model, &DespotOptions { seed, nodes: 200, ..options(5, 10) });
        let mut values = [0.0; 4];
        for _ in 0..2 {
            let choice = policy.evaluate(&belief, &mut values);
            prop_assert!(choice.action < 4 && values.iter().all(|v| v.is_finite()));
            policy.improve(&belief);
        }
    }
}
