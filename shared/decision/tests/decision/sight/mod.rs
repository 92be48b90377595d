//! What the supervisor does about blindness, arming and odds before an alarm, and what it fuses.

use vigil_blocks::{
    Blindness, CauseKind, ControlMode, DetectionBelief, Entry, FaultBelief, Readiness, RecoveryKind,
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
    stages.detection.alarm_count = 2;
    stages.cycles(1);
    assert_eq!(stages.world.action.alarm, 1);
    assert_eq!(stages.world.action.alarm_count, 2);
}
