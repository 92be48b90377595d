//! The policies that the settings offer, and what is published about their decisions.

use vigil_blocks::{ControlMode, DetectionBelief, Entry, RecoveryKind, ValueKind};
use vigil_cycle::allocation::allocations;
use vigil_decision::Gate;
use vigil_decision::Settings;
use vigil_decision::{Inputs, Supervisor};
use vigil_pomdp::policy::{Base, Dual, PolicyName, normalised_entropy};
use vigil_pomdp::{Pomdp, mdp};

use crate::world::{self, CYCLE_NS, World, config, model};

fn names() -> impl Iterator<Item = String> {
    let prefixes = ["", "dm-", "adm-"];
    prefixes
        .into_iter()
        .flat_map(|prefix| Base::ALL.map(|(_, x)| format!("{prefix}{x}")))
}

/// `policy` with dual control by slowing down only.
fn dual(policy: &str) -> impl Fn(&mut Settings) {
    move |settings| {
        settings.policy = policy.to_owned();
        settings.threshold = 0.15;
        settings.information_actions = vec!["slow_down".to_owned()];
        settings.stall_guard_steps = 3;
    }
}

/// Two wheels may be stuck: a quarter of the largest entropy.
const EVEN: [(&str, f64); 2] = [("RM_STUCK", 0.5), ("RF_STUCK", 0.5)];

#[test]
fn the_default_policy_publishes_the_values_of_q_mdp_to_the_bit() {
    let mut world = World::new();
    let model = model();
    let solution = mdp::solve(&model).unwrap();
    let sequence = [0.999, 0.7, 0.3, 0.001];
    for nominal in sequence {
        let p = [
            ("ND", nominal),
            ("LF_STUCK", (1.0 - nominal) / 3.0),
            ("UNKNOWN", (1.0 - nominal) / 1.5),
        ];
        world.rest(30, nominal < 0.5, &p);
        let belief = &world.action.belief[..model.states().len()];
        for a in 0..model.actions().len() {
            let terms = belief.iter().zip(solution.q_of(a)).map(|(b, q)| b * q);
            assert_eq!(
                world.action.value[a].to_bits(),
                terms.sum::<f64>().to_bits()
            );
        }
        assert_eq!(world.action.control_mode, ControlMode::Policy as u32);
        assert_eq!(world.action.value_kind, ValueKind::Value as u32);
        let mut votes = vec![0.0; model.actions().len()];
        for (s, b) in belief.iter().enumerate() {
            votes[solution.best(s)] += b;
        }
        let doubt = normalised_entropy(&votes);
        assert!((world.action.action_entropy - doubt).abs() < 1e-12);
        assert_eq!(
            world.action.entropy.to_bits(),
            normalised_entropy(belief).to_bits()
        );
    }
}

#[test]
fn every_policy_goes_on_when_nominal_and_compensates_a_certain_fault() {
    for name in names() {
        let mut world = World::with(dual(&name));
        world.rest(100, false, &[("ND", 0.9999), ("UNKNOWN", 0.0001)]);
        assert_eq!(world.kind(), RecoveryKind::GoOn, "{name}");
        world.rest(1, true, &[("RM_STUCK", 0.999), ("ND", 0.001)]);
        assert_eq!(world.kind(), RecoveryKind::Compensate, "{name}");
        let counts = name.ends_with("av") || name.ends_with("mls");
        let kind = [ValueKind::Value, ValueKind::Votes][usize::from(counts)];
        assert_eq!(world.action.value_kind, kind as u32, "{name}");
        assert_eq!(
            world.action.control_mode,
            ControlMode::Policy as u32,
            "{name}"
        );
    }
}

#[test]
fn in_doubt_dual_control_gathers_information_and_says_so() {
    let mut world = World::with(dual("dm-qmdp"));
    world.rest(50, false, &[("ND", 0.9999), ("UNKNOWN", 0.0001)]);
    world.cycle(true, &EVEN, &EVEN);
    assert_eq!(world.kind(), RecoveryKind::SlowDown);
    assert_eq!(world.action.control_mode, ControlMode::Dual as u32);
    assert!((world.action.entropy - 2_f64.ln() / 14_f64.ln()).abs() < 1e-12);
    // The values are the entropies to expect, negative.
    assert!(
        world.action.value[..6]
            .iter()
            .all(|v| (-1.0..=0.0).contains(v))
    );
    assert_eq!(world.action.value_kind, ValueKind::Entropy as u32);
    // Between epochs it stands.
    world.cycle(true, &EVEN, &EVEN);
    assert_eq!(world.action.control_mode, ControlMode::Dual as u32);
    let named = [("RM_STUCK", 0.99), ("RF_STUCK", 0.01)];
    world.rest(40, true, &named);
    assert_eq!(world.kind(), RecoveryKind::Compensate);
    assert_eq!(world.action.control_mode, ControlMode::Policy as u32);
    assert!(world.action.value[..6].iter().any(|v| *v > 0.0));
    // The action is the same for both wheels: ADM has no doubt.
    let mut world = World::with(dual("adm-qmdp"));
    world.cycle(true, &EVEN, &EVEN);
    assert_eq!(world.action.control_mode, ControlMode::Policy as u32);
    assert_eq!(world.kind(), RecoveryKind::Compensate);
    let by_state = |settings: &mut Settings| {
        dual("adm-qmdp")(settings);
        settings.gate = Some(Gate::State);
    };
    let mut world = World::with(by_state);
    world.cycle(true, &EVEN, &EVEN);
    assert_eq!(world.action.control_mode, ControlMode::Dual as u32);
}

#[test]
fn a_doubt_that_does_not_shrink_is_left_to_the_policy() {
    let mut world = World::with(dual("dm-qmdp"));
    world.cycle(true, &EVEN, &EVEN);
    assert_eq!(world.action.control_mode, ControlMode::Dual as u32);
    // Three epochs of a tenth of a second, and three until it may drive faster.
    world.rest(100, true, &EVEN);
    assert_eq!(world.action.control_mode, ControlMode::Policy as u32);
    assert_eq!(world.kind(), RecoveryKind::Compensate);
    let unguarded = |settings: &mut Settings| {
        dual("dm-qmdp")(settings);
        settings.stall_guard_steps = 0;
    };
    let mut world = World::with(unguarded);
    world.rest(400, true, &EVEN);
    assert_eq!(world.action.control_mode, ControlMode::Dual as u32);
}

#[test]
fn a_lost_identifier_and_a_safe_stop_are_told_before_dual_control() {
    let mut world = World::with(dual("dm-qmdp"));
    world.rest(20, true, &EVEN);
    world.supervisor.step(Entry::Missed(3), &mut world.action);
    let mut detection = DetectionBelief {
        p_fault: 0.9,
        ..Default::default()
    };
    detection.header.t_capture_ns = world.t_ns + CYCLE_NS;
    let inputs = Inputs {
        diagnosis: None,
        detection: Some(&detection),
    };
    world
        .supervisor
        .step(Entry::Frame(inputs), &mut world.action);
    assert_eq!(world.action.control_mode, ControlMode::Fallback as u32);
    world.supervisor.step(Entry::Missed(10), &mut world.action);
    assert_eq!(world.action.control_mode, ControlMode::Safe as u32);
    assert_eq!(world.kind(), RecoveryKind::Stop);
}

#[test]
fn settings_that_do_not_fit_the_model_are_named() {
    let (tree, robot) = {
        let world = World::new();
        (world.tree, world.robot)
    };
    let message = |change: &dyn Fn(&mut Settings)| {
        let mut settings = world::settings();
        dual("dm-qmdp")(&mut settings);
        change(&mut settings);
        // Without compensating there is nothing to compensate with.
        settings.actions.get_mut("compensate").unwrap().kind = vigil_decision::Recovery::SlowDown;
        let built = Supervisor::new(model(), None, &tree, &robot, &settings, Vec::new(), 10);
        built.err().unwrap().to_string()
    };
    let wrong = message(&|s| s.information_actions = vec!["look".into()]);
    assert!(
        wrong.contains("no action 'look'; allowed are go_on, slow_down, stop"),
        "{wrong}"
    );
    let none = message(&|s| s.information_actions.clear());
    assert!(none.contains("no information action"), "{none}");
    let threshold = message(&|s| s.threshold = -0.1);
    assert!(
        threshold.contains("threshold -0.1: allowed is 0 to 1"),
        "{threshold}"
    );
    let luck = message(&|s| s.policy = "dm-luck".into());
    assert!(
        luck.contains("policy 'dm-luck' is not known: allowed are mls, av"),
        "{luck}"
    );
}

#[test]
fn the_configuration_is_checked_before_anything_is_built() {
    let problems = |change: fn(&mut Settings)| {
        let loaded = vigil_setup::load_graph(&config().join("rover.toml"), |file| {
            file.supervisor.policy = "qmdp".to_owned();
            file.supervisor.policy_file = None;
            change(&mut file.supervisor);
        });
        loaded
            .err()
            .map_or_else(String::new, |error| error.to_string())
    };
    assert_eq!(problems(|_| {}), "");
    type Case = (fn(&mut Settings), &'static str);
    let cases: [Case; 7] = [
        (
            |s| s.policy = "best".into(),
            "supervisor.policy: policy 'best' is not known",
        ),
        (
            |s| s.policy = "adm-av".into(),
            "supervisor.information_actions: is required by adm-av",
        ),
        (
            |s| s.threshold = 1.1,
            "supervisor.threshold: 1.1 is out of range",
        ),
        (
            |s| s.threshold = f64::NAN,
            "supervisor.threshold: NaN is out of range",
        ),
        (
            |s| s.stall_guard_steps = 2000,
            "supervisor.stall_guard_steps: 2000",
        ),
        (
            |s| s.information_actions = vec!["stop".into(), "stop".into()],
            "supervisor.information_actions: 'stop' appears twice",
        ),
        (
            |s| (s.as_published, s.gate) = (true, Some(Gate::Action)),
            "supervisor.as_published: with as_published neither",
        ),
    ];
    for (change, part) in cases {
        let message = problems(change);
        assert!(message.contains(part), "{part}: {message}");
    }
    let fine: fn(&mut Settings) = |s| (s.policy, s.as_published) = ("dm-av".into(), true);
    assert_eq!(problems(fine), "");
}

#[test]
fn no_policy_allocates_in_a_decision() {
    let navigation = std::fs::read_to_string(config().join("navigation.pomdp")).unwrap();
    for model in [Pomdp::parse(&navigation).unwrap(), model()] {
        let solution = mdp::solve(&model).unwrap();
        let states = model.states().len();
        for name in names() {
            let policy: PolicyName = name.parse().unwrap();
            let settings = |information| {
                let mut dual = Dual::new(information, 0.4);
                dual.stall_steps = 3;
                dual
            };
            let mut decider = policy.build(&model, &solution, settings).unwrap();
            let mut belief = vec![0.0; states];
            let (before, mut seen) = (allocations(), [0; 3]);
            assert!(before > 0, "the allocator does not count");
            for turn in 0..6000 {
                // Each belief stands for a while, so that information stalls.
                let step = turn / 6;
                belief.fill(1e-3);
                belief[step % states] += 1.0;
                belief[step / 3 % states] += (step % 3) as f64;
                belief[step / 7 % states] += 1.0;
                let sum: f64 = belief.iter().sum();
                belief.iter_mut().for_each(|b| *b /= sum);
                seen[decider.decide(&belief).control as usize] += 1;
                if turn % 100 == 0 {
                    decider.reset();
                }
            }
            assert_eq!(allocations() - before, 0, "{name}");
            // Every way through it was taken.
            let ways = if policy.information.is_some() { 3 } else { 1 };
            assert!(seen[..ways].iter().all(|n| *n > 0), "{name}: {seen:?}");
        }
    }
}
