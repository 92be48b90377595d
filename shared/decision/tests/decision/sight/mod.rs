//! What the supervisor does about blindness, arming and odds before an alarm, and what it fuses.

use vigil_blocks::{
    Blindness, CATCHING_UP, Carryover, CauseKind, ControlMode, DetectionBelief, Entry, FaultBelief,
    Readiness, RecoveryKind,
};
use vigil_decision::Inputs;

use crate::world::{CYCLE_NS, World};

/// A detection, and what the identifier makes of it.
struct Stages {
    world: World,
    detection: DetectionBelief,
    diagnosis: FaultBelief,
}

impl Stages {
    fn new() -> Self {
        let world = World::new();
        let mut diagnosis = FaultBelief {
            tree_hash: world.tree.hash(),
            ..FaultBelief::default()
        };
        (diagnosis.p[0], diagnosis.p_predicted[0]) = (1.0, 1.0);
        let detection = DetectionBelief {
            readiness: Readiness::Armed as u32,
            ..DetectionBelief::default()
        };
        Self {
            world,
            detection,
            diagnosis,
        }
    }

    fn p_fault(&mut self, p: f64) {
        self.detection.p_fault = p;
        (self.diagnosis.p[0], self.diagnosis.p_unknown) = (1.0 - p, p);
        self.diagnosis.p_predicted = self.diagnosis.p;
        self.diagnosis.p_unknown_predicted = p;
        self.diagnosis.identifying = 1;
    }

    /// The detector's alarm stands, and the identifier holds this leaf for the cause.
    fn named(&mut self, leaf: &str) {
        self.p_fault(0.99);
        self.detection.alarm = 1;
        self.detection.alarm_t_capture_ns = 7;
        let node = self.world.tree.index(leaf).unwrap();
        self.diagnosis.p[node] = std::mem::take(&mut self.diagnosis.p_unknown);
        self.diagnosis.p_predicted = self.diagnosis.p;
    }

    /// An identifier that has just begun: it knows no more than the detector.
    fn replaced(&mut self) {
        self.diagnosis.p.fill(0.0);
        self.p_fault(0.99);
        self.detection.alarm = 1;
        self.detection.alarm_t_capture_ns = 7;
        self.diagnosis.identifying = 0;
        self.diagnosis.header.epoch = 9;
    }

    /// A supervisor that goes on from what this one leaves.
    fn succeed(&mut self) -> Carryover {
        let left = self.world.supervisor.carryover();
        let t_ns = self.world.t_ns;
        self.world = World::new();
        self.world.t_ns = t_ns;
        self.world.supervisor.restore(&left, None);
        left
    }

    fn cycles(&mut self, count: u32) {
        for _ in 0..count {
            self.world.t_ns += CYCLE_NS;
            self.detection.header.t_capture_ns = self.world.t_ns;
            self.diagnosis.header.t_capture_ns = self.world.t_ns;
            let inputs = Inputs {
                diagnosis: Some(&self.diagnosis),
                detection: Some(&self.detection),
            };
            let action = &mut self.world.action;
            self.world.supervisor.step(Entry::Frame(inputs), action);
        }
    }

    fn said(&self) -> (RecoveryKind, u32, u32) {
        let action = &self.world.action;
        (self.world.kind(), action.control_mode, action.blind)
    }
}

#[test]
fn a_blind_graph_stops_says_why_and_goes_on_when_it_sees_again() {
    const SEES: (RecoveryKind, u32, u32) = (RecoveryKind::GoOn, ControlMode::Policy as u32, 0);
    let mut stages = Stages::new();
    stages.cycles(50);
    assert_eq!(stages.said(), SEES);
    stages.detection.blind = Blindness::Clock as u32;
    for run in 0..20 {
        // A run in every frame resets nothing that keeps the robot stopped.
        (stages.detection.run_id, stages.diagnosis.run_id) = (run, run);
        stages.cycles(1);
        let expected = (RecoveryKind::Stop, ControlMode::Safe as u32, 2);
        assert_eq!(stages.said(), expected);
        assert_eq!(stages.world.action.speed_scale, 0.0);
    }
    stages.detection.blind = 0;
    stages.cycles(50);
    assert_eq!(stages.said(), SEES);
    // Told by predictions alone: nothing comes at all.
    stages.detection.cause.kind = CauseKind::Missed as u32;
    stages.detection.blind = Blindness::Silence as u32;
    for _ in 0..20 {
        let world = &mut stages.world;
        world.supervisor.step(Entry::Missed(1), &mut world.action);
        let inputs = Inputs {
            diagnosis: None,
            detection: Some(&stages.detection),
        };
        let entry = Entry::Frame(inputs);
        world.supervisor.step(entry, &mut world.action);
    }
    assert_eq!(stages.said(), (RecoveryKind::Stop, 4, 1));
    assert_eq!(
        stages.world.action.lost_stages, 3,
        "predictions are no detections"
    );
    stages.detection.cause.kind = CauseKind::Frame as u32;
    stages.detection.blind = 0;
    stages.cycles(50);
    assert_eq!(stages.said(), SEES);
}

#[test]
fn while_the_detector_arms_the_robot_goes_on_slowly() {
    let mut stages = Stages::new();
    for (readiness, scale) in [
        (Readiness::Arming, 0.5),
        (Readiness::Armed, 1.0),
        (Readiness::NotExcited, 1.0),
    ] {
        stages.detection.readiness = readiness as u32;
        stages.cycles(1);
        assert_eq!(stages.world.kind(), RecoveryKind::GoOn);
        assert_eq!(stages.world.action.speed_scale, scale);
    }
}

#[test]
fn odds_without_an_alarm_change_nothing_and_with_one_count_at_once() {
    let mut stages = Stages::new();
    for p in [0.0, 0.3, 0.9, 0.999, 0.2, 0.99] {
        stages.p_fault(p);
        stages.cycles(100);
        assert_eq!(stages.world.kind(), RecoveryKind::GoOn, "{p}");
        assert!(stages.world.belief("ND") > 0.99);
    }
    stages.detection.alarm = 1;
    stages.cycles(1);
    assert_eq!(stages.world.kind(), RecoveryKind::CallForHelp);
    let action = &stages.world.action;
    assert_eq!((action.alarm, action.alarm_count), (1, 1));
    assert!(stages.world.belief("UNKNOWN") > 0.9);
}

#[test]
fn a_latched_call_for_help_is_known_until_a_reset() {
    let mut stages = Stages::new();
    stages.p_fault(0.99);
    stages.detection.alarm = 1;
    stages.cycles(400);
    assert_eq!(stages.world.kind(), RecoveryKind::CallForHelp);
    let called = stages.world.supervisor.latched();
    assert_eq!(called, Some(stages.world.action.action as usize));
    stages.p_fault(0.0);
    stages.detection.alarm = 0;
    stages.cycles(1000);
    assert_eq!(stages.world.supervisor.latched(), called);
    let action = &mut stages.world.action;
    stages.world.supervisor.step(Entry::Reset, action);
    assert_eq!(stages.world.supervisor.latched(), None);
}

#[test]
fn a_diagnosis_of_nothing_ends_the_alarm_and_another_alarm_begins_anew() {
    let mut stages = Stages::new();
    stages.p_fault(0.9);
    (stages.detection.alarm, stages.detection.alarm_count) = (1, 1);
    stages.cycles(10);
    stages.p_fault(0.01);
    stages.cycles(95);
    assert_eq!(stages.world.action.alarm, 1);
    // At rest nothing is shown.
    stages.detection.readiness = Readiness::NotExcited as u32;
    stages.cycles(500);
    assert_eq!(stages.world.action.alarm, 1);
    stages.detection.readiness = Readiness::Armed as u32;
    stages.cycles(10);
    assert_eq!(stages.world.action.alarm, 0);
    (
        stages.detection.alarm_count,
        stages.detection.alarm_t_capture_ns,
    ) = (2, 9);
    stages.cycles(1);
    assert_eq!(stages.world.action.alarm, 1);
    assert_eq!(stages.world.action.alarm_count, 2);
}

#[test]
fn while_an_identifier_that_was_replaced_knows_nothing_what_was_believed_stands() {
    let mut stages = Stages::new();
    stages.named("RM_STUCK");
    stages.cycles(100);
    assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
    for _ in 0..10 {
        stages.replaced();
        for _ in 0..100 {
            stages.cycles(1);
            assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
            assert_eq!(stages.world.supervisor.latched(), None);
            assert!(!stages.world.supervisor.hears_identifier());
        }
    }
    stages.named("RM_STUCK");
    stages.cycles(10);
    assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
    assert!(stages.world.supervisor.hears_identifier());
}

#[test]
fn nobody_is_called_before_an_identifier_that_has_just_begun_had_time_to_see() {
    let mut stages = Stages::new();
    stages.cycles(50);
    stages.replaced();
    // One that is late is not lost.
    stages.cycles(2);
    assert_eq!(stages.world.kind(), RecoveryKind::GoOn);
    for cycle in 0..490 {
        stages.cycles(1);
        assert_eq!(stages.world.kind(), RecoveryKind::SlowDown, "{cycle}");
        assert_eq!(stages.world.supervisor.latched(), None);
    }
    stages.named("RM_STUCK");
    stages.cycles(1);
    assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
    stages.detection.alarm = 0;
    stages.p_fault(0.0);
    stages.cycles(100);
    // One that never sees anything is not waited for.
    let mut stages = Stages::new();
    stages.replaced();
    stages.cycles(510);
    assert_eq!(stages.world.kind(), RecoveryKind::CallForHelp);
    assert!(stages.world.supervisor.latched().is_some());
}

#[test]
fn a_call_for_help_stands_for_the_next_supervisor_and_is_no_other_alarm() {
    let mut stages = Stages::new();
    stages.p_fault(0.99);
    (stages.detection.alarm, stages.detection.alarm_t_capture_ns) = (1, 7);
    stages.cycles(10);
    let called = stages.world.supervisor.latched();
    assert!(called.is_some());
    let left = stages.succeed();
    assert_eq!((left.latched(), left.alarm_count), (called, 1));
    assert_eq!(stages.world.supervisor.latched(), called);
    assert_eq!(stages.world.supervisor.carryover(), left);
    // Nothing is heard yet: it stands still.
    let world = &mut stages.world;
    world.supervisor.step(Entry::Missed(1), &mut world.action);
    assert_eq!(world.kind(), RecoveryKind::Stop);
    for _ in 0..3 {
        stages.cycles(10);
        assert_eq!(stages.world.kind(), RecoveryKind::CallForHelp);
        assert_eq!(stages.world.action.alarm_count, 1);
        // A robot that stands looks healthy.
        (stages.detection.alarm, stages.detection.alarm_t_capture_ns) = (0, 0);
        stages.p_fault(0.0);
    }
    // A new run releases it, and nothing of it is left for a supervisor in the next one.
    stages.detection.run_id = 5;
    stages.diagnosis.run_id = 5;
    stages.cycles(10);
    assert_eq!(stages.world.kind(), RecoveryKind::GoOn);
    assert_eq!(stages.succeed().latched(), None);
    stages.cycles(1);
    assert_eq!(stages.world.kind(), RecoveryKind::GoOn);
}

#[test]
fn what_stood_for_another_decision_model_or_run_does_not_stand() {
    let mut stages = Stages::new();
    stages.p_fault(0.99);
    (stages.detection.alarm, stages.detection.alarm_t_capture_ns) = (1, 7);
    stages.cycles(10);
    let mut left = stages.succeed();
    left.model_hash ^= 1;
    stages.world = World::new();
    stages.world.supervisor.restore(&left, None);
    assert_eq!(stages.world.supervisor.latched(), None);
    left.model_hash ^= 1;
    left.latched = u32::MAX;
    stages.world.supervisor.restore(&left, None);
    assert_eq!(stages.world.supervisor.latched(), None);
    stages.succeed();
    (stages.detection.run_id, stages.diagnosis.run_id) = (5, 5);
    (stages.detection.alarm, stages.detection.alarm_t_capture_ns) = (0, 0);
    stages.p_fault(0.0);
    stages.cycles(1);
    assert_eq!(stages.world.kind(), RecoveryKind::GoOn);
}

#[test]
fn a_supervisor_that_is_replaced_beside_an_alarm_stands_until_it_hears_and_calls_nobody() {
    let mut stages = Stages::new();
    stages.named("RM_STUCK");
    stages.cycles(100);
    let left = stages.succeed();
    assert_eq!((left.detected_t_capture_ns, left.latched()), (7, None));
    let world = &mut stages.world;
    world.supervisor.step(Entry::Missed(1), &mut world.action);
    assert_eq!((world.kind(), world.action.alarm), (RecoveryKind::Stop, 1));
    for _ in 0..100 {
        stages.cycles(1);
        assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
    }
    assert_eq!(stages.world.supervisor.latched(), None);
    assert_eq!(stages.world.action.alarm_count, 1);
    // Detector, identifier and supervisor are new.
    stages.succeed();
    stages.replaced();
    stages.detection.header.epoch = 9;
    (stages.detection.alarm, stages.detection.alarm_t_capture_ns) = (0, 0);
    stages.detection.readiness = Readiness::Arming as u32;
    stages.cycles(2);
    assert_eq!(stages.world.kind(), RecoveryKind::Stop);
    stages.cycles(300);
    assert_eq!(stages.world.kind(), RecoveryKind::SlowDown);
    assert_eq!(stages.world.supervisor.latched(), None);
    stages.named("RM_STUCK");
    stages.detection.readiness = Readiness::Armed as u32;
    stages.cycles(1);
    assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
    assert_eq!(stages.world.action.alarm_count, 1);
}

#[test]
fn an_identifier_that_is_replaced_again_is_waited_for_as_long_as_the_first() {
    let mut stages = Stages::new();
    stages.named("RM_STUCK");
    stages.cycles(100);
    // Supervisor and identifier are replaced, and some seconds later detector and identifier.
    let told = stages.diagnosis;
    let left = stages.world.supervisor.carryover();
    stages.world = World::new();
    stages.world.supervisor.restore(&left, Some(&told));
    stages.diagnosis.header.epoch = 2;
    stages.cycles(460);
    assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
    stages.replaced();
    stages.detection.header.epoch = 9;
    (stages.detection.alarm, stages.detection.alarm_t_capture_ns) = (0, 0);
    stages.detection.readiness = Readiness::Arming as u32;
    for cycle in 0..400 {
        stages.cycles(1);
        assert_eq!(stages.world.kind(), RecoveryKind::Compensate, "{cycle}");
        assert_eq!(stages.world.supervisor.latched(), None);
    }
    // The new detector's alarm is inexplicable to the new identifier at first.
    (stages.detection.alarm, stages.detection.alarm_t_capture_ns) = (1, 9);
    stages.p_fault(0.99);
    stages.cycles(50);
    assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
    stages.named("RM_STUCK");
    stages.cycles(600);
    assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
    assert_eq!(stages.world.supervisor.latched(), None);
}

#[test]
fn what_was_told_is_believed_until_the_new_identifier_is_heard() {
    let mut stages = Stages::new();
    stages.named("RM_STUCK");
    stages.cycles(100);
    let left = stages.world.supervisor.carryover();
    let told = stages.diagnosis;
    stages.world = World::new();
    stages.world.supervisor.restore(&left, Some(&told));
    stages.replaced();
    stages.cycles(2);
    assert_eq!(stages.world.kind(), RecoveryKind::Stop);
    for _ in 0..1000 {
        stages.cycles(1);
        assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
    }
    assert_eq!(stages.world.supervisor.latched(), None);
    // It was wrong, or the fault has gone.
    stages.p_fault(0.01);
    stages.detection.alarm = 0;
    stages.cycles(300);
    assert_eq!(stages.world.kind(), RecoveryKind::GoOn);
}

#[test]
fn a_doubt_in_the_first_words_of_a_new_identifier_calls_nobody() {
    let mut stages = Stages::new();
    stages.named("RM_STUCK");
    stages.cycles(100);
    stages.replaced();
    stages.cycles(5);
    stages.named("RM_STUCK");
    let node = stages.world.tree.index("RM_STUCK").unwrap();
    // It is heard once a fault with a name is more probable than not.
    for (p, p_nominal, p_unknown, is_heard) in [(0.3, 0.3, 0.4, false), (0.55, 0.05, 0.4, true)] {
        stages.diagnosis.p[node] = p;
        (stages.diagnosis.p[0], stages.diagnosis.p_unknown) = (p_nominal, p_unknown);
        stages.cycles(10);
        assert_eq!(stages.world.supervisor.hears_identifier(), is_heard);
        assert_eq!(stages.world.supervisor.latched(), None);
    }
    stages.named("RM_STUCK");
    stages.cycles(10);
    assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
}

#[test]
fn before_its_first_result_an_identifier_that_is_waited_for_changes_nothing() {
    let mut stages = Stages::new();
    stages.named("RM_STUCK");
    stages.cycles(100);
    stages.replaced();
    stages.cycles(5);
    stages.diagnosis.p.fill(0.0);
    stages.p_fault(0.1);
    stages.diagnosis.identifying = CATCHING_UP;
    stages.cycles(20);
    assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
    assert!(stages.world.belief("RM_STUCK") > 0.9);
    // That the robot is healthy is believed of it after five seconds.
    stages.diagnosis.identifying = 1;
    stages.cycles(100);
    assert_eq!(stages.world.kind(), RecoveryKind::Compensate);
    stages.cycles(500);
    assert_eq!(stages.world.kind(), RecoveryKind::GoOn);
}

#[test]
fn misses_beside_an_alarm_call_nobody_at_once() {
    let mut stages = Stages::new();
    stages.cycles(50);
    stages.p_fault(0.99);
    (stages.detection.alarm, stages.detection.alarm_t_capture_ns) = (1, 7);
    let world = &mut stages.world;
    world.supervisor.step(Entry::Missed(3), &mut world.action);
    stages.detection.header.t_capture_ns = world.t_ns + CYCLE_NS;
    let inputs = Inputs {
        diagnosis: None,
        detection: Some(&stages.detection),
    };
    world
        .supervisor
        .step(Entry::Frame(inputs), &mut world.action);
    assert_eq!(world.kind(), RecoveryKind::SlowDown);
    assert_eq!(world.supervisor.latched(), None);
}

#[test]
fn what_is_best_is_done_at_once_after_a_restart_however_little_it_gains() {
    let mut stages = Stages::new();
    stages.named("LF_ENC");
    stages.cycles(100);
    assert_eq!(stages.world.kind(), RecoveryKind::IgnoreEncoder);
    stages.succeed();
    stages.cycles(1);
    assert_eq!(stages.world.kind(), RecoveryKind::IgnoreEncoder);
}
