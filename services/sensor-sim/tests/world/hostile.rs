//! Whatever arrives: no panic, no number that is not finite, and a stop.

use proptest::prelude::*;
use vigil_blocks::Action;
use vigil_robot::FaultKind;
use vigil_sensor_sim::{ActionGate, DriveCommand, EffectiveCommand, World};
use vigil_setup::graph_file::Simulator;

use crate::rover::{all_finite, fault, measure, robot, segment};

/// Any bit pattern, and often an ordinary number.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<u64>().prop_map(f64::from_bits),
        -2.0_f64..2.0,
        Just(f64::NAN),
        Just(f64::INFINITY),
    ]
}

fn action() -> impl Strategy<Value = Action> {
    (
        0_u32..9,
        any::<u64>(),
        0_u64..3000,
        [number(), number(), number()],
    )
        .prop_map(
            |(
                kind,
                decision_seq,
                valid_until_ns,
                [speed_scale, curvature_gain, curvature_offset],
            )| {
                Action {
                    kind,
                    decision_seq,
                    valid_until_ns,
                    speed_scale,
                    curvature_gain,
                    curvature_offset,
                    ..Action::default()
                }
            },
        )
}

fn world() -> World {
    let segments = [segment(0.05, 0.5, 0.2), segment(0.05, -0.5, 0.3)];
    World::new(&robot(), &Simulator::default(), &segments, 100.0, 1).unwrap()
}

proptest! {
    #[test]
    fn hostile_actions_never_break_the_rover(
        actions in proptest::collection::vec((action(), 0_u64..4000), 1..40),
        stuck in 0_usize..6,
    ) {
        let (mut world, mut gate) = (world(), ActionGate::new(&robot().limits));
        world.inject(fault(FaultKind::Stuck, stuck)).unwrap();
        for (action, now_ns) in &actions {
            let command = gate.apply(world.planned(), Some(action), *now_ns);
            let target = command.target;
            prop_assert!(target.curvature_1_m.abs() <= 1.2 && target.speed_m_s.abs() <= 0.5);
            prop_assert!((0.0..=1.0).contains(&command.progress));
            let expired = *now_ns > action.valid_until_ns;
            let finite = [action.speed_scale, action.curvature_gain, action.curvature_offset]
                .iter()
                .all(|value| value.is_finite());
            if expired || !finite || !(1..=11).contains(&action.kind) {
                prop_assert!(command.rejection.is_some() && target.speed_m_s == 0.0);
            }
            world.step(0.01, command);
            let frame = measure(&mut world);
            prop_assert!(all_finite(&frame), "{frame:?}");
            prop_assert_eq!(frame.safe_stop == 1, command.rejection.is_some());
        }
        prop_assert_eq!(world.invalid(), 0);
    }

    #[test]
    fn hostile_steps_never_break_the_world(
        steps in proptest::collection::vec((number(), number(), number(), number()), 1..40),
    ) {
        let mut world = world();
        for (dt_s, curvature_1_m, speed_m_s, progress) in steps {
            let command = EffectiveCommand {
                target: DriveCommand { curvature_1_m, speed_m_s },
                progress,
                rejection: None,
                action_seq: 1,
            };
            let invalid = world.invalid();
            world.step(dt_s, command);
            let frame = measure(&mut world);
            prop_assert!(all_finite(&frame), "{frame:?}");
            if !(dt_s.is_finite() && dt_s > 0.0) {
                prop_assert_eq!(world.invalid(), invalid + 1);
            }
        }
    }
}
