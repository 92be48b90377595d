//! The shipped recovery model: what its file holds, and what its policy does.

use vigil_missions::learning::Record;
use vigil_missions::recovery::{ParameterError, Parameters, fit, generate};
use vigil_pomdp::policy::Policy;
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
        0.91
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
    // Evidence ends 5.6 times a second.
    assert!((to("STUCK") - 0.56).abs() < 1e-12);
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

#[test]
fn evidence_is_counted_where_it_may_come() {
    let (model, parameters) = (model(), parameters());
    let observation = |name: &str| model.observations().iter().position(|o| o == name).unwrap();
    let record = |steps: &[(&str, &str)], states: &[Option<&str>]| Record {
        actions: steps.iter().map(|s| action(&model, s.0) as u32).collect(),
        observations: steps.iter().map(|s| observation(s.1) as u32).collect(),
        rewards: Vec::new(),
        labels: states
            .iter()
            .map(|name| name.map(|name| state(&model, name) as u32))
            .collect(),
    };
    let records = [
        record(
            &[
                ("go_on", "STUCK_NEW"),
                ("go_on", "none"),
                ("go_on", "settled"),
            ],
            &[
                Some("STUCK_NEW"),
                Some("STUCK_NEW"),
                Some("STUCK_NEW"),
                Some("STUCK"),
            ],
        ),
        // A robot that stands shows nothing, and of what is not known nothing is counted.
        record(
            &[
                ("slow_down", "ENCODER_NEW"),
                ("stop", "none"),
                ("go_on", "none"),
            ],
            &[
                Some("UNKNOWN_NEW"),
                Some("UNKNOWN_NEW"),
                Some("UNKNOWN_NEW"),
                None,
            ],
        ),
    ];
    let chance = |weight: f64, key: &str| {
        let found = fit(&parameters, &model, &records, weight);
        let chance = found.chances.iter().find(|chance| chance.key == key);
        chance.map(|chance| (chance.count, chance.visits, chance.fitted))
    };
    assert_eq!(chance(0.0, "go_on: sees"), Some((1.0, 2.0, 0.5)));
    assert_eq!(chance(0.0, "slow_down: sees"), Some((0.0, 1.0, 0.0)));
    assert_eq!(chance(0.0, "stop: sees"), None);
    assert_eq!(chance(0.0, "compensate: sees"), None);
    // One step spoke for the truth, one for something else.
    assert_eq!(chance(0.0, "confused"), Some((1.0, 1.0, 1.0)));
    assert_eq!(chance(0.0, "settles, a step"), Some((1.0, 4.0, 0.25)));
    let found = fit(&parameters, &model, &records, 0.0);
    assert_eq!(found.steps, 4);
    assert!((found.parameters.evidence.settles_1_s - 2.5).abs() < 1e-12);
    // What is thought by hand counts as so many visits.
    let (by_hand, weighted) = (parameters.action[0].sees, chance(6.0, "go_on: sees"));
    assert_eq!(weighted, Some((1.0, 2.0, (1.0 + 6.0 * by_hand) / 8.0)));
    // Every fit is a model, and can be written.
    generate(&found.parameters).unwrap();
    let text = toml::to_string(&found.parameters).unwrap();
    assert_eq!(
        toml::from_str::<Parameters>(&text).unwrap(),
        found.parameters
    );
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
        // The doubt may yet be resolved.
        (&[("STUCK_NEW", 0.75), ("UNKNOWN_NEW", 0.25)], "go_on"),
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
