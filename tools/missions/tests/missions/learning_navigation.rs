//! The yardstick, small: navigation missions under the escalation policy, learned from a wrong
//! model. `scripts/bench pomdp-learning` is the same with 10,000.

use vigil_missions::learning::{Record, Settings, check, learn};
use vigil_missions::navigation::{self, Parameters, QUIET};
use vigil_missions::simulation::{Agent, Episode, Escalation, PolicyAgent, Rules, run};
use vigil_pomdp::policy::{Base, Decider};
use vigil_pomdp::{Pomdp, mdp};

fn parameters() -> Parameters {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/navigation.toml");
    toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn mean(world: &Pomdp, agent: &mut dyn Agent, missions: u64) -> f64 {
    let one = |e| run(world, agent, &rules(world), Episode { seed: 2, number: e }).discounted;
    (0..missions).map(one).sum::<f64>() / missions as f64
}

fn rules(model: &Pomdp) -> Rules {
    Rules::endless(model, 2000)
}

fn agent(model: &Pomdp) -> PolicyAgent<'_> {
    let solution = mdp::solve(model).unwrap();
    let policy = Base::QMdp.build(model, &solution);
    PolicyAgent::new(model, Decider::new(policy.unwrap(), model, &solution))
}

#[test]
fn a_learned_model_predicts_better_than_the_one_by_hand_and_beats_the_escalation() {
    let truth = Pomdp::parse(&navigation::generate(&parameters()).unwrap()).unwrap();
    // By hand: exceptions three times as often, openings and steps aside hardly ever help.
    let mut wrong = parameters();
    for p in [
        &mut wrong.arises.nnp,
        &mut wrong.arises.rt,
        &mut wrong.arises.pp,
        &mut wrong.arises.wd,
        &mut wrong.arises.lst,
    ] {
        *p *= 3.0;
    }
    wrong.remedies.go.pp = 0.2;
    wrong.remedies.ma.rt = 0.2;
    let hand = Pomdp::parse(&navigation::generate(&wrong).unwrap()).unwrap();
    let ladder = ["MA", "GO", "NP", "RL", "SH", "GU"];
    let mut escalation = Escalation::new(&truth, "FP", &ladder, &QUIET, 1).unwrap();
    let rules = rules(&truth);
    let mut record = |e| {
        Record::simulated(
            &truth,
            &mut escalation,
            &rules,
            Episode { seed: 1, number: e },
            false,
        )
        .0
    };
    let records: Vec<Record> = (0..400).map(&mut record).collect();
    let settings = Settings {
        iterations_max: 40,
        ..Settings::default()
    };
    let learned = learn(&hand, &records, &settings, &mut |_| ())
        .unwrap()
        .model;
    let missions = 1500;
    let best = mean(&truth, &mut agent(&truth), missions);
    let predicted = mean(&learned, &mut agent(&learned), missions);
    let measured = mean(&truth, &mut agent(&learned), missions);
    let by_hand = mean(&hand, &mut agent(&hand), missions);
    assert!((predicted - best).abs() < 0.1 * best, "{predicted} {best}");
    assert!((by_hand - best).abs() > 0.2 * best, "{by_hand} {best}");
    assert!(measured > 0.95 * best, "{measured} {best}");
    assert!(measured > mean(&truth, &mut escalation, missions));
    assert!(check::within(predicted, measured, 0.0).is_ok());
    assert!(check::within(by_hand, mean(&truth, &mut agent(&hand), missions), 1.0).is_err());
    let logged = |model| check::follow(model, &records).unwrap();
    let off = |model| (logged(model).predicted.mean - logged(model).measured.mean).abs();
    assert!(off(&learned) < 0.3 * off(&hand));
}
