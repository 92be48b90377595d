//! What changes an action, its wheel and the run, and what does not.

use vigil_blocks::{ControlMode, DetectionBelief, Entry, RecoveryKind};
use vigil_decision::Inputs;

use crate::world::{CYCLE_NS, World};

/// A world in which a change of action costs so much.
fn world(switching_cost: f64) -> World {
    World::with(|settings| settings.switching_cost = switching_cost)
}

fn wheel(world: &World) -> Option<&str> {
    let wheel = world.action.answered().wheels().next();
    let wheel = wheel.and_then(|wheel| world.robot.wheels.get(wheel));
    wheel.map(|wheel| wheel.name.as_str())
}

#[test]
fn an_action_that_is_kept_for_its_price_keeps_its_wheel() {
    let mut world = world(10.0);
    world.rest(50, true, &[("RM_STUCK", 1.0)]);
    assert_eq!(world.kind(), RecoveryKind::Compensate);
    let decision = world.action.decision_seq;
    // Going on earns 3 more an epoch; what little is believed of others is nobody's matter.
    for _ in 0..25 {
        world.rest(1, false, &[("ND", 0.998), ("RR_STUCK", 0.002)]);
        assert_eq!(
            (world.kind(), wheel(&world)),
            (RecoveryKind::Compensate, Some("RM"))
        );
        assert_eq!(world.action.decision_seq, decision);
    }
    world.rest(20, false, &[("ND", 0.998), ("RR_STUCK", 0.002)]);
    assert_eq!((world.kind(), wheel(&world)), (RecoveryKind::GoOn, None));
}

#[test]
fn another_wheel_is_compensated_at_once_if_it_is_named_and_else_not() {
    let mut world = world(1.0);
    let stuck = |left: f64, right: f64| [("LF_STUCK", left), ("RF_STUCK", right)];
    let one = |world: &mut World, p: [(&str, f64); 2]| {
        let (left, right) = (p[0].1, p[1].1);
        let sets = [(&["LF_STUCK"][..], left), (&["RF_STUCK"][..], right)];
        let diagnosis = world.of_sets(&sets);
        world.diagnose(&diagnosis);
    };
    one(&mut world, stuck(0.95, 0.05));
    assert_eq!(
        (world.kind(), wheel(&world)),
        (RecoveryKind::Compensate, Some("LF"))
    );
    one(&mut world, stuck(0.05, 0.95));
    assert_eq!(
        (world.kind(), wheel(&world)),
        (RecoveryKind::Compensate, Some("RF"))
    );
    let decision = world.action.decision_seq;
    for k in 0..60 {
        let p = [0.49, 0.51][k % 2];
        one(&mut world, stuck(p - 0.02, 0.98 - p));
    }
    assert_eq!(
        (wheel(&world), world.action.decision_seq),
        (Some("RF"), decision)
    );
}

#[test]
fn a_new_run_without_the_identifier_ends_what_stood() {
    let mut world = world(1.0);
    let unknown = [("UNKNOWN", 0.99), ("ND", 0.01)];
    world.rest(50, true, &unknown);
    assert_eq!(world.kind(), RecoveryKind::CallForHelp);
    let mut detection = DetectionBelief::default();
    let mut tell = |world: &mut World, run_id: u64, alarm: u32| {
        world.t_ns += CYCLE_NS;
        (detection.run_id, detection.alarm) = (run_id, alarm);
        detection.alarm_count = alarm;
        detection.p_fault = f64::from(alarm);
        detection.header.t_capture_ns = world.t_ns;
        let inputs = Inputs {
            diagnosis: None,
            detection: Some(&detection),
        };
        world.supervisor.step(Entry::Missed(1), &mut world.action);
        world
            .supervisor
            .step(Entry::Frame(inputs), &mut world.action);
    };
    (0..5).for_each(|_| tell(&mut world, 0, 0));
    assert_eq!(world.kind(), RecoveryKind::CallForHelp, "it stands");
    tell(&mut world, 7, 0);
    assert_eq!((world.kind(), world.action.run_id), (RecoveryKind::GoOn, 7));
    assert_eq!(world.action.control_mode, ControlMode::Fallback as u32);
    // What nobody has named is any fault, as often as each arises.
    tell(&mut world, 7, 1);
    assert!(world.belief("ND") < 1e-9);
    assert_ne!(world.kind(), RecoveryKind::GoOn);
}
