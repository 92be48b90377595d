//! The navigation model behind the supervisor: what identifier and detector say about hardware.

use vigil_blocks::{ActionOutcome, ControlMode, Entry, RecoveryKind, Symptoms};
use vigil_decision::Inputs;
use vigil_pomdp::{Pomdp, Tracker};

use crate::told::{CYCLE_NS, FP, MODEL, ToldSupervisor, assert_near, build, settings, tracked};

#[test]
fn the_identifiers_evidence_counts_once() {
    let mut told = ToldSupervisor::new();
    told.rest(1.0, 0);
    told.identify(0.5, 0.5);
    told.cycle(0);
    assert!(
        (told.hp() - 0.5).abs() < 1e-9,
        "it begins to identify: taken over"
    );
    let believed = told.action.belief;
    // Data 3 to 1 in favour of a fault in one cycle, then a posterior that no data changes.
    told.identify(0.75, 0.5);
    told.cycle(0);
    told.identify(0.75, 0.75);
    told.rest(5.0, 0);
    assert_eq!(told.action.belief, believed, "the epoch has not ended");
    told.cycle(Symptoms::EPS);
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
    assert_near(&told, tracker.belief());
}

#[test]
fn hardware_is_called_help_for_at_once_and_the_call_stands_until_a_new_run() {
    let mut told = ToldSupervisor::new();
    told.rest(1.0, 0);
    told.identify(0.99, 0.9);
    told.cycle(0);
    assert_eq!(told.kind(), RecoveryKind::CallForHelp);
    assert!((told.hp() - 0.99).abs() < 1e-9);
    let called = told.action.decision_seq;
    // Help takes its time, and waiting for it mends nothing.
    told.identify(0.99, 0.99);
    (told.detection.action_seq, told.detection.action_outcome) =
        (called, ActionOutcome::Running as u32);
    told.rest(100.0, 0);
    assert!(told.hp() > 0.98, "{}", told.hp());
    // It has come; the model expects it to mend nine times in ten; the identifier still sees it.
    told.ended(ActionOutcome::Succeeded, 0);
    assert!(told.hp() > 0.94);
    // It returns to watching: a robot that stands looks healthy.
    (told.diagnosis.identifying, told.diagnosis.p[0]) = (0, 1.0);
    told.cycle(0);
    assert!(told.hp() < 0.01);
    told.rest(100.0, Symptoms::EPS);
    assert_eq!(told.kind(), RecoveryKind::CallForHelp);
    assert_eq!(
        (told.action.decision_seq, told.action.margin),
        (called, 0.0)
    );
    // Whoever has helped begins a new run.
    (told.diagnosis.run_id, told.detection.run_id) = (1, 1);
    told.cycle(0);
    assert_eq!(told.kind(), RecoveryKind::GoOn);
}

#[test]
fn what_is_unknown_is_a_fault_that_nobody_has_modelled_or_a_place_that_is_lost() {
    // The place is looked for; if that does not explain it, help is called for.
    let mut told = ToldSupervisor::new();
    told.rest(1.0, 0);
    told.unknown(0.999, 0.9);
    told.cycle(0);
    assert_eq!(told.kind(), RecoveryKind::Relocalise);
    assert!((told.hp() + told.lst() - 0.999).abs() < 1e-4);
    assert!(
        told.lst() > told.hp(),
        "losing the way is the more frequent"
    );
    told.unknown(0.999, 0.999);
    told.rest(1.0, 0);
    assert_eq!(told.kind(), RecoveryKind::Relocalise);
    told.ended(ActionOutcome::Succeeded, 0);
    assert_eq!(told.kind(), RecoveryKind::CallForHelp);
    assert!(told.hp() > 0.99, "{}", told.hp());
    // Where no state means a lost robot, it is the hardware's.
    let mut alone = settings();
    alone.lost_state = None;
    let mut told = ToldSupervisor::new();
    told.supervisor = build(MODEL, &alone).unwrap();
    told.rest(1.0, 0);
    told.unknown(0.999, 0.9);
    told.cycle(0);
    assert_eq!(told.kind(), RecoveryKind::CallForHelp);
    assert!((told.hp() - 0.999).abs() < 1e-9);
}

#[test]
fn what_comes_back_after_the_place_was_sought_is_hardware_until_it_was_quiet() {
    for (seconds, kind) in [
        (5.0, RecoveryKind::CallForHelp),
        (40.0, RecoveryKind::Relocalise),
    ] {
        for outcome in [ActionOutcome::Succeeded, ActionOutcome::Failed] {
            let mut told = ToldSupervisor::new();
            told.unknown(0.999, 0.9);
            told.cycle(0);
            assert_eq!(told.kind(), RecoveryKind::Relocalise);
            // A robot that stands looks healthy; when it drives on, there it is again.
            told.nothing();
            told.cycle(0);
            told.ended(outcome, 0);
            if outcome == ActionOutcome::Failed {
                told.ended(ActionOutcome::Succeeded, 0);
            }
            assert_eq!(told.kind(), RecoveryKind::GoOn);
            told.rest(seconds, 0);
            told.unknown(0.999, 0.9);
            told.cycle(0);
            assert_eq!(told.kind(), kind, "{seconds} {outcome:?}");
        }
    }
}

#[test]
fn while_something_is_wrong_only_what_may_mend_it_is_done() {
    // The path is blocked, and nobody knows what is wrong with the robot besides.
    for policy in ["qmdp", "mls", "av", "fib"] {
        let mut settings = settings();
        settings.policy = policy.into();
        let mut told = ToldSupervisor::new();
        told.supervisor = build(MODEL, &settings).unwrap();
        told.rest(1.0, 0);
        told.cycle(Symptoms::EPM);
        assert_eq!(told.kind(), RecoveryKind::GoThrough, "{policy}");
        told.unknown(0.7, 0.69);
        for _ in 0..6 {
            told.cycle(Symptoms::EPM);
            let mends = [RecoveryKind::Relocalise, RecoveryKind::CallForHelp];
            assert!(mends.contains(&told.kind()), "{policy}: {:?}", told.kind());
            told.ended(ActionOutcome::Succeeded, Symptoms::EPM);
        }
        assert_eq!(told.kind(), RecoveryKind::CallForHelp, "{policy}");
    }
}

#[test]
fn without_the_identifier_the_detectors_alarm_is_heard() {
    let mut told = ToldSupervisor::new();
    told.rest(1.0, 0);
    told.detection.p_fault = 0.3;
    let cycle = |told: &mut ToldSupervisor| {
        told.detection.header.t_capture_ns += CYCLE_NS;
        told.supervisor.step(Entry::Missed(1), &mut told.action);
        let inputs = Inputs {
            diagnosis: None,
            detection: Some(&told.detection),
        };
        told.supervisor.step(Entry::Frame(inputs), &mut told.action);
    };
    (0..20).for_each(|_| cycle(&mut told));
    assert_eq!(told.action.control_mode, ControlMode::Fallback as u32);
    assert_eq!(told.kind(), RecoveryKind::GoOn, "no alarm");
    (told.detection.alarm, told.detection.p_fault) = (1, 0.99);
    cycle(&mut told);
    assert_eq!(told.kind(), RecoveryKind::Relocalise);
    assert!((told.hp() + told.lst() - 0.99).abs() < 1e-3);
    let believed = told.action.belief;
    let bad = told.action.impossible_count;
    told.detection.p_fault = f64::NAN;
    cycle(&mut told);
    assert_eq!(told.action.belief, believed);
    assert_eq!(told.action.impossible_count, bad + 1);
    // What was hardware stays hardware.
    let mut told = ToldSupervisor::new();
    told.identify(0.99, 0.9);
    told.rest(1.0, 0);
    (told.detection.alarm, told.detection.p_fault) = (1, 0.99);
    (0..20).for_each(|_| cycle(&mut told));
    assert!(told.hp() > 0.94, "{}", told.hp());
}

#[test]
fn a_watching_identifier_says_nothing_and_one_of_another_tree_is_refused() {
    let mut told = ToldSupervisor::new();
    told.diagnosis.p[0] = 0.2;
    told.diagnosis.p_unknown = 0.8;
    told.rest(20.0, 0);
    assert_near(&told, &tracked(&[(FP, "none")]));
    told.diagnosis.tree_hash ^= 1;
    told.rest(0.05, 0);
    assert_eq!(told.action.impossible_count, 5);
    assert_eq!(told.action.lost_stages, 1);
    assert_eq!(told.action.control_mode, ControlMode::Fallback as u32);
    // Symptoms are heard all the same.
    told.cycle(Symptoms::EPM);
    assert_eq!(told.kind(), RecoveryKind::GoThrough);
}
