//! Several faults at once, by the rover's shipped model and policy.

use vigil_blocks::{Action, AnsweredWheels, ControlMode, DetectionBelief, Entry, RecoveryKind};
use vigil_decision::{Inputs, Supervisor};
use vigil_setup::{Setup, load_graph};
use vigil_supervisor::assemble;

use crate::world::{CYCLE_NS, config, of_sets};

/// The shipped supervisor, and what the identifier holds.
struct Rover {
    setup: Setup,
    supervisor: Supervisor,
    t_ns: u64,
    action: Action,
}

impl Rover {
    fn new() -> Self {
        let setup = load_graph(&config().join("rover.toml"), |_| {}).unwrap();
        Self {
            supervisor: assemble(&setup).unwrap(),
            setup,
            t_ns: 0,
            action: Action::default(),
        }
    }

    /// Twenty cycles in which these sets of leaves have these probabilities, and nothing else any.
    fn believe(&mut self, sets: &[(&[&str], f64)]) -> RecoveryKind {
        let mut diagnosis = of_sets(&self.setup.tree, sets);
        for _ in 0..20 {
            self.t_ns += CYCLE_NS;
            diagnosis.header.t_capture_ns = self.t_ns;
            let mut detection = DetectionBelief {
                alarm: 1,
                ..DetectionBelief::default()
            };
            detection.header.t_capture_ns = self.t_ns;
            let inputs = Inputs {
                diagnosis: Some(&diagnosis),
                detection: Some(&detection),
            };
            self.supervisor.step(Entry::Frame(inputs), &mut self.action);
        }
        RecoveryKind::from_repr(self.action.kind).unwrap()
    }

    /// Gain and offset that steer against these wheels.
    fn counter(&self, wheels: &[usize]) -> (f64, f64) {
        let each = wheels.iter().map(|w| self.setup.model.compensation(*w));
        each.fold((1.0, 0.0), |(gain, offset), one| {
            (gain + one.0 - 1.0, offset + one.1)
        })
    }

    fn demand_counter(&self, wheels: &[usize]) {
        let (gain, offset) = self.counter(wheels);
        let (found, at) = (self.action.curvature_gain, self.action.curvature_offset);
        assert!((found - gain).abs() < 1e-12, "{found} {gain}");
        assert!((at - offset).abs() < 1e-12, "{at} {offset}");
    }
}

#[test]
fn a_rover_limps_home_with_all_that_is_broken_answered() {
    let mut rover = Rover::new();
    assert_eq!(
        rover.believe(&[(&["LF_STUCK"], 1.0)]),
        RecoveryKind::Compensate
    );
    assert_eq!(rover.action.answered(), AnsweredWheels::one_stuck(0));
    rover.demand_counter(&[0]);
    let kind = rover.believe(&[(&["LF_STUCK", "RM_ENC"], 0.9), (&["LF_STUCK"], 0.1)]);
    assert_eq!(kind, RecoveryKind::LimpHome);
    let both = AnsweredWheels::one_stuck(0).with(AnsweredWheels::one_encoder(4));
    assert_eq!(rover.action.answered(), both);
    rover.demand_counter(&[0]);
    assert!(rover.action.speed_scale < 1.0);
    // Another set is answered once it is more likely than not, or twice as likely as the one that
    // is answered; a change of it is a decision.
    let asked = rover.action.decision_seq;
    let other: &[&str] = &["LF_STUCK", "RR_STUCK"];
    let third: &[&str] = &["LF_ENC", "RM_ENC"];
    let held: &[&str] = &["LF_STUCK", "RM_ENC"];
    rover.believe(&[(other, 0.45), (held, 0.4), (third, 0.15)]);
    assert_eq!(
        (rover.action.answered(), rover.action.decision_seq),
        (both, asked)
    );
    rover.believe(&[(other, 0.55), (&["LF_STUCK", "RM_ENC"], 0.45)]);
    let stuck = AnsweredWheels::one_stuck(0).with(AnsweredWheels::one_stuck(5));
    assert_eq!(
        (rover.action.answered(), rover.action.decision_seq),
        (stuck, asked + 1)
    );
    rover.demand_counter(&[0, 5]);
    rover.believe(&[(third, 0.4), (held, 0.35), (other, 0.15)]);
    let encoders = AnsweredWheels::one_encoder(0).with(AnsweredWheels::one_encoder(4));
    assert_eq!(rover.action.answered(), encoders);
    rover.demand_counter(&[]);
    // Mended again.
    assert_eq!(
        rover.believe(&[(&["RR_STUCK"], 1.0)]),
        RecoveryKind::Compensate
    );
    assert_eq!(rover.action.answered(), AnsweredWheels::one_stuck(5));
}

#[test]
fn a_settled_doubt_stays_and_so_does_what_is_done_about_it() {
    let mut rover = Rover::new();
    let doubt: [(&[&str], f64); 2] = [(&["LF_STUCK"], 0.97), (&["LM_STUCK"], 0.03)];
    rover.believe(&doubt);
    rover.believe(&doubt);
    rover.believe(&doubt);
    let before = rover.action;
    for _ in 0..300 {
        assert_eq!(rover.believe(&doubt), RecoveryKind::Compensate);
        assert_eq!(rover.action.belief, before.belief);
        assert_eq!(rover.action.decision_seq, before.decision_seq);
    }
}

#[test]
fn without_an_identifier_the_belief_says_what_the_detector_does() {
    let mut rover = Rover::new();
    for cycle in 0..100 {
        rover.t_ns += CYCLE_NS;
        let alarm = u32::from(cycle >= 50);
        let mut detection = DetectionBelief {
            alarm,
            p_fault: 0.75,
            ..DetectionBelief::default()
        };
        detection.header.t_capture_ns = rover.t_ns;
        let inputs = Inputs {
            diagnosis: None,
            detection: Some(&detection),
        };
        let action = &mut rover.action;
        rover.supervisor.step(Entry::Missed(1), action);
        rover.supervisor.step(Entry::Frame(inputs), action);
        // A run begins with nothing wrong, and before an alarm its odds mean nothing.
        let nominal = if alarm == 0 { 1.0 } else { 0.25 };
        assert!((action.belief[0] - nominal).abs() < 1e-9, "{cycle}");
    }
    assert_eq!(rover.action.control_mode, ControlMode::Fallback as u32);
}

#[test]
fn whoever_does_not_know_which_wheel_is_stuck_calls_for_help() {
    for sets in [
        [(&["LF_STUCK"][..], 0.5), (&["LM_STUCK"], 0.5)],
        [(&["LF_STUCK"], 0.5), (&["LF_ENC"], 0.5)],
        [(&["LF_STUCK", "LM_STUCK"], 0.5), (&["LF_STUCK"], 0.5)],
    ] {
        let mut rover = Rover::new();
        for _ in 0..10 {
            assert_ne!(rover.believe(&sets), RecoveryKind::Compensate, "{sets:?}");
        }
        assert_eq!(rover.believe(&sets), RecoveryKind::CallForHelp, "{sets:?}");
    }
}

#[test]
fn two_stuck_wheels_on_one_side_are_called_help_for() {
    for pair in [["LF_STUCK", "LM_STUCK"], ["RM_STUCK", "RR_STUCK"]] {
        let mut rover = Rover::new();
        assert_eq!(rover.believe(&[(&pair, 1.0)]), RecoveryKind::CallForHelp);
        assert!(rover.action.answered().is_empty());
    }
    let mut rover = Rover::new();
    let three: &[&str] = &["LF_ENC", "LM_ENC", "RR_ENC"];
    assert_eq!(rover.believe(&[(three, 1.0)]), RecoveryKind::LimpHome);
    assert_eq!(rover.action.broken_encoders, 0b10_0011);
    rover.demand_counter(&[]);
}
