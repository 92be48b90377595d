//! The shipped navigation model: what its file holds, and the paper's two stories.

use vigil_missions::navigation::{ACTIONS, ENDS, NumberError, Parameters, QUIET, STATES, generate};
use vigil_missions::simulation::{
    Agent, Episode, Escalation, PairedDifference, PolicyAgent, Random, Rules, Summary, horizon, run,
};
use vigil_pomdp::policy::{Base, Dual, PolicyName};
use vigil_pomdp::{Evidence, Pomdp, Tracker, mdp};

const MODEL: &str = include_str!("../../../../config/navigation.pomdp");
const PARAMETERS: &str = include_str!("../../../../config/navigation.toml");

fn parameters() -> Parameters {
    toml::from_str(PARAMETERS).unwrap()
}

fn model() -> Pomdp {
    Pomdp::parse(MODEL).unwrap()
}

fn state(name: &str) -> usize {
    STATES.iter().position(|s| *s == name).unwrap()
}

fn action(name: &str) -> usize {
    ACTIONS.iter().position(|a| *a == name).unwrap()
}

fn observation(model: &Pomdp, name: &str) -> usize {
    model.observations().iter().position(|z| z == name).unwrap()
}

#[test]
fn the_file_is_what_its_parameters_generate() {
    assert!(
        generate(&parameters()).unwrap() == MODEL,
        "run: vigil pomdp generate config/navigation.toml --out config/navigation.pomdp"
    );
    let model = model();
    assert_eq!(model.warnings(), []);
    assert_eq!(
        (model.states(), model.actions()),
        (
            &STATES.map(String::from)[..],
            &ACTIONS.map(String::from)[..]
        )
    );
    assert_eq!(model.observations().len(), 48);
}

#[test]
fn what_excludes_itself_never_comes_together_and_outcomes_answer_their_actions() {
    let model = model();
    for (a, action) in ACTIONS.iter().enumerate() {
        let mut possible = 0;
        for (z, name) in model.observations().iter().enumerate() {
            let has = |part| name.split('_').any(|p| p == part);
            assert!(!(has("EPS") && has("EPM")), "{name}");
            let fits = match *action {
                "GO" => !has("ALT") && !has("NNA"),
                "NP" => !has("BO"),
                _ => !has("BO") && !has("ALT") && !has("NNA"),
            };
            let column = model.likelihood(a, z);
            assert!(
                column.iter().all(|p| (*p > 0.0) == fits),
                "{action}, {name}: {column:?}"
            );
            possible += usize::from(fits);
        }
        let expected = match *action {
            "GO" => 24,
            "NP" => 36,
            _ => 12,
        };
        assert_eq!(possible, expected, "{action}");
    }
}

#[test]
fn probabilities_are_the_products_of_the_parameters() {
    let (model, p) = (model(), parameters());
    let column = model.likelihood(action("GO"), observation(&model, "EPM_SD"));
    let s = &p.symptoms;
    let rt = s.epm.rt * s.sd.rt * (1.0 - s.ld.rt) * (1.0 - p.outcomes.bo.rt);
    assert!((column[state("RT")] / rt - 1.0).abs() < 1e-10);
    let column = model.likelihood(action("NP"), observation(&model, "LD_ALT"));
    let lst = (1.0 - s.eps.lst - s.epm.lst) * s.ld.lst * (1.0 - s.sd.lst) * p.outcomes.alt.lst;
    assert!((column[state("LST")] / lst - 1.0).abs() < 1e-10);
    let mends = 1.0 - (1.0 - p.remedies.ma.rt) * (1.0 - p.passes.rt);
    let row = model.successors(state("RT"), action("MA"));
    assert_eq!(row.len(), 2);
    assert!(row[0].0 == state("NOM") && (row[0].1 - mends).abs() < 1e-10);
    // Giving up begins the next task, wherever the robot was.
    for s in 0..STATES.len() {
        let row = model.successors(s, action("GU"));
        assert!(row.iter().all(|(to, p)| model.start()[*to] == *p) && row.len() == 7);
    }
}

#[test]
fn every_certain_state_has_the_remedy_that_a_person_would_expect() {
    let model = model();
    let solution = mdp::solve(&model).unwrap();
    let best: Vec<&str> = (0..7).map(|s| ACTIONS[solution.best(s)]).collect();
    assert_eq!(best, ["FP", "NP", "SH", "MA", "GO", "RL", "RL"]);
}

#[test]
fn silence_restores_the_nominal_state_towards_a_fixed_point() {
    let model = model();
    let (fp, none) = (action("FP"), observation(&model, "none"));
    let mut tracker = Tracker::new(&model);
    // Exceptions only, all as probable.
    assert!(tracker.anchor(&[0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]));
    let mut before = 0.0;
    for step in 0..200 {
        assert!(matches!(
            tracker.update(&model, fp, none),
            Evidence::Taken(_)
        ));
        let nominal = tracker.belief()[0];
        // Near the fixed point it may overshoot: what passes quickly goes first.
        assert!(nominal > before || nominal > 0.98, "{step}: {nominal}");
        before = nominal;
    }
    let fixed = before;
    tracker.reset();
    (0..200).for_each(|_| {
        tracker.update(&model, fp, none);
    });
    assert!(
        fixed > 0.98 && (tracker.belief()[0] - fixed).abs() < 1e-9,
        "{fixed}"
    );
}

/// A story: what the policy does, and what it believes before each action.
struct Story {
    did: Vec<&'static str>,
    believed: Vec<[f64; 7]>,
}

/// Plays `script`, one observation a step, to a policy.
fn story(policy: &str, script: &[&str]) -> Story {
    let model = model();
    let solution = mdp::solve(&model).unwrap();
    let name: PolicyName = policy.parse().unwrap();
    let mut decider = name
        .build(&model, &solution, |i| Dual::new(i, 0.5))
        .unwrap();
    let mut tracker = Tracker::new(&model);
    let mut story = Story {
        did: Vec::new(),
        believed: Vec::new(),
    };
    for heard in script.iter().map(Some).chain([None]) {
        let chosen = decider.decide(tracker.belief()).action;
        story.did.push(ACTIONS[chosen]);
        story.believed.push(tracker.belief().try_into().unwrap());
        if let Some(heard) = heard {
            let z = observation(&model, heard);
            let evidence = tracker.update(&model, chosen, z);
            assert!(
                matches!(evidence, Evidence::Taken(_)),
                "{policy}: {heard} is impossible"
            );
        }
    }
    story
}

/// The shipped default, and the policies that differ from it in how they weigh the states.
const TELLERS: [&str; 4] = ["qmdp", "fib", "av", "mls"];

#[test]
fn a_blocked_corridor_is_tried_then_gone_round() {
    let [nom, nnp, hp, rt, pp, wd, lst] = std::array::from_fn(|i| i);
    for (policy, steps) in TELLERS
        .iter()
        .flat_map(|p| [0, 1, 20].map(|steps| (p, steps)))
    {
        // Off the path while moving; no opening, still off the path; an alternative; silence.
        let quietly = vec!["none"; steps];
        let script = [&quietly[..], &["EPM", "EPM", "ALT", "none"]].concat();
        let Story { did, believed } = story(policy, &script);
        assert_eq!(
            did[steps..],
            ["FP", "GO", "NP", "FP", "FP"],
            "{policy}, {steps}"
        );
        assert!(did[..steps].iter().all(|a| *a == "FP"));
        let [quiet, off, blocked, round, after] = believed[steps..].try_into().unwrap();
        for exception in [rt, pp, nnp] {
            assert!(off[exception] > 5.0 * quiet[exception], "{policy}: {off:?}");
            for other in [hp, wd, lst] {
                assert!(off[exception] > off[other], "{policy}: {off:?}");
            }
        }
        // No opening speaks for the blockage, against a phantom.
        assert!(
            blocked[nnp] > off[nnp] && blocked[pp] < off[pp],
            "{policy}: {blocked:?}"
        );
        assert!(
            (0..7).all(|s| s == nnp || blocked[s] < blocked[nnp]),
            "{policy}: {blocked:?}"
        );
        assert!(
            round[nom] > 0.9 && after[nom] > round[nom],
            "{policy}: {round:?}"
        );
    }
}

#[test]
fn people_who_leave_an_opening_are_passed() {
    let [nom, nnp, _, rt, pp, ..]: [usize; 7] = std::array::from_fn(|i| i);
    for (policy, steps) in TELLERS
        .iter()
        .flat_map(|p| [0, 1, 20].map(|steps| (p, steps)))
    {
        let quietly = vec!["none"; steps];
        let script = [&quietly[..], &["EPM", "BO", "none"]].concat();
        let Story { did, believed } = story(policy, &script);
        assert_eq!(did[steps..], ["FP", "GO", "FP", "FP"], "{policy}, {steps}");
        let [quiet, off, passed, _] = believed[steps..].try_into().unwrap();
        for exception in [rt, pp, nnp] {
            assert!(off[exception] > 5.0 * quiet[exception], "{policy}: {off:?}");
            assert!(
                passed[exception] < quiet[exception].max(0.01),
                "{policy}: {passed:?}"
            );
        }
        assert!(passed[nom] > quiet[nom], "{policy}: {passed:?}");
    }
}

#[test]
fn other_stories_end_as_they_should() {
    // Loops off the path, past an opening and from another place too: lost or heading wrong.
    assert_eq!(story("qmdp", &["EPM_LD"; 3]).did[1..], ["GO", "MA", "RL"]);
    // Spins while off the path: local control is caught.
    assert_eq!(story("qmdp", &["EPM_LD_SD"]).did[1], "MA");
    // Stands, spins, and nothing helps: broken.
    let did = story("qmdp", &["EPS_SD"; 6]).did;
    assert_eq!(did[6], "SH", "{did:?}");
}

/// Discounted rewards of 1,000 missions; with `ends`, SH and GU end them.
fn missions(agent: &mut dyn Agent, ends: bool) -> Vec<f64> {
    let model = model();
    let is_end = |a: &&str| ends && ENDS.contains(a);
    let rules = Rules {
        steps_max: horizon(model.discount(), 1000),
        is_end: ACTIONS.iter().map(is_end).collect(),
    };
    let one = |episode| {
        run(
            &model,
            agent,
            &rules,
            Episode {
                seed: 7,
                number: episode,
            },
        )
        .discounted
    };
    (0..1000).map(one).collect()
}

#[test]
fn every_policy_beats_the_escalation_over_a_thousand_missions() {
    let model = model();
    let solution = mdp::solve(&model).unwrap();
    let ladder = ["MA", "GO", "NP", "RL", "SH", "GU"];
    for ends in [false, true] {
        // The quickest escalation is the best of them.
        let mut baselines: Vec<Vec<f64>> = Vec::new();
        for patience in 1..=3 {
            let escalation = Escalation::new(&model, "FP", &ladder, &QUIET, patience);
            baselines.push(missions(&mut escalation.unwrap(), ends));
        }
        let chance = Summary::new(&mut missions(&mut Random::new(ACTIONS.len()), ends)).mean;
        let prefixes = ["", "dm-", "adm-"];
        for name in prefixes
            .iter()
            .flat_map(|p| Base::ALL.map(|(_, x)| format!("{p}{x}")))
        {
            let policy: PolicyName = name.parse().unwrap();
            let settings = |information| {
                let mut dual = Dual::new(information, 0.5);
                (dual.allowed, dual.stall_steps) = (Some((0..5).collect()), 5);
                dual
            };
            let decider = policy.build(&model, &solution, settings).unwrap();
            let ours = missions(&mut PolicyAgent::new(&model, decider), ends);
            for baseline in &baselines {
                let PairedDifference { difference, p, .. } = PairedDifference::new(&ours, baseline);
                assert!(difference > 0.0 && p < 1e-3, "{name}: {difference}, p {p}");
            }
            assert!(Summary::new(&mut ours.clone()).mean > chance);
        }
    }
}

#[test]
fn parameters_that_mean_nothing_are_refused_by_name() {
    let message = |change: fn(&mut Parameters)| {
        let mut parameters = parameters();
        change(&mut parameters);
        generate(&parameters).unwrap_err().to_string()
    };
    assert!(message(|p| p.discount = 1.0).contains("discount: 1 is out of range"));
    assert!(message(|p| p.remedies.go.nnp = -0.1).contains("remedies.go: -0.1"));
    assert!(message(|p| p.symptoms.ld.wd = f64::NAN).contains("symptoms.ld: NaN"));
    assert!(message(|p| p.symptoms.eps.hp = 0.9).contains("symptoms.eps + symptoms.epm"));
    assert!(message(|p| p.arises.nnp = 0.99).contains("arises: the chances add up to"));
    assert!(message(|p| p.rewards.prices.gu = -1.0).contains("rewards.prices: -1"));
    assert!(message(|p| p.rewards.fp.hp = f64::INFINITY).contains("rewards.fp: inf"));
    let mut sum = parameters();
    sum.outcomes.nna.nnp = 1.0;
    assert!(matches!(generate(&sum), Err(NumberError::Sum { .. })));
    assert!(toml::from_str::<Parameters>(&PARAMETERS.replace("gu = 20.0", "")).is_err());
    assert!(toml::from_str::<Parameters>(&PARAMETERS.replace("nnp = 0.05", "nmp = 0.05")).is_err());
}
