//! Deep inspection: cheap repeated tests before an act that is dear to get wrong.

use vigil_pomdp::solver::{EndReason, compact, policy_value};
use vigil_pomdp::{AlphaVectors, Budget, Choice, Control, PointBased, Policy, Pomdp, QMdp, mdp};

use crate::public::{self, TIGER};
use crate::simulation::earned;
use crate::solver::solved;

/// A model of `tests/models` at another discount.
fn at(text: &str, discount: f64) -> Pomdp {
    let line = format!("discount: {discount:?}");
    Pomdp::parse(&text.replace("discount: 0.95", &line)).unwrap()
}

/// Looks at a part before it is used.
const PART: &str = include_str!("../models/part.pomdp");
/// Tests of four parts before one is repaired, again and again.
const REPAIRS: &str = include_str!("../models/repairs.pomdp");

/// How often a look of `PART` is right, and its price.
const RIGHT: f64 = 0.75;
const LOOK: f64 = 0.1;

/// The value of `PART`, by value iteration over what matters: how many more looks said good.
fn value_of_part(discount: f64) -> f64 {
    const MOST: usize = 40;
    let p = |at: usize| {
        let odds = ((1.0 - RIGHT) / RIGHT).powi(at as i32 - MOST as i32);
        1.0 / (1.0 + odds)
    };
    let use_it = |at: usize| 110.0 * p(at) - 100.0;
    let mut values = vec![0.0; 2 * MOST + 1];
    for _ in 0..10_000 {
        let before = values.clone();
        for (at, value) in values.iter_mut().enumerate() {
            let plus = p(at) * RIGHT + (1.0 - p(at)) * (1.0 - RIGHT);
            let up = before[(at + 1).min(2 * MOST)];
            let down = before[at.saturating_sub(1)];
            let look = discount * (plus * up + (1.0 - plus) * down) - LOOK;
            *value = look.max(use_it(at)).max(0.0);
        }
    }
    values[MOST]
}

#[test]
fn looks_before_an_act_are_worth_what_counting_them_says() {
    for discount in [0.95, 0.99, 0.999, 0.9999] {
        let wanted = value_of_part(discount);
        let (found, _) = solved(&at(PART, discount), 1e-5, 40_000);
        let bracket = found.bracket;
        assert_eq!(found.ended, EndReason::Precision, "{discount}: {bracket:?}");
        let (lower, upper) = (bracket.lower - 1e-9, bracket.upper + 1e-9);
        assert!((lower..=upper).contains(&wanted), "{wanted}: {bracket:?}");
    }
}

#[test]
fn acts_again_and_again_are_solved_at_every_discount() {
    for discount in [0.95, 0.99, 0.999, 0.9999] {
        let (found, _) = solved(&at(REPAIRS, discount), 1e-6 / (1.0 - discount), 100_000);
        assert_eq!(found.ended, EndReason::Precision, "{:?}", found.bracket);
    }
    // An average of a reward a step does not depend on the discount by more than one repair.
    let values = [0.999, 0.9999].map(|discount| {
        let (found, _) = solved(&at(REPAIRS, discount), 1e-3, 100_000);
        found.bracket.lower * (1.0 - discount)
    });
    assert!((values[0] - values[1]).abs() < 20.0 * 1e-3, "{values:?}");
}

#[test]
fn a_policy_of_few_vectors_earns_what_is_said_of_it() {
    let tiger = Pomdp::parse(TIGER).unwrap();
    let mut models = vec![("tiger", tiger, 9), ("repairs", at(REPAIRS, 0.95), 60)];
    if let Some(folder) = public::folder() {
        models.push(("hallway", public::read(&folder, "hallway"), 60));
    }
    for (name, model, most) in models {
        let (found, _) = solved(&model, 1e-3, 20_000);
        let all = found.vectors.unwrap();
        let mut never = || false;
        let mut small = |most| compact(&model, &all, most, &mut Budget::new(&mut never)).unwrap();
        let few = small(most);
        assert!(few.vectors.len() <= most, "{name}");
        assert_eq!(few, small(most));
        let promised = all.value(model.start()) - few.loss_mean;
        let (mean, error) = earned(&model, &few.vectors, 2000, 1e-3);
        let rest = 1e-3 * 100.0 / (1.0 - model.discount());
        let error = error.hypot(few.loss_error);
        assert!(
            mean >= promised - 3.0 * error - rest,
            "{name}: {mean} {promised} {error}"
        );
        // Fewer are worth less, or as much.
        let fewer = small(2);
        assert!(fewer.vectors.len() <= 2);
        assert!(fewer.loss_mean >= few.loss_mean - 3.0 * error, "{name}");
    }
}

/// One action for ever.
struct Always(usize);

impl Policy for Always {
    fn evaluate(&mut self, _: &[f64], _: &mut [f64]) -> Choice {
        Choice {
            action: self.0,
            margin: 0.0,
            control: Control::Policy,
        }
    }
}

#[test]
fn what_a_policy_earns_lies_between_its_bounds() {
    let mut never = || false;
    let mut budget = Budget::new(&mut never);
    // To listen for ever: -20; one belief after another, as many as are heard more on one side.
    let tiger = Pomdp::parse(TIGER).unwrap();
    let listen = &mut Always(0);
    for beliefs_max in [1, 10, 1000] {
        let found = policy_value(&tiger, listen, beliefs_max, &mut budget).unwrap();
        assert!(found.beliefs <= beliefs_max && found.lower <= -20.0 && -20.0 <= found.upper);
        assert!((found.beyond > 1e-3) == (beliefs_max < 1000), "{found:?}");
    }
    // The best policy visits five beliefs.
    let (best, _) = solved(&tiger, 1e-9, 20_000);
    let mut policy = PointBased::new(&tiger, &best.vectors.unwrap()).unwrap();
    let found = policy_value(&tiger, &mut policy, 100, &mut budget).unwrap();
    assert_eq!((found.beliefs, found.beyond), (5, 0.0));
    assert!((found.lower - 19.371_368_38).abs() < 1e-6 && found.upper - found.lower < 1e-8);
    // One that is not the best, and its simulation.
    let model = at(REPAIRS, 0.95);
    let few = compact(
        &model,
        &solved(&model, 1e-3, 20_000).0.vectors.unwrap(),
        4,
        &mut budget,
    );
    let few = few.unwrap().vectors;
    let mut policy = PointBased::new(&model, &few).unwrap();
    let found = policy_value(&model, &mut policy, 20_000, &mut budget).unwrap();
    let (mean, error) = earned(&model, &few, 4000, 1e-4);
    assert!(found.upper - found.lower < 1e-2, "{found:?}");
    assert!(
        (mean - found.lower).abs() < 4.0 * error + 0.2,
        "{mean} {error} {found:?}"
    );
    // A policy that acts as if it knew more than it will.
    let mut heuristic = QMdp::new(mdp::solve(&model).unwrap());
    let found = policy_value(&model, &mut heuristic, 20_000, &mut budget).unwrap();
    assert!(
        found.upper < solved(&model, 1e-3, 20_000).0.bracket.lower,
        "{found:?}"
    );
    let endless = Pomdp::parse(&TIGER.replace("0.95", "1")).unwrap();
    assert!(policy_value(&endless, listen, 10, &mut budget).is_err());
}

#[test]
fn what_a_small_policy_loses_is_sampled_near_discount_one_too() {
    // A seen coin: calling it right brings 1. One vector alone calls one side for ever, and is
    // wrong half the time; a run to the end of the discount would take a million steps.
    let text = "discount: 0.99999 states: 2 actions: 2 observations: 2 T: * uniform
        O: * 1 0 0 1 R: 0 : 0 : * : * 1 R: 1 : 1 : * : * 1";
    let model = Pomdp::parse(text).unwrap();
    let after = 0.99999 / 1e-5;
    let vectors = [(0, [1.0 + after, after]), (1, [after, 1.0 + after])];
    let vectors = AlphaVectors::new(2, 2, vectors).unwrap();
    let mut stop = || false;
    let small = compact(&model, &vectors, 1, &mut Budget::new(&mut stop)).unwrap();
    assert_eq!(small.vectors.len(), 1);
    let off = (small.loss_mean - 0.5 / 1e-5).abs();
    assert!(
        small.loss_error > 0.0 && off < 4.0 * small.loss_error,
        "{small:?}"
    );
    assert!(small.loss_error < 0.02 * small.loss_mean, "{small:?}");
}
