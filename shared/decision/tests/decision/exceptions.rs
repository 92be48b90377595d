//! The navigation model behind the supervisor: epochs, and what does not fit.

use vigil_blocks::{ActionOutcome, Entry, RecoveryKind, Symptoms};
use vigil_cycle::allocation::allocations;
use vigil_decision::Inputs;
use vigil_decision::Settings;
use vigil_pomdp::{Pomdp, Tracker};

use crate::told::{CYCLE_NS, FP, MODEL, ToldSupervisor, assert_near, build, settings, tracked};

const NP: usize = 1;
const GO: usize = 3;

#[test]
fn a_firing_counts_once_however_many_cycles_carry_it() {
    let mut told = ToldSupervisor::new();
    told.rest(1.0, 0);
    assert_eq!(
        (told.kind(), told.action.decision_seq),
        (RecoveryKind::GoOn, 1)
    );
    told.rest(5.0, Symptoms::EPM);
    assert_eq!(told.kind(), RecoveryKind::GoThrough);
    assert_near(&told, &tracked(&[(FP, "EPM")]));
    // No opening, and still there: once more. Then an alternative, and nothing any more.
    told.ended(ActionOutcome::Failed, Symptoms::EPM);
    assert_eq!(told.kind(), RecoveryKind::NewPath);
    assert_near(&told, &tracked(&[(FP, "EPM"), (GO, "EPM")]));
    told.rest(2.0, Symptoms::EPM);
    told.ended(ActionOutcome::Succeeded, Symptoms::ALT);
    let steps = [(FP, "EPM"), (GO, "EPM"), (NP, "ALT")];
    assert_eq!(told.kind(), RecoveryKind::GoOn);
    assert_near(&told, &tracked(&steps));
    // The robot goes on to report it; it has been heard.
    told.rest(14.0, Symptoms::ALT);
    assert_near(&told, &tracked(&steps));
    told.rest(2.0, Symptoms::ALT);
    let quiet = [steps[0], steps[1], steps[2], (FP, "none")];
    assert_near(&told, &tracked(&quiet));
    assert_eq!(told.action.impossible_count, 0);
}

#[test]
fn what_is_decided_again_is_done_again_but_following_goes_on() {
    let mut told = ToldSupervisor::new();
    told.rest(40.0, 0);
    assert_eq!(
        (told.kind(), told.action.decision_seq),
        (RecoveryKind::GoOn, 1)
    );
    told.cycle(Symptoms::EPS | Symptoms::SD);
    let (before, kind) = (told.action.decision_seq, told.kind());
    assert_ne!(kind, RecoveryKind::GoOn);
    let mut decisions = 0;
    while told.kind() != RecoveryKind::CallForHelp && decisions < 10 {
        told.ended(ActionOutcome::Failed, Symptoms::EPS | Symptoms::SD);
        decisions += 1;
        assert_eq!(told.action.decision_seq, before + decisions);
    }
    // Nothing helps, and it spins on the spot: hardware.
    assert_eq!(told.kind(), RecoveryKind::CallForHelp);
}

#[test]
fn an_impossible_set_is_counted_and_the_belief_restored() {
    // "Overtaken" after following the path; and a set that no observation is.
    for outcome in [Symptoms::BO, Symptoms::BO | Symptoms::ALT] {
        let mut told = ToldSupervisor::new();
        told.cycle(0);
        told.ended(ActionOutcome::Succeeded, outcome);
        assert_eq!(told.action.impossible_count, 1);
        let model = Pomdp::parse(MODEL).unwrap();
        let mut tracker = Tracker::new(&model);
        tracker.predict(&model, FP);
        for (s, b) in told.action.belief[..7].iter().enumerate() {
            let expected = 0.99 * tracker.belief()[s] + 0.01 * model.start()[s];
            assert!((b - expected).abs() < 1e-12, "{s}: {b} {expected}");
        }
        told.rest(60.0, 0);
        assert!(told.action.belief[0] > 0.98);
    }
}

#[test]
fn a_task_given_up_stays_given_up_until_a_reset() {
    let mut told = ToldSupervisor::with_model(
        &MODEL.replace("R: SH : * : * : * -10", "R: SH : * : * : * -900"),
    );
    told.rest(1.0, 0);
    told.identify(0.99, 0.9);
    told.cycle(0);
    assert_eq!(told.kind(), RecoveryKind::GiveUp);
    assert!(told.hp() > 0.9);
    (told.diagnosis.identifying, told.diagnosis.p[0]) = (0, 1.0);
    told.ended(ActionOutcome::Succeeded, 0);
    told.rest(60.0, 0);
    assert_eq!(told.kind(), RecoveryKind::GiveUp);
    told.supervisor.step(Entry::Reset, &mut told.action);
    assert_eq!(told.kind(), RecoveryKind::GoOn);
}

#[test]
fn an_action_that_runs_is_neither_ended_by_the_epoch_nor_asked_anew() {
    let mut told = ToldSupervisor::new();
    told.rest(1.0, 0);
    told.cycle(Symptoms::EPM);
    assert_eq!(told.kind(), RecoveryKind::GoThrough);
    let asked = told.action.decision_seq;
    (told.detection.action_seq, told.detection.action_outcome) =
        (asked, ActionOutcome::Running as u32);
    let believed = told.action.belief;
    told.rest(59.0, Symptoms::EPM);
    assert_eq!(told.action.decision_seq, asked);
    assert_eq!(told.action.belief, believed);
    // The longest that anything may take: no opening was found.
    told.rest(2.0, Symptoms::EPM);
    assert_eq!(told.action.decision_seq, asked + 1);
    assert_near(&told, &tracked(&[(FP, "EPM"), (GO, "EPM")]));
}

#[test]
fn a_symptom_while_an_action_runs_is_a_step_of_following_and_does_not_begin_it_anew() {
    let mut told = ToldSupervisor::new();
    told.rest(1.0, 0);
    told.cycle(Symptoms::EPM);
    let asked = told.action.decision_seq;
    (told.detection.action_seq, told.detection.action_outcome) =
        (asked, ActionOutcome::Running as u32);
    told.cycle(Symptoms::EPM | Symptoms::SD);
    assert_near(&told, &tracked(&[(FP, "EPM"), (FP, "EPM_SD")]));
    assert_eq!(told.kind(), RecoveryKind::GoThrough);
    assert_eq!(told.action.decision_seq, asked);
}

#[test]
fn what_the_robot_says_it_could_not_do_mends_nothing() {
    let lost = |outcome: ActionOutcome| {
        let mut told = ToldSupervisor::new();
        told.rest(1.0, 0);
        // The pose jumps: something that no fault of the tree explains.
        told.unknown(0.99, 0.9);
        told.cycle(0);
        assert_eq!(told.kind(), RecoveryKind::Relocalise);
        // The identifier has no more to say.
        told.nothing();
        told.cycle(0);
        assert_eq!(
            told.kind(),
            RecoveryKind::Relocalise,
            "what jumped has jumped"
        );
        let before = told.lst();
        assert!(before > 0.9);
        told.ended(outcome, Symptoms::EPS);
        (before, told.lst())
    };
    let (before, after) = lost(ActionOutcome::Failed);
    assert!(after > 0.95 * before, "{before} {after}");
    let (_, after) = lost(ActionOutcome::Succeeded);
    assert!(after < 0.9, "{after}");
}

#[test]
fn symptoms_that_cease_while_diagnoses_come_are_missed() {
    let mut told = ToldSupervisor::new();
    told.rest(1.0, 0);
    for cycle in 1..=20 {
        told.diagnosis.header.t_capture_ns += CYCLE_NS;
        let inputs = Inputs {
            diagnosis: Some(&told.diagnosis),
            detection: None,
        };
        told.supervisor.step(Entry::Frame(inputs), &mut told.action);
        let (lost, kind) = match cycle {
            1..3 => (0, RecoveryKind::GoOn),
            3..10 => (2, RecoveryKind::GoOn),
            _ => (2, RecoveryKind::Stop),
        };
        assert_eq!(
            (told.action.lost_stages, told.kind()),
            (lost, kind),
            "{cycle}"
        );
    }
    told.detection.header.t_capture_ns = told.diagnosis.header.t_capture_ns;
    told.cycle(0);
    assert_eq!(
        (told.action.lost_stages, told.kind()),
        (0, RecoveryKind::GoOn)
    );
}

#[test]
fn without_symptoms_for_long_the_robot_stops_and_decides_anew_when_they_come_back() {
    let mut told = ToldSupervisor::new();
    told.rest(1.0, 0);
    let before = told.action.decision_seq;
    told.supervisor.step(Entry::Missed(10), &mut told.action);
    assert_eq!(told.kind(), RecoveryKind::Stop);
    assert_eq!((told.action.speed_scale, told.action.lost_stages), (0.0, 3));
    told.cycle(0);
    assert_eq!(told.kind(), RecoveryKind::GoOn);
    assert_eq!(told.action.decision_seq, before + 2);
}

#[test]
fn what_does_not_fit_is_named() {
    let message = |model: &str, change: fn(&mut Settings)| {
        let mut settings = settings();
        change(&mut settings);
        build(model, &settings).err().unwrap()
    };
    let foreign = message(&MODEL.replace("EPM_LD_SD_BO", "EPM_XX"), |_| {});
    assert!(foreign.contains("observation 'EPM_XX'") && foreign.contains("joined by '_'"));
    let lacking = message(&MODEL.replace("none", "LD_EPM_SD_EPS"), |_| {});
    assert!(lacking.contains("no observation 'none'"), "{lacking}");
    let state = message(MODEL, |s| s.hardware_state = Some("HW".into()));
    assert!(state.contains("hardware_state: ") && state.contains("no state 'HW'"));
    let lost = message(MODEL, |s| s.lost_state = Some("LOST".into()));
    assert!(lost.contains("lost_state: ") && lost.contains("NOM, NNP, HP, RT, PP, WD, LST"));
    assert!(message(MODEL, |s| s.actions.retain(|a, _| a != "MA")).contains("action 'MA'"));
    let twice = "discount: 0.9\nstates: 2\nactions: 1\nobservations: none EPM_LD LD_EPM\n\
                 T: * identity\nO: * uniform\n";
    let same = message(twice, |s| {
        s.actions.retain(|_, _| false);
        s.actions.insert("0".into(), settings_stop());
        (s.hardware_state, s.lost_state) = (None, None);
    });
    assert!(same.contains("'LD_EPM' and 'EPM_LD'"), "{same}");
}

fn settings_stop() -> vigil_decision::RecoveryAction {
    vigil_decision::RecoveryAction {
        kind: vigil_decision::Recovery::Stop,
        speed_scale: None,
    }
}

#[test]
fn a_steady_cycle_allocates_nothing_and_no_number_goes_bad() {
    let mut told = ToldSupervisor::new();
    let before = allocations();
    for i in 0..20_000_u32 {
        told.identify(f64::from(i % 11) / 10.0, f64::from(i % 7) / 6.0);
        told.diagnosis.mode_change_count = i / 700;
        told.detection.action_seq = told.action.decision_seq;
        told.detection.action_outcome = i / 50 % 4;
        told.cycle(i / 30 % 128);
        let belief = &told.action.belief[..7];
        assert!((belief.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(belief.iter().all(|b| b.is_finite() && *b >= 0.0));
        assert!(told.action.log_evidence.is_finite() && told.action.margin.is_finite());
        told.supervisor.step(Entry::Missed(i % 4), &mut told.action);
    }
    assert_eq!(allocations() - before, 0);
    assert!(told.action.impossible_count > 0);
}
