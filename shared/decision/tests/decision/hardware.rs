//! The navigation model behind the supervisor: what identifier and detector say about hardware.

use vigil_blocks::{ActionOutcome, ControlMode, Entry, RecoveryKind, Symptoms};
use vigil_decision::Inputs;
use vigil_pomdp::{Pomdp, Tracker};

use crate::navigation::{CYCLE_NS, FP, MODEL, Navigation, assert_near, build, settings, tracked};

#[test]
fn the_identifiers_evidence_counts_once() {
    let mut robot = Navigation::new();
    robot.rest(1.0, 0);
    robot.identify(0.5, 0.5);
    robot.cycle(0);
    assert!(
        (robot.hp() - 0.5).abs() < 1e-9,
        "it begins to identify: taken over"
    );
    let believed = robot.action.belief;
    // Data 3 to 1 in favour of a fault in one cycle, then a posterior that no data changes.
    robot.identify(0.75, 0.5);
    robot.cycle(0);
    robot.identify(0.75, 0.75);
    robot.rest(5.0, 0);
    assert_eq!(robot.action.belief, believed, "the epoch has not ended");
    robot.cycle(Symptoms::EPS);
    let model = Pomdp::parse(MODEL).unwrap();
    let mut tracker = Tracker::new(&model);
    tracker.anchor(&believed[..7]);
    let eps = model.observations().iter().position(|z| z == "EPS");
    // What is done about it is not done yet: a step of following.
    tracker.update(&model, FP, eps.unwrap());
    tracker.weigh(&[1.0, 1.0, 3.0, 1.0, 1.0, 1.0, 1.0]);
    assert!(
        tracker.belief()[2] > 0.7,
        "not so far below the identifier's as to be taken over"
    );
    assert_near(&robot, tracker.belief());
}

#[test]
fn hardware_is_called_help_for_at_once_and_the_call_stands_until_a_new_run() {
    let mut robot = Navigation::new();
    robot.rest(1.0, 0);
    robot.identify(0.99, 0.9);
    robot.cycle(0);
    assert_eq!(robot.kind(), RecoveryKind::CallForHelp);
    assert!((robot.hp() - 0.99).abs() < 1e-9);
    let called = robot.action.decision_seq;
    // Help takes its time, and waiting for it mends nothing.
    robot.identify(0.99, 0.99);
    (robot.detection.action_seq, robot.detection.action_outcome) =
        (called, ActionOutcome::Running as u32);
    robot.rest(100.0, 0);
    assert!(robot.hp() > 0.98, "{}", robot.hp());
    // It has come; the model expects it to mend nine times in ten; the identifier still sees it.
    robot.ended(ActionOutcome::Succeeded, 0);
    assert!(robot.hp() > 0.94);
    // It returns to watching: a robot that stands looks healthy.
    (robot.diagnosis.identifying, robot.diagnosis.p[0]) = (0, 1.0);
    robot.cycle(0);
    assert!(robot.hp() < 0.01);
    robot.rest(100.0, Symptoms::EPS);
    assert_eq!(robot.kind(), RecoveryKind::CallForHelp);
    assert_eq!(
        (robot.action.decision_seq, robot.action.margin),
        (called, 0.0)
    );
    // Whoever has helped begins a new run.
    (robot.diagnosis.run_id, robot.detection.run_id) = (1, 1);
    robot.cycle(0);
    assert_eq!(robot.kind(), RecoveryKind::GoOn);
}

#[test]
fn what_is_unknown_is_a_fault_that_nobody_has_modelled_or_a_place_that_is_lost() {
    // The place is looked for; if that does not explain it, help is called for.
    let mut robot = Navigation::new();
    robot.rest(1.0, 0);
    robot.unknown(0.999, 0.9);
    robot.cycle(0);
    assert_eq!(robot.kind(), RecoveryKind::Relocalise);
    assert!((robot.hp() + robot.lst() - 0.999).abs() < 1e-4);
    assert!(
        robot.lst() > robot.hp(),
        "losing the way is the more frequent"
    );
    robot.unknown(0.999, 0.999);
    robot.rest(1.0, 0);
    assert_eq!(robot.kind(), RecoveryKind::Relocalise);
    robot.ended(ActionOutcome::Succeeded, 0);
    assert_eq!(robot.kind(), RecoveryKind::CallForHelp);
    assert!(robot.hp() > 0.99, "{}", robot.hp());
    // Where no state means a lost robot, it is the hardware's.
    let mut alone = settings();
    alone.lost_state = None;
    let mut robot = Navigation::new();
    robot.supervisor = build(MODEL, &alone).unwrap();
    robot.rest(1.0, 0);
    robot.unknown(0.999, 0.9);
    robot.cycle(0);
    assert_eq!(robot.kind(), RecoveryKind::CallForHelp);
    assert!((robot.hp() - 0.999).abs() < 1e-9);
}

#[test]
fn what_comes_back_after_the_place_was_sought_is_hardware_until_it_was_quiet() {
    for (seconds, kind) in [
        (5.0, RecoveryKind::CallForHelp),
        (40.0, RecoveryKind::Relocalise),
    ] {
        for outcome in [ActionOutcome::Succeeded, ActionOutcome::Failed] {
            let mut robot = Navigation::new();
            robot.unknown(0.999, 0.9);
            robot.cycle(0);
            assert_eq!(robot.kind(), RecoveryKind::Relocalise);
            // A robot that stands looks healthy; when it drives on, there it is again.
            robot.nothing();
            robot.cycle(0);
            robot.ended(outcome, 0);
            if outcome == ActionOutcome::Failed {
                robot.ended(ActionOutcome::Succeeded, 0);
            }
            assert_eq!(robot.kind(), RecoveryKind::GoOn);
            robot.rest(seconds, 0);
            robot.unknown(0.999, 0.9);
            robot.cycle(0);
            assert_eq!(robot.kind(), kind, "{seconds} {outcome:?}");
        }
    }
}

#[test]
fn while_something_is_wrong_only_what_may_mend_it_is_done() {
    // The path is blocked, and nobody knows what is wrong with the robot besides.
    for policy in ["qmdp", "mls", "av", "fib"] {
        let mut settings = settings();
        settings.policy = policy.into();
        let mut robot = Navigation::new();
        robot.supervisor = build(MODEL, &settings).unwrap();
        robot.rest(1.0, 0);
        robot.cycle(Symptoms::EPM);
        assert_eq!(robot.kind(), RecoveryKind::GoThrough, "{policy}");
        robot.unknown(0.7, 0.69);
        for _ in 0..6 {
            robot.cycle(Symptoms::EPM);
            let mends = [RecoveryKind::Relocalise, RecoveryKind::CallForHelp];
            assert!(
                mends.contains(&robot.kind()),
                "{policy}: {:?}",
                robot.kind()
            );
            robot.ended(ActionOutcome::Succeeded, Symptoms::EPM);
        }
        assert_eq!(robot.kind(), RecoveryKind::CallForHelp, "{policy}");
    }
}

#[test]
fn without_the_identifier_the_detectors_alarm_is_heard() {
    let mut robot = Navigation::new();
    robot.rest(1.0, 0);
    robot.detection.p_fault = 0.3;
    let cycle = |robot: &mut Navigation| {
        robot.detection.header.t_capture_ns += CYCLE_NS;
        robot.supervisor.step(Entry::Missed(1), &mut robot.action);
        let inputs = Inputs {
            diagnosis: None,
            detection: Some(&robot.detection),
        };
        robot
            .supervisor
            .step(Entry::Frame(inputs), &mut robot.action);
    };
    (0..20).for_each(|_| cycle(&mut robot));
    assert_eq!(robot.action.control_mode, ControlMode::Fallback as u32);
    assert_eq!(robot.kind(), RecoveryKind::GoOn, "no alarm");
    (robot.detection.alarm, robot.detection.p_fault) = (1, 0.99);
    cycle(&mut robot);
    assert_eq!(robot.kind(), RecoveryKind::Relocalise);
    assert!((robot.hp() + robot.lst() - 0.99).abs() < 1e-3);
    let believed = robot.action.belief;
    let bad = robot.action.impossible_count;
    robot.detection.p_fault = f64::NAN;
    cycle(&mut robot);
    assert_eq!(robot.action.belief, believed);
    assert_eq!(robot.action.impossible_count, bad + 1);
    // What was hardware stays hardware.
    let mut robot = Navigation::new();
    robot.identify(0.99, 0.9);
    robot.rest(1.0, 0);
    (robot.detection.alarm, robot.detection.p_fault) = (1, 0.99);
    (0..20).for_each(|_| cycle(&mut robot));
    assert!(robot.hp() > 0.94, "{}", robot.hp());
}

#[test]
fn a_watching_identifier_says_nothing_and_one_of_another_tree_is_refused() {
    let mut robot = Navigation::new();
    robot.diagnosis.p[0] = 0.2;
    robot.diagnosis.p_unknown = 0.8;
    robot.rest(20.0, 0);
    assert_near(&robot, &tracked(&[(FP, "none")]));
    robot.diagnosis.tree_hash ^= 1;
    robot.rest(0.05, 0);
    assert_eq!(robot.action.impossible_count, 5);
    assert_eq!(robot.action.lost_stages, 1);
    assert_eq!(robot.action.control_mode, ControlMode::Fallback as u32);
    // Symptoms are heard all the same.
    robot.cycle(Symptoms::EPM);
    assert_eq!(robot.kind(), RecoveryKind::GoThrough);
}
