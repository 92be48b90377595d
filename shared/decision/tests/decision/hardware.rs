//! Navigation and hardware in one model: what identifier and detector say about hardware.

use vigil_blocks::{
    ActionOutcome, AnsweredWheels, CATCHING_UP, ControlMode, Entry, Readiness, RecoveryKind,
    Symptoms,
};
use vigil_decision::Inputs;

use crate::navigation::{CYCLE_NS, JOINT, Navigation, joint_settings};

/// The shipped model without a state of a lost robot: what is unknown is the hardware's.
fn without_a_lost_state() -> Navigation {
    let mut settings = joint_settings();
    settings.lost_state = None;
    Navigation::with(JOINT, &settings)
}

/// An alarm of which the identifier knows nothing.
fn alarm_alone(robot: &mut Navigation) {
    robot.detection.alarm = 1;
    robot.detection.alarm_t_capture_ns = 7;
    robot.detection.p_fault = 0.999;
    robot.nothing();
}

#[test]
fn a_stuck_wheel_is_steered_against_also_through_an_opening() {
    let mut robot = Navigation::joint();
    robot.rest(1.0, 0);
    robot.identify("RM_STUCK", 0.95);
    robot.cycle(0);
    assert_eq!(robot.kind(), RecoveryKind::Compensate);
    assert_eq!(
        (robot.action.stuck_wheels, robot.action.curvature_offset),
        (1 << 4, 0.4)
    );
    assert!((robot.p("STUCK") - 0.95).abs() < 1e-9);
    let asked = robot.action.decision_seq;
    robot.rest(20.0, 0);
    assert_eq!(robot.action.decision_seq, asked, "what goes on, goes on");
    // Something is in the way besides, and no other way leads round.
    robot.cycle(Symptoms::EPM);
    for _ in 0..6 {
        match robot.kind() {
            RecoveryKind::GoThrough => break,
            RecoveryKind::NewPath => {
                robot.ended(ActionOutcome::Failed, Symptoms::EPM | Symptoms::NNA);
            }
            _ => robot.ended(ActionOutcome::Succeeded, Symptoms::EPM),
        }
    }
    assert_eq!(robot.kind(), RecoveryKind::GoThrough);
    assert_eq!(
        (robot.action.stuck_wheels, robot.action.curvature_offset),
        (1 << 4, 0.4)
    );
    assert!(
        (robot.p("STUCK") - 0.95).abs() < 1e-9,
        "the identifier knows"
    );
    let wrong = ["NNP", "DE", "CROWD", "RT", "PP", "WD", "LST"].map(|it| robot.p(it));
    assert!(wrong.iter().sum::<f64>() > 0.6, "{wrong:?}");
    robot.ended(ActionOutcome::Succeeded, Symptoms::BO);
    assert_eq!(robot.kind(), RecoveryKind::Compensate);
    // Another wheel after all.
    robot.identify("LF_STUCK", 0.95);
    robot.cycle(0);
    assert_eq!(
        (robot.action.stuck_wheels, robot.action.curvature_offset),
        (1, 0.0)
    );
}

#[test]
fn a_broken_encoder_is_ignored_and_mended_ones_are_forgotten() {
    let mut robot = Navigation::joint();
    robot.rest(1.0, 0);
    robot.identify("LM_ENC", 0.97);
    robot.cycle(0);
    assert_eq!(
        (robot.kind(), robot.action.answered()),
        (RecoveryKind::IgnoreEncoder, AnsweredWheels::one_encoder(1))
    );
    robot.nothing();
    robot.rest(1.0, 0);
    assert_eq!(
        (robot.kind(), robot.action.answered()),
        (RecoveryKind::GoOn, AnsweredWheels::default())
    );
    assert!(robot.p("ENCODER") < 1e-3);
}

#[test]
fn two_faults_are_called_help_for_and_the_call_stands_until_a_new_run() {
    let mut robot = Navigation::joint();
    robot.rest(1.0, 0);
    robot.identify("RM_STUCK", 0.99);
    robot.diagnosis.p[8] = 0.99;
    robot.diagnosis.set_count = 1;
    let set = &mut robot.diagnosis.sets[0];
    (set.leaves, set.p) = (1 << 12 | 1 << 8, 0.99);
    robot.rest(12.0, 0);
    assert_eq!(robot.kind(), RecoveryKind::CallForHelp);
    assert!((robot.p("SEVERAL") - 0.99).abs() < 1e-6);
    let called = robot.action.decision_seq;
    // Help takes its time, and a robot that stands looks healthy.
    (robot.detection.action_seq, robot.detection.action_outcome) =
        (called, ActionOutcome::Running as u32);
    robot.nothing();
    robot.rest(100.0, Symptoms::EPS);
    assert_eq!(robot.kind(), RecoveryKind::CallForHelp);
    assert_eq!(robot.action.decision_seq, called);
    // Whoever has helped begins a new run.
    (robot.diagnosis.run_id, robot.detection.run_id) = (1, 1);
    robot.cycle(0);
    assert_eq!(robot.kind(), RecoveryKind::GoOn);
}

#[test]
fn what_is_unknown_is_a_place_that_is_lost_or_a_fault_that_nobody_has_modelled() {
    // The place is looked for; if that does not explain it, help is called for.
    let mut robot = Navigation::joint();
    robot.rest(1.0, 0);
    robot.detection.alarm = 1;
    robot.unknown(0.999);
    robot.cycle(0);
    assert_eq!(robot.kind(), RecoveryKind::Relocalise);
    let lost = robot.p("LST");
    assert!(robot.p("NOM") < 1e-3);
    assert!(lost > 0.5, "losing the way is the more frequent: {lost}");
    // While it stands, nothing is seen of either.
    robot.detection.readiness = Readiness::NotExcited as u32;
    robot.nothing();
    robot.rest(1.0, 0);
    assert_eq!(robot.kind(), RecoveryKind::Relocalise);
    robot.ended(ActionOutcome::Succeeded, 0);
    let unknown = robot.p("UNKNOWN") + robot.p("UNKNOWN_NEW");
    assert!(unknown > robot.p("LST"), "{unknown}");
    // Without a state of a lost robot it is the hardware's.
    let mut robot = without_a_lost_state();
    robot.rest(1.0, 0);
    robot.detection.alarm = 1;
    robot.unknown(0.999);
    robot.cycle(0);
    assert!((robot.p("UNKNOWN") + robot.p("UNKNOWN_NEW") - 0.999).abs() < 1e-6);
    robot.rest(31.0, 0);
    assert_eq!(robot.kind(), RecoveryKind::CallForHelp);
}

/// Nothing helps a robot that stands before what blocks its way, until it calls for help; what was
/// decided before.
fn stand_before_a_dead_end(robot: &mut Navigation) -> Vec<RecoveryKind> {
    let mut kinds = Vec::new();
    while robot.kind() != RecoveryKind::CallForHelp && kinds.len() < 40 {
        kinds.push(robot.kind());
        let (outcome, symptoms) = match robot.kind() {
            RecoveryKind::NewPath => (ActionOutcome::Failed, Symptoms::NNA),
            RecoveryKind::GoThrough => (ActionOutcome::Failed, 0),
            RecoveryKind::Relocalise | RecoveryKind::MoveAway => (ActionOutcome::Succeeded, 0),
            _ => {
                robot.rest(15.0, Symptoms::EPS);
                continue;
            }
        };
        robot.ended(outcome, Symptoms::EPS | symptoms);
    }
    kinds
}

#[test]
fn a_failed_new_path_is_not_asked_for_again_while_the_way_is_blocked() {
    let mut robot = Navigation::joint();
    robot.rest(1.0, 0);
    robot.cycle(Symptoms::EPM);
    let kinds = stand_before_a_dead_end(&mut robot);
    let at = kinds.iter().position(|kind| *kind == RecoveryKind::NewPath);
    let then = at.and_then(|at| kinds.get(at + 1));
    assert_ne!(then, Some(&RecoveryKind::NewPath), "{kinds:?}");
    assert_eq!(robot.kind(), RecoveryKind::CallForHelp, "{kinds:?}");
}

#[test]
fn a_run_that_begins_with_the_help_that_came_is_a_step_of_the_task_and_any_other_resets() {
    let called = || {
        let mut robot = Navigation::joint();
        robot.rest(1.0, 0);
        robot.identify("RM_STUCK", 0.99);
        robot.cycle(Symptoms::EPM);
        stand_before_a_dead_end(&mut robot);
        assert_eq!(robot.kind(), RecoveryKind::CallForHelp);
        robot.nothing();
        (robot.detection.run_id, robot.diagnosis.run_id) = (2, 2);
        robot
    };
    let mut fresh = Navigation::joint();
    fresh.cycle(0);
    // The paper's chance that a call is in vain is .1: of a blocked way that stays in the belief.
    let mut helped = called();
    let blocked = |robot: &Navigation| ["NNP", "DE", "CROWD"].map(|it| robot.p(it)).iter().sum();
    let (before, steps): (f64, u64) = (blocked(&helped), helped.action.step_count);
    assert!(before > 0.3, "{before}");
    let belief = helped.action.step_belief;
    helped.ended(ActionOutcome::Succeeded, 0);
    assert_eq!(helped.action.step_count, steps + 1);
    assert_eq!(helped.action.step_belief, belief, "the task goes on");
    assert_eq!(helped.action.run_id, 2);
    let left: f64 = blocked(&helped);
    assert!(
        left > 0.01 && left < 0.15 * before + 0.05,
        "{left} of {before}"
    );
    assert_ne!(helped.kind(), RecoveryKind::CallForHelp);
    let mut another = called();
    another.cycle(0);
    assert!((another.p("NNP") - fresh.p("NNP")).abs() < 0.01);
    let steps = another.action.step_count;
    another.cycle(Symptoms::EPM);
    assert_eq!(another.action.step_count, steps + 1);
    assert_eq!(another.action.step_belief, belief + 1, "it began anew");
}

#[test]
fn without_the_identifier_the_detectors_alarm_is_heard() {
    let mut robot = Navigation::joint();
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
    assert_ne!(robot.kind(), RecoveryKind::GoOn);
    let wrong = 1.0 - robot.p("NOM");
    assert!(wrong > 0.9, "{wrong}");
    let believed = robot.action.belief;
    let bad = robot.action.impossible_count;
    robot.detection.p_fault = f64::NAN;
    cycle(&mut robot);
    assert_eq!(robot.action.belief, believed);
    assert_eq!(robot.action.impossible_count, bad + 1);
    // What was a stuck wheel stays one.
    let mut robot = Navigation::joint();
    robot.identify("RM_STUCK", 0.99);
    robot.rest(1.0, 0);
    (robot.detection.alarm, robot.detection.p_fault) = (1, 0.99);
    (0..20).for_each(|_| cycle(&mut robot));
    assert!(robot.p("STUCK") > 0.98, "{}", robot.p("STUCK"));
    assert_eq!(robot.kind(), RecoveryKind::Compensate);
}

#[test]
fn an_identifier_of_another_tree_is_refused_and_symptoms_are_heard_all_the_same() {
    let mut robot = Navigation::joint();
    robot.rest(20.0, 0);
    robot.diagnosis.tree_hash ^= 1;
    robot.rest(0.05, 0);
    assert_eq!(robot.action.impossible_count, 5);
    assert_eq!(robot.action.lost_stages, 1);
    assert_eq!(robot.action.control_mode, ControlMode::Fallback as u32);
    robot.cycle(Symptoms::EPM);
    let wrong = ["NNP", "DE", "CROWD", "RT", "PP", "WD", "LST"].map(|it| robot.p(it));
    assert!(wrong.iter().sum::<f64>() > 0.5, "{wrong:?}");
}

#[test]
fn a_call_that_is_put_off_is_a_decision_of_its_own_once_it_is_made() {
    let mut robot = without_a_lost_state();
    robot.rest(1.0, 0);
    alarm_alone(&mut robot);
    let mut before = (robot.kind(), robot.action.decision_seq);
    for cycle in 0..6000 {
        robot.cycle(0);
        let now = (robot.kind(), robot.action.decision_seq);
        assert!(
            now.0 == before.0 || now.1 > before.1,
            "{cycle}: {before:?}, {now:?}"
        );
        assert!(cycle > 490 || now.0 != RecoveryKind::CallForHelp, "{cycle}");
        assert!(cycle > 490 || robot.supervisor.latched().is_none());
        before = now;
    }
    assert_eq!(before.0, RecoveryKind::CallForHelp);
    assert!(robot.supervisor.latched().is_some());
}

#[test]
fn an_identifier_that_is_late_by_a_cycle_calls_nobody() {
    let mut robot = without_a_lost_state();
    robot.rest(1.0, 0);
    alarm_alone(&mut robot);
    robot.cycle(0);
    robot.diagnosis.identifying = CATCHING_UP;
    robot.rest(0.1, 0);
    assert_eq!(robot.kind(), RecoveryKind::GoOn);
    robot.identify("RM_STUCK", 0.99);
    robot.rest(1.0, 0);
    assert_eq!(robot.supervisor.latched(), None);
    assert!(robot.p("STUCK") + robot.p("STUCK_NEW") > 0.9);
}

#[test]
fn what_was_told_is_believed_over_the_death_of_the_supervisor() {
    let mut robot = Navigation::joint();
    robot.rest(1.0, 0);
    alarm_alone(&mut robot);
    robot.identify("RM_STUCK", 0.99);
    robot.rest(1.0, 0);
    assert_eq!(robot.kind(), RecoveryKind::Compensate);
    let (left, told) = (robot.supervisor.carryover(), robot.diagnosis);
    // Another supervisor, and an identifier that has seen nothing yet.
    let mut next = Navigation::joint();
    next.supervisor.restore(&left, Some(&told));
    next.detection = robot.detection;
    alarm_alone(&mut next);
    next.diagnosis.header.t_capture_ns = told.header.t_capture_ns;
    next.cycle(0);
    for _ in 0..300 {
        next.cycle(0);
        assert!([RecoveryKind::Stop, RecoveryKind::Compensate].contains(&next.kind()));
    }
    assert_eq!(next.kind(), RecoveryKind::Compensate);
    assert_eq!(next.action.stuck_wheels, 1 << 4);
    assert_eq!(next.supervisor.latched(), None);
}
