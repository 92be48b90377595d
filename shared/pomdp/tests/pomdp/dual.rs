//! Dual control against brute force over all observations, and its guards.

use proptest::prelude::*;
use vigil_pomdp::mdp::{self, Solution};
use vigil_pomdp::policy::{
    ActionVoting, Base, Decider, Dual, DualControl, DualError, Gate, Information, LookAhead,
    PolicyName, normalised_entropy,
};
use vigil_pomdp::{Choice, Control, Policy, Pomdp};

use crate::public::TIGER;

/// Four faults, of which the first two have one remedy; `look` shows a little, `restart` makes the
/// state certain at a price, and none of the rest shows anything.
const RESTART: &str = "
discount: 0.9 values: reward states: a b c d
actions: look mend-ab mend-c mend-d restart observations: x y
T: * identity
T: restart : * 1 0 0 0
O: * uniform
O: look : a : x 0.7 O: look : a : y 0.3 O: look : b : x 0.3 O: look : b : y 0.7
R: mend-ab : * : * : * -9 R: mend-ab : a : * : * 1 R: mend-ab : b : * : * 1
R: mend-c : * : * : * -9 R: mend-c : c : * : * 1
R: mend-d : * : * : * -9 R: mend-d : d : * : * 1
R: look : * : * : * -1 R: restart : * : * : * -50
";

fn solved(text: &str) -> (Pomdp, Solution) {
    let model = Pomdp::parse(text).unwrap();
    let solution = mdp::solve(&model).unwrap();
    (model, solution)
}

fn navigation() -> (Pomdp, Solution) {
    solved(include_str!("../models/navigation.pomdp"))
}

fn dual(of: &(Pomdp, Solution), settings: Dual) -> DualControl {
    let voting = Box::new(ActionVoting::new(&of.1));
    DualControl::new(voting, &of.0, &of.1, settings).unwrap()
}

/// Expected entropies of the next state and of the next votes, observation by observation.
fn brute_force((model, solution): &(Pomdp, Solution), belief: &[f64], action: usize) -> [f64; 2] {
    let mut predicted = vec![0.0; belief.len()];
    for (s, b) in belief.iter().enumerate() {
        for (to, p) in model.successors(s, action) {
            predicted[*to] += b * p;
        }
    }
    let mut expected = [0.0; 2];
    for z in 0..model.observations().len() {
        let likelihood = model.likelihood(action, z);
        let joint: Vec<f64> = predicted
            .iter()
            .zip(likelihood)
            .map(|(b, l)| b * l)
            .collect();
        let p: f64 = joint.iter().sum();
        if p == 0.0 {
            continue;
        }
        let next: Vec<f64> = joint.iter().map(|u| u / p).collect();
        let mut votes = vec![0.0; model.actions().len()];
        for (s, b) in next.iter().enumerate() {
            votes[solution.best(s)] += b;
        }
        expected[0] += p * normalised_entropy(&next);
        expected[1] += p * normalised_entropy(&votes);
    }
    expected
}

proptest! {
    #[test]
    fn expected_entropies_are_those_of_brute_force(
        weights in prop::collection::vec(prop_oneof![1 => Just(0.0), 4 => 1e-9..1.0_f64], 7)
    ) {
        for of in [navigation(), solved(TIGER), solved(RESTART)] {
            let states = of.0.states().len();
            let sum: f64 = weights[..states].iter().sum();
            prop_assume!(sum > 0.0);
            let belief: Vec<f64> = weights[..states].iter().map(|w| w / sum).collect();
            let actions = of.0.actions().len();
            let mut look_ahead = LookAhead::new(&of.0, &of.1);
            let (mut state, mut action) = (vec![0.0; actions], vec![0.0; actions]);
            look_ahead.state_entropies(&belief, &mut state);
            look_ahead.action_entropies(&belief, &mut action);
            for a in 0..actions {
                let expected = brute_force(&of, &belief, a);
                prop_assert!((state[a] - expected[0]).abs() < 1e-12, "{a}: {state:?}");
                prop_assert!((action[a] - expected[1]).abs() < 1e-12, "{a}: {action:?}");
            }
        }
    }
}

#[test]
fn a_tiger_is_listened_to_until_it_is_certain_enough() {
    let of = solved(TIGER);
    let mut policy = dual(&of, Dual::new(Information::State, 0.5));
    let mut values = [0.0; 3];
    let choice = policy.evaluate(&[0.5, 0.5], &mut values);
    assert_eq!((choice.action, choice.control), (0, Control::Dual));
    // After listening 85 to 15, after opening a door as before.
    let entropy = normalised_entropy(&[0.85, 0.15]);
    assert!((entropy - 0.609_840_304_7).abs() < 1e-9);
    assert!((values[0] + entropy).abs() < 1e-12 && (values[1] + 1.0).abs() < 1e-12);
    assert!((choice.margin - (1.0 - entropy)).abs() < 1e-12);
    let once = policy.evaluate(&[0.85, 0.15], &mut values);
    assert_eq!((once.action, once.control), (0, Control::Dual));
    // Heard twice on the left: 0.97, entropy 0.19; its door stays shut.
    let twice = policy.evaluate(&[0.97, 0.03], &mut values);
    assert_eq!((twice.action, twice.control), (2, Control::Policy));
    assert_eq!(values, [0.0, 0.03, 0.97]);
}

#[test]
fn what_teaches_as_much_goes_to_the_votes() {
    let of = solved(RESTART);
    let mut settings = Dual::new(Information::State, 0.1);
    settings.allowed = Some(vec![3, 1, 2]);
    let mut values = [0.0; 5];
    let choice = dual(&of, settings).evaluate(&[0.0, 0.0, 0.5, 0.5], &mut values);
    // Half of the belief votes for mend-c, half for mend-d, none for mend-ab.
    assert_eq!((choice.action, choice.margin), (2, 0.0));
}

#[test]
fn a_restart_is_no_way_to_learn_unless_it_is_declared_one() {
    let of = solved(RESTART);
    let belief = [0.5, 0.5, 0.0, 0.0];
    let mut values = [0.0; 5];
    let mut settings = Dual::as_published(Information::State, 0.3);
    let published = dual(&of, settings.clone()).evaluate(&belief, &mut values);
    assert_eq!((published.action, published.control), (4, Control::Dual));
    assert!(values[4].abs() < 1e-12, "the state is certain after it");
    settings.allowed = Some(vec![0]);
    let declared = dual(&of, settings).evaluate(&belief, &mut values);
    assert_eq!((declared.action, declared.control), (0, Control::Dual));
}

#[test]
fn the_gate_is_the_entropy_that_is_lowered_or_as_published_that_of_the_state() {
    let of = solved(RESTART);
    // Uncertain about the state, certain about the action.
    let belief = [0.5, 0.5, 0.0, 0.0];
    let mut values = [0.0; 5];
    let mut control = |settings| dual(&of, settings).evaluate(&belief, &mut values).control;
    assert_eq!(control(Dual::new(Information::State, 0.3)), Control::Dual);
    assert_eq!(
        control(Dual::new(Information::Action, 0.3)),
        Control::Policy
    );
    let published = Dual::as_published(Information::Action, 0.3);
    assert_eq!(published.gate, Gate::State);
    assert_eq!(control(published), Control::Dual);
    // The entropy is 0.5 exactly: at the threshold is not above it, and 1 is never above.
    assert_eq!(control(Dual::new(Information::State, 0.5)), Control::Policy);
    assert_eq!(control(Dual::new(Information::State, 1.0)), Control::Policy);
}

#[test]
fn where_nothing_is_learnt_the_policy_acts_until_the_entropy_has_fallen() {
    let of = solved(RESTART);
    let mut settings = Dual::new(Information::State, 0.3);
    (settings.allowed, settings.stall_steps) = (Some(vec![0]), 2);
    let mut policy = dual(&of, settings);
    let mut values = [0.0; 5];
    let mut control = |policy: &mut DualControl, belief: [f64; 4]| {
        let choice = policy.evaluate(&belief, &mut values);
        assert_eq!(choice.control == Control::Dual, choice.action == 0);
        choice.control
    };
    // `look` says nothing about c and d.
    let stuck = [0.0, 0.0, 0.6, 0.4];
    let run: Vec<Control> = (0..5).map(|_| control(&mut policy, stuck)).collect();
    let (dual, stalled) = (Control::Dual, Control::Stalled);
    assert_eq!(run, [dual, dual, stalled, stalled, stalled]);
    // It falls a little: information is worth a try again, for as long.
    let fallen = [0.0, 0.0, 0.65, 0.35];
    let run: Vec<Control> = (0..4).map(|_| control(&mut policy, fallen)).collect();
    assert_eq!(run, [dual, dual, stalled, stalled]);
    policy.reset();
    assert_eq!(control(&mut policy, stuck), dual);
    // Certain in between: a new run.
    assert_eq!(control(&mut policy, [0.0, 0.0, 1.0, 0.0]), Control::Policy);
    assert_eq!(control(&mut policy, stuck), dual);
}

#[test]
fn settings_that_mean_nothing_are_refused() {
    let (model, solution) = solved(TIGER);
    let refused = |change: fn(&mut Dual)| {
        let mut settings = Dual::new(Information::State, 0.5);
        change(&mut settings);
        let voting = Box::new(ActionVoting::new(&solution));
        DualControl::new(voting, &model, &solution, settings)
            .err()
            .unwrap()
    };
    assert_eq!(refused(|d| d.threshold = 1.5), DualError::Threshold(1.5));
    assert!(matches!(
        refused(|d| d.threshold = f64::NAN),
        DualError::Threshold(_)
    ));
    assert_eq!(refused(|d| d.allowed = Some(vec![])), DualError::NoAction);
    let (found, actions) = (3, 3);
    assert_eq!(
        refused(|d| d.allowed = Some(vec![3])),
        DualError::Action { found, actions }
    );
}

#[test]
fn names_are_read_as_they_are_written_and_others_refused() {
    let prefixes = ["", "dm-", "adm-"];
    let names = prefixes
        .iter()
        .flat_map(|p| Base::ALL.map(|(_, x)| format!("{p}{x}")));
    let mut count = 0;
    for name in names {
        assert_eq!(name.parse::<PolicyName>().unwrap().to_string(), name);
        count += 1;
    }
    assert_eq!(count, 12);
    for wrong in ["", "dm-", "dm-dm-av", "QMDP", "qmdp ", "luck"] {
        let message = wrong.parse::<PolicyName>().unwrap_err().to_string();
        assert!(message.contains("mls, av, qmdp, fib"), "{message}");
    }
}

#[test]
fn a_decision_carries_what_explains_it() {
    let (model, solution) = solved(RESTART);
    let name: PolicyName = "dm-qmdp".parse().unwrap();
    let mut decider: Decider = name
        .build(&model, &solution, |i| Dual::new(i, 0.6))
        .unwrap();
    let decision = decider.decide(&[0.4, 0.4, 0.2, 0.0]);
    assert_eq!(decision.control, Control::Dual);
    assert!((decider.votes()[1] - 0.8).abs() < 1e-15 && decider.votes()[2] == 0.2);
    let nats = -(0.8 * f64::ln(0.8) + 0.2 * f64::ln(0.2));
    assert!((decision.action_entropy - nats / 5_f64.ln()).abs() < 1e-12);
    let nats = -(0.8 * f64::ln(0.4) + 0.2 * f64::ln(0.2));
    assert!((decision.state_entropy - nats / 4_f64.ln()).abs() < 1e-12);
    let choice = decision.choice();
    assert_eq!(
        decider.values()[choice.action],
        decider
            .values()
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max)
    );
    let certain: Choice = decider.decide(&[0.0, 0.0, 1.0, 0.0]).choice();
    assert_eq!((certain.action, certain.control), (2, Control::Policy));
    let q: Vec<f64> = (0..5).map(|a| solution.q(2, a)).collect();
    assert_eq!(decider.values(), q);
}

/// Q(s,a) = R(s,a) + gamma sum_z max_a' sum_s' T Z Q(s',a'), 3,000 sweeps from 0.
fn fast_informed_bound(model: &Pomdp) -> Vec<Vec<f64>> {
    let (states, actions) = (model.states().len(), model.actions().len());
    let mut q = vec![vec![0.0; states]; actions];
    for _ in 0..3000 {
        let old = q.clone();
        for (a, row) in q.iter_mut().enumerate() {
            for (s, slot) in row.iter_mut().enumerate() {
                let mut sum = 0.0;
                for z in 0..model.observations().len() {
                    let mut best = f64::NEG_INFINITY;
                    for next in &old {
                        let mut value = 0.0;
                        for (to, p) in model.successors(s, a) {
                            value += p * model.likelihood(a, z)[*to] * next[*to];
                        }
                        best = best.max(value);
                    }
                    sum += best;
                }
                *slot = model.reward(s, a) + model.discount() * sum;
            }
        }
    }
    q
}

#[test]
fn the_informed_policy_has_the_values_of_its_bound() {
    for of in [solved(TIGER), navigation()] {
        let (model, solution) = &of;
        let expected = fast_informed_bound(model);
        let mut policy = Base::FastInformed.build(model, solution).unwrap();
        let mut values = vec![0.0; model.actions().len()];
        policy.evaluate(model.start(), &mut values);
        for (value, q) in values.iter().zip(&expected) {
            let want: f64 = q.iter().zip(model.start()).map(|(q, b)| q * b).sum();
            assert!((value - want).abs() < 1e-9 * want.abs().max(1.0));
        }
    }
    // The published bound of the tiger at its start.
    let mut values = [0.0; 3];
    let (model, solution) = solved(TIGER);
    Base::FastInformed
        .build(&model, &solution)
        .unwrap()
        .evaluate(&[0.5, 0.5], &mut values);
    assert!((values[0] - 87.179_487_18).abs() < 1e-8, "{values:?}");
}
