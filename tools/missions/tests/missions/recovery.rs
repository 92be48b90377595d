//! The shipped recovery model: what its file holds, and what its policy does.

use vigil_missions::learning::Record;
use vigil_missions::recovery::{ParameterError, Parameters, fit, generate};
use vigil_missions::simulation::{Act, Agent, Episode, Rules};
use vigil_pomdp::policy::{Control, Policy};
use vigil_pomdp::policy_file::PolicyFile;
use vigil_pomdp::{PointBased, Pomdp, QMdp, mdp};

const MODEL: &str = include_str!("../../../../config/rover.pomdp");
const PARAMETERS: &str = include_str!("../../../../config/rover.recovery.toml");
const POLICY: &[u8] = include_bytes!("../../../../config/rover.policy.json");

fn parameters() -> Parameters {
    toml::from_str(PARAMETERS).unwrap()
}

fn model() -> Pomdp {
    Pomdp::parse(MODEL).unwrap()
}

fn state(model: &Pomdp, name: &str) -> usize {
    model.states().iter().position(|s| s == name).unwrap()
}

fn action(model: &Pomdp, name: &str) -> usize {
    model.actions().iter().position(|a| a == name).unwrap()
}

/// A belief, by the names of its states.
fn belief(model: &Pomdp, parts: &[(&str, f64)]) -> Vec<f64> {
    let mut belief = vec![0.0; model.states().len()];
    for (name, p) in parts {
        belief[state(model, name)] = *p;
    }
    belief
}

#[test]
fn the_file_is_what_its_parameters_generate() {
    assert!(
        generate(&parameters()).unwrap() == MODEL,
        "run: vigil pomdp generate config/rover.recovery.toml --out config/rover.pomdp, \
         and solve again"
    );
    assert!(model().warnings().is_empty());
}

#[test]
fn actions_differ_in_more_than_what_a_step_costs() {
    // Where actions change neither state nor evidence, Q - R is the same for all, and a policy is
    // the choice of the next step's reward.
    let model = model();
    let solution = mdp::solve(&model).unwrap();
    let nominal = state(&model, "ND");
    let rest = |a: usize| solution.q_of(a)[nominal] - model.reward(nominal, a);
    let [go, slow] = ["go_on", "slow_down"].map(|name| rest(action(&model, name)));
    assert!(
        go > slow + 0.01,
        "{go} {slow}: the way is shorter after a fast step"
    );
    // Help mends everything in one step, and the rest is as healthy as it can be.
    let (help, stop) = (action(&model, "call_for_help"), action(&model, "stop"));
    for name in ["STUCK_NEW", "SEVERAL", "UNKNOWN"] {
        assert_eq!(
            model.successors(state(&model, name), help),
            [(nominal, 1.0)]
        );
        let stands = state(&model, name);
        assert_eq!(model.successors(stands, stop), [(stands, 1.0)]);
    }
    // A robot that stands shows nothing, and neither does what has settled.
    let seen = |name: &str| model.observations().iter().position(|z| z == name).unwrap();
    let [none, settled] = ["none", "settled"].map(seen);
    for a in [help, stop] {
        for (s, name) in model.states().iter().enumerate() {
            let shown = [none, settled].map(|z| model.likelihood(a, z)[s]);
            let wanted = match name.as_str() {
                "DONE" => [0.0, 0.0],
                name if name.ends_with("_NEW") => [1.0, 0.0],
                _ => [0.0, 1.0],
            };
            assert_eq!(shown, wanted, "{name}");
        }
    }
    let go = action(&model, "go_on");
    assert_eq!(model.likelihood(go, settled)[state(&model, "UNKNOWN")], 1.0);
    assert_eq!(
        model.likelihood(go, seen("STUCK_NEW"))[state(&model, "STUCK_NEW")],
        0.82
    );
}

#[test]
fn a_step_is_made_of_the_rates_and_prices_of_the_file() {
    let (model, parameters) = (model(), parameters());
    let (stuck, slow) = (state(&model, "STUCK_NEW"), action(&model, "slow_down"));
    let next = model.successors(stuck, slow);
    let to = |name: &str| {
        let found = next.iter().find(|(s, _)| *s == state(&model, name));
        found.map_or(0.0, |(_, p)| *p)
    };
    // 0.02 /s and 0.002 /s in 0.1 s, four fifths of these drivable, and 1.1 cm of 9 m.
    assert!((to("ND_NEW") - 0.002).abs() < 1e-12 && (to("SEVERAL_NEW") - 0.00004).abs() < 1e-12);
    assert!((to("SEVERAL_DRIVABLE_NEW") - 0.00016).abs() < 1e-12);
    // Evidence ends 4.5 times a second.
    assert!((to("STUCK") - 0.45).abs() < 1e-12);
    assert!((to("DONE") - 0.22 * 0.5 * 0.1 / 9.0).abs() < 1e-12);
    // Half of 200 a metre for 1.1 cm, and a tenth of a second.
    let price = |s: usize, a: &str| -model.reward(s, action(&model, a));
    assert!((price(stuck, "slow_down") - (100.0 * 0.011 + 0.1)).abs() < 1e-9);
    assert!((price(stuck, "compensate") - (10.0 * 0.0154 + 0.1)).abs() < 1e-9);
    let encoder = state(&model, "ENCODER");
    assert!((price(encoder, "compensate") - ((75.0 * 0.7 + 100.0) * 0.0154 + 0.1)).abs() < 1e-9);
    assert!((price(encoder, "call_for_help") - 330.0).abs() < 1e-9);
    let both = state(&model, "SEVERAL_DRIVABLE");
    assert!((price(both, "limp_home") - (15.0 * 0.0154 + 0.1)).abs() < 1e-9);
    let alone = (280.0 * 0.7 + 100.0) * 0.0154 + 0.1;
    assert!((price(both, "compensate") - alone).abs() < 1e-9);
    let start = model.start();
    let sum = 0.4 + 0.35 + 0.25 + 0.25;
    let alone = 0.6 * 0.95;
    assert!((start[stuck] - alone * parameters.fault[0].arises_1_h / sum).abs() < 1e-12);
    assert!((start[state(&model, "SEVERAL_DRIVABLE_NEW")] - 0.6 * 0.05 * 0.8).abs() < 1e-12);
    assert!((start.iter().sum::<f64>() - 1.0).abs() < 1e-12);
}

/// Steps, and the state after each.
fn record(model: &Pomdp, steps: &[(&str, &str, Option<&str>)]) -> Record {
    let of = |names: &[String], name: &str| names.iter().position(|it| it == name).unwrap() as u32;
    let labels = steps
        .iter()
        .map(|(_, _, name)| name.map(|it| of(model.states(), it)));
    Record {
        actions: steps.iter().map(|it| of(model.actions(), it.0)).collect(),
        observations: steps
            .iter()
            .map(|it| of(model.observations(), it.1))
            .collect(),
        rewards: Vec::new(),
        labels: [None].into_iter().chain(labels).collect(),
    }
}

#[test]
fn evidence_is_counted_where_it_may_come() {
    let (model, parameters) = (model(), parameters());
    let (stuck, unknown) = (Some("STUCK_NEW"), Some("UNKNOWN_NEW"));
    let records = [
        record(
            &model,
            &[
                ("go_on", "none", stuck),
                ("go_on", "STUCK_NEW", stuck),
                // Of a robot that stands, and of what is not known, nothing is counted.
                ("stop", "none", stuck),
                ("go_on", "none", None),
            ],
        ),
        record(
            &model,
            &[
                ("slow_down", "ENCODER_NEW", unknown),
                ("slow_down", "UNKNOWN_NEW", unknown),
            ],
        ),
    ];
    let chance = |weight: f64, key: &str| {
        let found = fit(&parameters, &model, &records, weight);
        let chance = found.chances.iter().find(|chance| chance.key == key);
        chance.map(|chance| (chance.count, chance.visits, chance.fitted))
    };
    assert_eq!(chance(0.0, "go_on: says something"), Some((1.0, 2.0, 0.5)));
    assert_eq!(
        chance(0.0, "slow_down: says something"),
        Some((2.0, 2.0, 1.0))
    );
    assert_eq!(chance(0.0, "stop: says something"), None);
    assert_eq!(chance(0.0, "compensate: says something"), None);
    let confused = chance(0.0, "speaks for something else");
    assert_eq!(confused, Some((1.0, 3.0, 1.0 / 3.0)));
    assert_eq!(chance(0.0, "settles in a step"), Some((0.0, 4.0, 0.0)));
    let found = fit(&parameters, &model, &records, 0.0);
    assert_eq!(found.steps, 4);
    // One word of something else for two of the truth.
    assert!((found.parameters.evidence.confused - 0.5).abs() < 1e-12);
    // It speaks in half of the steps, and for the truth in two of three words.
    assert!((found.parameters.action[0].sees - 1.0 / 3.0).abs() < 1e-12);
    // What was never visited stays as it was, if what is confused leaves room for it.
    let never = found.parameters.action[3].sees;
    assert_eq!(never, parameters.action[3].sees.min(1.0 / 1.5));
    // What is thought by hand counts as so many visits.
    let by_hand = parameters.action[0].sees * (1.0 + parameters.evidence.confused);
    let (k, n, p) = chance(6.0, "go_on: says something").unwrap();
    assert_eq!((k, n), (1.0, 2.0));
    assert!((p - (1.0 + 6.0 * by_hand) / 8.0).abs() < 1e-12);
    // Every fit is a model, and can be written.
    Pomdp::parse(&generate(&found.parameters).unwrap()).unwrap();
    let text = toml::to_string(&found.parameters).unwrap();
    assert_eq!(
        toml::from_str::<Parameters>(&text).unwrap(),
        found.parameters
    );
}

#[test]
fn what_is_quiet_may_have_settled() {
    let (model, mut parameters) = (model(), parameters());
    let stuck = Some("STUCK_NEW");
    // A step without evidence, of which nobody knows whether it had settled: with q = 1/4 and a
    // chance of 1/3 to be told nothing of what is new, it had with 1/4 of 1/4 + 3/4 * 1/3: a half.
    let quiet = [record(&model, &[("go_on", "none", stuck)])];
    parameters.action[0].sees = 2.0 / 3.0;
    parameters.evidence.confused = 0.0;
    parameters.evidence.settles_1_s = 2.5;
    // So great a weight that the chances stay what they are.
    let found = fit(&parameters, &model, &quiet, 1e12);
    let chance = |key: &str| {
        let chance = found.chances.iter().find(|chance| chance.key == key);
        chance.map(|chance| (chance.count, chance.visits)).unwrap()
    };
    let near = |(k, n): (f64, f64), wanted: (f64, f64)| {
        assert!(
            (k - wanted.0).abs() < 1e-6 && (n - wanted.1).abs() < 1e-6,
            "{k} {n}"
        );
    };
    near(chance("settles in a step"), (0.5, 1.0));
    near(chance("go_on: says something"), (0.0, 0.5));
    // After a second of silence no more is waited for, and what then comes opens another row.
    let mut steps = vec![("go_on", "STUCK_NEW", stuck)];
    steps.extend([("go_on", "none", stuck); 30]);
    steps.extend([("go_on", "STUCK_NEW", stuck); 2]);
    let found = fit(&parameters, &model, &[record(&model, &steps)], 0.0);
    assert_eq!(found.steps, 1 + 10 + 1);
    // What changes is new, and does not settle in that step.
    let (nothing, told) = (
        ("go_on", "ND_NEW", Some("ND_NEW")),
        ("go_on", "STUCK_NEW", stuck),
    );
    let changed = [record(&model, &[nothing, nothing, told, told])];
    let found = fit(&parameters, &model, &changed, 0.0);
    let settles = found
        .chances
        .iter()
        .find(|it| it.key == "settles in a step");
    assert_eq!(settles.map(|it| (it.count, it.visits)), Some((0.0, 3.0)));
}

/// One action for ever.
struct Fixed(usize);

impl Agent for Fixed {
    fn begin(&mut self) {}

    fn decide(&mut self, _: f64) -> Act {
        Act {
            action: self.0,
            control: Control::Policy,
        }
    }

    fn notice(&mut self, _: usize, _: usize) -> bool {
        true
    }
}

#[test]
fn what_a_model_shows_is_found_again() {
    let (model, parameters) = (model(), parameters());
    for (at, name) in [(0, "go_on"), (1, "slow_down")] {
        let rules = Rules::endless(&model, 20);
        let mut agent = Fixed(action(&model, name));
        let records: Vec<Record> = (0..3000)
            .map(|number| {
                let episode = Episode { seed: 5, number };
                Record::simulated(&model, &mut agent, &rules, episode, true).0
            })
            .collect();
        let mut vague = parameters.clone();
        vague
            .action
            .iter_mut()
            .for_each(|it| it.sees = it.sees.min(0.5));
        vague.evidence.confused = 0.3;
        vague.evidence.settles_1_s = 8.0;
        let found = fit(&vague, &model, &records, 0.0).parameters;
        let near = |found: f64, wanted: f64, what: &str| {
            assert!(
                (found - wanted).abs() < 0.05 * wanted.max(0.2),
                "{what}: {found} {wanted}"
            );
        };
        near(found.action[at].sees, parameters.action[at].sees, name);
        let (found, wanted) = (found.evidence, parameters.evidence);
        near(found.settles_1_s, wanted.settles_1_s, "settles");
        near(found.confused, wanted.confused, "confused");
    }
}

#[test]
fn the_solved_policy_calls_where_qmdp_waits_for_ever() {
    // Q-MDP believes that the next step tells everything, so that a robot that nobody understands
    // stands and waits; the solved policy knows that what has settled shows nothing.
    let model = model();
    let file = PolicyFile::read(POLICY, &model).unwrap();
    let mut solved = PointBased::new(&model, &file.vectors).unwrap();
    let mut qmdp = QMdp::new(mdp::solve(&model).unwrap());
    let mut values = vec![0.0; model.actions().len()];
    let mut chosen = |policy: &mut dyn Policy, parts: &[(&str, f64)]| {
        let choice = policy.evaluate(&belief(&model, parts), &mut values);
        model.actions()[choice.action].clone()
    };
    for settled in [
        [("ND", 0.01), ("UNKNOWN", 0.99)],
        [("ND", 0.3), ("UNKNOWN", 0.7)],
        [("STUCK", 0.75), ("UNKNOWN", 0.25)],
        [("STUCK", 0.5), ("ENCODER", 0.5)],
    ] {
        assert_eq!(chosen(&mut qmdp, &settled), "stop");
        assert_eq!(
            chosen(&mut solved, &settled),
            "call_for_help",
            "{settled:?}"
        );
    }
    for (parts, wanted) in [
        (&[("ND", 1.0)][..], "go_on"),
        (&[("STUCK", 1.0)], "compensate"),
        (&[("STUCK_NEW", 1.0)], "compensate"),
        // The doubt may yet be resolved: no call.
        (&[("STUCK_NEW", 0.75), ("UNKNOWN_NEW", 0.25)], "slow_down"),
        (&[("ENCODER", 1.0)], "ignore_encoder"),
        (&[("SEVERAL", 1.0)], "call_for_help"),
        (&[("SEVERAL_DRIVABLE", 1.0)], "limp_home"),
        (&[("SEVERAL_DRIVABLE_NEW", 1.0)], "limp_home"),
        (&[("ND_NEW", 0.1), ("UNKNOWN_NEW", 0.9)], "slow_down"),
    ] {
        assert_eq!(chosen(&mut solved, parts), wanted, "{parts:?}");
    }
    // Bounds are of the start belief.
    assert!(file.lower <= file.upper.unwrap() && file.upper.unwrap() - file.lower <= 1.0);
}

#[test]
fn the_model_of_any_robot_is_what_its_parameters_generate() {
    let parameters = toml::from_str(include_str!("../../../../config/any-robot.recovery.toml"));
    let text = generate(&parameters.unwrap()).unwrap();
    let shipped = include_str!("../../../../config/any-robot.pomdp");
    assert!(
        text == shipped,
        "run: vigil pomdp generate config/any-robot.recovery.toml --out config/any-robot.pomdp, \
         and solve again"
    );
    let model = Pomdp::parse(&text).unwrap();
    let settled = ["ND", "FAULT", "SEVERAL", "UNKNOWN"];
    let new = settled.map(|name| format!("{name}_NEW"));
    let states = [settled.map(str::to_owned), new].concat();
    let states = [states, vec!["DONE".to_owned()]].concat();
    assert_eq!(model.states(), states);
    assert!(model.warnings().is_empty());
    let policy = include_bytes!("../../../../config/any-robot.policy.json");
    PolicyFile::read(policy, &model).unwrap();
}

#[test]
fn parameters_that_mean_nothing_are_named() {
    let refused = |change: fn(&mut Parameters)| {
        let mut parameters = parameters();
        change(&mut parameters);
        generate(&parameters).unwrap_err()
    };
    let text = |change| refused(change).to_string();
    assert_eq!(
        text(|p| p.discount = 1.0),
        "discount is 1; allowed is 0 to below 1"
    );
    assert_eq!(
        text(|p| p.action[1].speed_scale = f64::NAN),
        "action slow_down.speed_scale is NaN; allowed is 0 to 1"
    );
    assert_eq!(
        text(|p| p.fault[0].price_1_m = -1.0),
        "fault STUCK.price_1_m is -1; allowed is any finite number from 0"
    );
    assert_eq!(
        refused(|p| p.fault[0].state = "TYRE".to_owned()),
        ParameterError::NoFault {
            action: "compensate".to_owned(),
            fault: "STUCK".to_owned(),
        }
    );
    for (name, change) in [
        (
            "DONE",
            (|p| p.fault[2].state = "DONE".to_owned()) as fn(&mut Parameters),
        ),
        ("STUCK", |p| p.fault[1].state = "STUCK".to_owned()),
        ("SERVO_NEW", |p| p.fault[2].state = "SERVO_NEW".to_owned()),
    ] {
        assert_eq!(refused(change), ParameterError::SameState(name.to_owned()));
    }
    assert!(
        text(|p| p.evidence.settles_1_s = 20.0).starts_with("the rates out of state ND_NEW sum to")
    );
}
