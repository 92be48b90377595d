//! The shipped decision model behind the supervisor: what it does in which situation.

use proptest::prelude::*;
use vigil_blocks::{
    AnsweredWheels, ControlMode, DetectionBelief, Entry, FaultBelief, RecoveryKind,
};
use vigil_cycle::allocation::allocations;
use vigil_decision::{Compensation, Inputs, Supervisor};
use vigil_pomdp::{Policy, Pomdp, QMdp, mdp};

use crate::world::{self, CYCLE_NS, World, model};

#[test]
fn every_certain_state_has_the_action_that_a_driver_would_expect() {
    let model = model();
    let mut policy = QMdp::new(mdp::solve(&model).unwrap());
    let mut values = vec![0.0; model.actions().len()];
    for (i, state) in model.states().iter().enumerate() {
        let mut belief = vec![0.0; model.states().len()];
        belief[i] = 1.0;
        let action = &model.actions()[policy.evaluate(&belief, &mut values).action];
        let expected = match state
            .split_once('_')
            .map_or(state.as_str(), |(_, kind)| kind)
        {
            "ND" => "go_on",
            "STUCK" => "compensate",
            "ENC" => "ignore_encoder",
            _ => "call_for_help",
        };
        assert_eq!(action, expected, "in {state}: {values:?}");
    }
    let mut doubtful = vec![0.0; model.states().len()];
    (doubtful[0], doubtful[13]) = (0.6, 0.4);
    assert_eq!(
        model.actions()[policy.evaluate(&doubtful, &mut values).action],
        "slow_down"
    );
}

#[test]
fn a_nominal_rover_goes_on() {
    let mut world = World::new();
    world.rest(500, false, &[("ND", 0.9999), ("UNKNOWN", 0.0001)]);
    assert_eq!(
        (world.kind(), world.action.decision_seq),
        (RecoveryKind::GoOn, 1)
    );
}

#[test]
fn a_named_stuck_wheel_is_compensated_in_the_cycle_that_names_it() {
    let mut world = World::new();
    world.rest(100, false, &[("ND", 0.9999), ("UNKNOWN", 0.0001)]);
    let named = [("RM_STUCK", 0.97), ("RF_STUCK", 0.02), ("ND", 0.01)];
    world.cycle(true, &named, &named);
    assert_eq!(world.kind(), RecoveryKind::Compensate);
    let wheel = world.robot.wheel_index("RM").unwrap();
    assert_eq!(world.action.answered(), AnsweredWheels::one_stuck(wheel));
    assert_eq!(
        (world.action.curvature_gain, world.action.curvature_offset),
        (1.1, wheel as f64)
    );
    assert!((world.belief("RM_STUCK") - 0.97).abs() < 0.01);
}

#[test]
fn a_belief_that_moves_is_decided_upon_at_once_and_any_other_once_an_epoch() {
    let mut world = World::new();
    let even = [("RM_STUCK", 0.5), ("RF_STUCK", 0.5)];
    let (little, much) = (
        [("RM_STUCK", 0.54), ("RF_STUCK", 0.46)],
        [("RM_STUCK", 0.75), ("RF_STUCK", 0.25)],
    );
    world.cycle(true, &even, &even);
    world.cycle(true, &little, &even);
    assert_eq!(world.belief("RM_STUCK"), 0.5);
    world.rest(9, true, &little);
    assert_eq!(world.belief("RM_STUCK"), 0.54);
    // The model expects a stuck wheel to stay stuck, of whatever is said what it held before.
    let predicted = 0.5_f64.ln();
    assert!((world.action.log_evidence - predicted).abs() < 1e-3);
    world.cycle(true, &much, &even);
    assert_eq!(world.belief("RM_STUCK"), 0.75);
    world.cycle(false, &[("ND", 1.0)], &even);
    assert_eq!(world.belief("ND"), 1.0);
}

#[test]
fn a_fault_that_has_cleared_lets_the_rover_go_on() {
    for (leaf, kind) in [
        ("RM_STUCK", RecoveryKind::Compensate),
        ("RM_ENC", RecoveryKind::IgnoreEncoder),
    ] {
        let mut world = World::new();
        world.rest(50, true, &[(leaf, 1.0)]);
        assert_eq!(world.kind(), kind);
        world.cycle(false, &[("ND", 0.998), ("UNKNOWN", 0.002)], &[]);
        assert_eq!(world.kind(), RecoveryKind::GoOn);
    }
}

#[test]
fn evidence_that_comes_and_goes_does_not_toggle_actions() {
    let decisions = |switching_cost: f64| {
        let mut world = World::with(|settings| settings.switching_cost = switching_cost);
        // Twice a second the identifier thinks otherwise, for a minute.
        for _ in 0..120 {
            world.rest(25, true, &[("ND", 0.7), ("RM_STUCK", 0.3)]);
            world.rest(25, true, &[("ND", 0.9), ("RM_STUCK", 0.1)]);
        }
        (world.action.decision_seq, world.kind())
    };
    assert!(decisions(0.0).0 > 200);
    assert_eq!(decisions(2.0), (1, RecoveryKind::SlowDown));
    // What is much better is done at once.
    let mut world = World::with(|settings| settings.switching_cost = 2.0);
    world.rest(50, false, &[("ND", 1.0)]);
    world.rest(5, true, &[("RM_STUCK", 1.0)]);
    assert_eq!(world.kind(), RecoveryKind::Compensate);
}

#[test]
fn faults_of_two_states_are_unknown_to_a_model_that_has_no_state_of_several() {
    let mut world = World::new();
    let both = [
        (&["LF_STUCK", "RF_STUCK"][..], 0.96875),
        (&["LF_STUCK"][..], 0.03125),
    ];
    let diagnosis = world.of_sets(&both);
    world.diagnose(&diagnosis);
    assert_eq!(world.kind(), RecoveryKind::CallForHelp);
    assert!((world.belief("UNKNOWN") - 0.96875).abs() < 1e-12);
    assert_eq!(world.belief("RF_STUCK"), 0.0);
}

#[test]
fn a_call_for_help_stands_until_whoever_has_helped_resets_the_filters() {
    let mut world = World::new();
    let unknown = [("UNKNOWN", 0.99), ("ND", 0.01)];
    let nominal = [("ND", 0.9999), ("UNKNOWN", 0.0001)];
    world.rest(400, true, &unknown);
    assert_eq!(world.kind(), RecoveryKind::CallForHelp);
    // The robot brakes and stands, and so looks healthy: the identifier believes it.
    world.rest(1000, false, &nominal);
    assert!(world.belief("ND") > 0.99);
    assert_eq!(world.kind(), RecoveryKind::CallForHelp);
    assert_eq!(world.action.margin, 0.0);
    // Blind for a while: it stops, and then still waits for help.
    world
        .supervisor
        .step(Entry::Missed(1000), &mut world.action);
    assert_eq!(world.kind(), RecoveryKind::Stop);
    world.rest(1000, false, &nominal);
    assert_eq!(world.kind(), RecoveryKind::CallForHelp);
    world.supervisor.step(Entry::Reset, &mut world.action);
    world.rest(100, false, &nominal);
    assert_eq!(world.kind(), RecoveryKind::GoOn);
}

#[test]
fn a_diagnosis_that_is_none_is_refused_counted_and_as_good_as_missed() {
    let nominal = [("ND", 0.9999), ("UNKNOWN", 0.0001)];
    let hash = World::new().tree.hash();
    let sound = FaultBelief {
        tree_hash: hash,
        p_unknown: 1.0,
        ..Default::default()
    };
    let mut bad = [sound; 4];
    bad[0].p[0] = f64::NAN;
    bad[1].p[4] = -0.1;
    bad[2].p_unknown = 0.0;
    bad[3].tree_hash = hash ^ 1;
    for diagnosis in bad {
        let mut world = World::new();
        world.rest(50, false, &nominal);
        let believed = world.action.belief;
        (0..3).for_each(|_| world.diagnose(&diagnosis));
        assert_eq!(world.action.belief, believed);
        let action = &world.action;
        assert_eq!((action.impossible_count, action.lost_stages), (3, 3));
        (0..7).for_each(|_| world.diagnose(&diagnosis));
        assert_eq!(world.kind(), RecoveryKind::Stop);
        world.rest(50, false, &nominal);
        assert_eq!(world.kind(), RecoveryKind::GoOn);
    }
}

#[test]
fn before_the_first_diagnosis_the_start_belief_decides() {
    let mut world = World::new();
    world.supervisor.step(Entry::Missed(0), &mut world.action);
    assert_eq!(world.kind(), RecoveryKind::GoOn);
    // go_on is worth more than nothing in a robot that is almost certainly healthy.
    assert!(world.action.value[0] > 0.0 && world.action.margin > 0.0);
}

#[test]
fn what_does_not_fit_is_named() {
    let World { tree, robot, .. } = World::new();
    let (settings, source) = (world::settings(), world::MODEL);
    let all: Vec<Compensation> = (0..6)
        .map(|wheel| Compensation {
            wheel,
            curvature_gain: 1.0,
            curvature_offset_1_m: 0.0,
        })
        .collect();
    let message = |source: &str, settings: &_, compensation: &[Compensation]| {
        let model = Pomdp::parse(source).unwrap();
        Supervisor::new(
            model,
            None,
            &tree,
            &robot,
            settings,
            compensation.to_vec(),
            10,
        )
        .err()
        .unwrap()
        .to_string()
    };
    let missing = message(&source.replace("LR_ENC", "XX_ENC"), &settings, &all);
    assert!(missing.contains("no state 'LR_ENC'"), "{missing}");
    let mut fewer = settings.clone();
    fewer.actions.remove("stop");
    assert!(message(source, &fewer, &all).contains("action 'stop'"));
    let mut more = settings.clone();
    more.actions
        .insert("fly".into(), settings.actions["stop"].clone());
    assert!(message(source, &more, &all).contains("'fly'"));
    let mut other = settings.clone();
    other.policy = "luck".into();
    assert!(message(source, &other, &all).contains("'luck'"));
    let mut spoilt = all.clone();
    spoilt[4].curvature_gain = f64::NAN;
    assert!(message(source, &settings, &spoilt).contains("wheel 4"));
    let large = "discount: 0.9\nstates: 65\nactions: 2\nobservations: 1\nT: * identity\n\
                 O: * uniform\n";
    assert!(message(large, &settings, &all).contains("65 states"));
}

#[test]
fn a_lost_identifier_leaves_the_detector_and_two_lost_stages_stop_the_robot() {
    let mut world = World::new();
    world.rest(100, false, &[("ND", 0.9999), ("UNKNOWN", 0.0001)]);
    world.supervisor.step(Entry::Missed(3), &mut world.action);
    assert_eq!(world.action.lost_stages, 3);
    let mut detection = DetectionBelief {
        p_fault: 0.5,
        ..Default::default()
    };
    let mut tell = |world: &mut World, alarm| {
        world.t_ns += CYCLE_NS;
        (detection.alarm, detection.header.t_capture_ns) = (alarm, world.t_ns);
        let inputs = Inputs {
            diagnosis: None,
            detection: Some(&detection),
        };
        let action = &mut world.action;
        world.supervisor.step(Entry::Frame(inputs), action);
    };
    // Before an alarm its odds mean nothing.
    (0..30).for_each(|_| tell(&mut world, 0));
    assert_eq!(world.kind(), RecoveryKind::GoOn);
    tell(&mut world, 1);
    assert_eq!(world.action.control_mode, ControlMode::Fallback as u32);
    assert_eq!(world.action.lost_stages, 1);
    assert_eq!(world.kind(), RecoveryKind::SlowDown);
    world.supervisor.step(Entry::Missed(10), &mut world.action);
    assert_eq!(world.kind(), RecoveryKind::Stop);
    assert_eq!(world.action.control_mode, ControlMode::Safe as u32);
    world.rest(250, false, &[("ND", 0.9999), ("UNKNOWN", 0.0001)]);
    assert_eq!(
        (world.kind(), world.action.lost_stages),
        (RecoveryKind::GoOn, 0)
    );
}

#[test]
fn a_steady_cycle_allocates_nothing() {
    let mut world = World::new();
    let belief = FaultBelief {
        tree_hash: world.tree.hash(),
        p: [0.1; 64],
        p_predicted: [0.2; 64],
        ..Default::default()
    };
    let before = allocations();
    for i in 0..10_000_u64 {
        let mut belief = belief;
        belief.header.t_capture_ns = i * CYCLE_NS;
        belief.mode_change_count = (i / 100) as u32;
        belief.identifying = (i / 1000 % 2) as u32;
        let inputs = Inputs {
            diagnosis: Some(&belief),
            detection: None,
        };
        world
            .supervisor
            .step(Entry::Frame(inputs), &mut world.action);
        world
            .supervisor
            .step(Entry::Missed((i % 5) as u32), &mut world.action);
    }
    assert_eq!(allocations() - before, 0);
}

/// Probabilities, at times none.
fn value() -> impl Strategy<Value = f64> {
    prop_oneof![6 => 0.0..=1.0, 1 => Just(0.0), 1 => Just(1.0), 1 => any::<f64>()]
}

proptest! {
    #[test]
    fn no_input_makes_a_decision_bad(
        cycles in prop::collection::vec(
            ([value(), value(), value(), value()], any::<u64>(), any::<u8>(), 0_u32..5), 1..40
        )
    ) {
        let mut world = World::new();
        for (values, t_ns, bits, missed) in cycles {
            let mut belief = FaultBelief { p_unknown: values[2], ..Default::default() };
            belief.p_unknown_predicted = values[3];
            belief.tree_hash = world.tree.hash() ^ u64::from(bits >> 7);
            belief.p = std::array::from_fn(|i| values[i % 4]);
            belief.p_predicted = std::array::from_fn(|i| values[(i + 1) % 4]);
            belief.header.t_capture_ns = t_ns;
            belief.set_count = missed * 3;
            for (i, set) in belief.sets.iter_mut().enumerate() {
                (set.leaves, set.p) = (t_ns.rotate_left(9 * i as u32), values[i % 4]);
            }
            (belief.identifying, belief.mode_change_count) = (u32::from(bits & 1), missed);
            let detection = DetectionBelief { p_fault: values[0], ..Default::default() };
            let inputs = Inputs {
                diagnosis: (bits & 2 != 0).then_some(&belief),
                detection: Some(&detection),
            };
            world.supervisor.step(Entry::Missed(missed), &mut world.action);
            world.supervisor.step(Entry::Frame(inputs), &mut world.action);
            let action = &world.action;
            let sum: f64 = action.belief.iter().sum();
            prop_assert!((sum - 1.0).abs() < 1e-6, "belief sums to {sum}");
            prop_assert!(action.belief.iter().all(|b| b.is_finite() && *b >= 0.0));
            prop_assert!(action.value.iter().all(|v| v.is_finite()));
            prop_assert!(action.entropy.is_finite() && action.margin.is_finite());
            prop_assert!((0.0..=1.0).contains(&action.speed_scale));
            prop_assert!(RecoveryKind::from_repr(action.kind).is_some());
        }
    }
}
