//! The navigation model behind the supervisor: epochs, and what does not fit.

use vigil_blocks::{ActionOutcome, Entry, RecoveryKind, Symptoms};
use vigil_cycle::allocation::allocations;
use vigil_decision::Inputs;
use vigil_decision::{Counts, OwnSymptom, Settings};
use vigil_pomdp::{Pomdp, Tracker};

use crate::navigation::{CYCLE_NS, FP, MODEL, Navigation, assert_near, build, settings, tracked};

const NP: usize = 1;
const GO: usize = 3;

#[test]
fn a_firing_counts_once_however_many_cycles_carry_it() {
    let mut robot = Navigation::new();
    robot.rest(1.0, 0);
    assert_eq!(
        (robot.kind(), robot.action.decision_seq),
        (RecoveryKind::GoOn, 1)
    );
    robot.rest(5.0, Symptoms::EPM);
    assert_eq!(robot.kind(), RecoveryKind::GoThrough);
    assert_near(&robot, &tracked(&[(FP, "EPM")]));
    // No opening, and still there: once more. Then an alternative, and nothing any more.
    robot.ended(ActionOutcome::Failed, Symptoms::EPM);
    assert_eq!(robot.kind(), RecoveryKind::NewPath);
    assert_near(&robot, &tracked(&[(FP, "EPM"), (GO, "EPM")]));
    robot.rest(2.0, Symptoms::EPM);
    robot.ended(ActionOutcome::Succeeded, Symptoms::ALT);
    let steps = [(FP, "EPM"), (GO, "EPM"), (NP, "ALT")];
    assert_eq!(robot.kind(), RecoveryKind::GoOn);
    assert_near(&robot, &tracked(&steps));
    // The robot goes on to report it; it has been heard.
    robot.rest(14.0, Symptoms::ALT);
    assert_near(&robot, &tracked(&steps));
    robot.rest(2.0, Symptoms::ALT);
    let quiet = [steps[0], steps[1], steps[2], (FP, "none")];
    assert_near(&robot, &tracked(&quiet));
    assert_eq!(robot.action.impossible_count, 0);
}

#[test]
fn what_is_decided_again_is_done_again_but_following_goes_on() {
    let mut robot = Navigation::new();
    robot.rest(40.0, 0);
    assert_eq!(
        (robot.kind(), robot.action.decision_seq),
        (RecoveryKind::GoOn, 1)
    );
    robot.cycle(Symptoms::EPS | Symptoms::SD);
    let (before, kind) = (robot.action.decision_seq, robot.kind());
    assert_ne!(kind, RecoveryKind::GoOn);
    let mut decisions = 0;
    while robot.kind() != RecoveryKind::CallForHelp && decisions < 10 {
        robot.ended(ActionOutcome::Failed, Symptoms::EPS | Symptoms::SD);
        decisions += 1;
        assert_eq!(robot.action.decision_seq, before + decisions);
    }
    // Nothing helps, and it spins on the spot: hardware.
    assert_eq!(robot.kind(), RecoveryKind::CallForHelp);
}

#[test]
fn an_impossible_set_is_counted_and_the_belief_restored() {
    // "Overtaken" after following the path; and a set that no observation is.
    for outcome in [Symptoms::BO, Symptoms::BO | Symptoms::ALT] {
        let mut robot = Navigation::new();
        robot.cycle(0);
        robot.ended(ActionOutcome::Succeeded, outcome);
        assert_eq!(robot.action.impossible_count, 1);
        let model = Pomdp::parse(MODEL).unwrap();
        let mut tracker = Tracker::new(&model);
        tracker.predict(&model, FP);
        for (s, b) in robot.action.belief[..7].iter().enumerate() {
            let expected = 0.99 * tracker.belief()[s] + 0.01 * model.start()[s];
            assert!((b - expected).abs() < 1e-12, "{s}: {b} {expected}");
        }
        robot.rest(60.0, 0);
        assert!(robot.action.belief[0] > 0.98);
    }
}

#[test]
fn a_task_given_up_stays_given_up_until_a_reset() {
    let model = MODEL.replace("R: SH : * : * : * -10", "R: SH : * : * : * -900");
    let mut robot = Navigation::with(&model, &settings());
    robot.rest(1.0, 0);
    robot.cycle(Symptoms::EPS | Symptoms::SD);
    while robot.kind() != RecoveryKind::GiveUp && robot.action.decision_seq < 20 {
        robot.ended(ActionOutcome::Failed, Symptoms::EPS | Symptoms::SD);
    }
    assert_eq!(robot.kind(), RecoveryKind::GiveUp);
    assert!(robot.p("HP") > 0.5, "{}", robot.p("HP"));
    robot.ended(ActionOutcome::Succeeded, 0);
    robot.rest(60.0, 0);
    assert_eq!(robot.kind(), RecoveryKind::GiveUp);
    robot.supervisor.step(Entry::Reset, &mut robot.action);
    assert_eq!(robot.kind(), RecoveryKind::GoOn);
}

#[test]
fn an_action_that_runs_is_neither_ended_by_the_epoch_nor_asked_anew() {
    let mut robot = Navigation::new();
    robot.rest(1.0, 0);
    robot.cycle(Symptoms::EPM);
    assert_eq!(robot.kind(), RecoveryKind::GoThrough);
    let asked = robot.action.decision_seq;
    (robot.detection.action_seq, robot.detection.action_outcome) =
        (asked, ActionOutcome::Running as u32);
    let believed = robot.action.belief;
    robot.rest(59.0, Symptoms::EPM);
    assert_eq!(robot.action.decision_seq, asked);
    assert_eq!(robot.action.belief, believed);
    // The longest that anything may take: no opening was found.
    robot.rest(2.0, Symptoms::EPM);
    assert_eq!(robot.action.decision_seq, asked + 1);
    assert_near(&robot, &tracked(&[(FP, "EPM"), (GO, "EPM")]));
}

#[test]
fn a_symptom_while_an_action_runs_is_a_step_of_following_and_does_not_begin_it_anew() {
    let mut robot = Navigation::new();
    robot.rest(1.0, 0);
    robot.cycle(Symptoms::EPM);
    let asked = robot.action.decision_seq;
    (robot.detection.action_seq, robot.detection.action_outcome) =
        (asked, ActionOutcome::Running as u32);
    robot.cycle(Symptoms::EPM | Symptoms::SD);
    assert_near(&robot, &tracked(&[(FP, "EPM"), (FP, "EPM_SD")]));
    assert_eq!(robot.kind(), RecoveryKind::GoThrough);
    assert_eq!(robot.action.decision_seq, asked);
}

#[test]
fn what_the_robot_says_it_could_not_do_mends_nothing() {
    let lost = |outcome: ActionOutcome| {
        let mut robot = Navigation::joint();
        robot.rest(1.0, 0);
        // The pose jumps: something that no fault of the tree explains.
        robot.detection.alarm = 1;
        robot.unknown(0.99);
        robot.cycle(0);
        assert_eq!(robot.kind(), RecoveryKind::Relocalise);
        // The identifier has no more to say.
        robot.nothing();
        robot.diagnosis.identifying = 1;
        robot.cycle(0);
        assert_eq!(
            robot.kind(),
            RecoveryKind::Relocalise,
            "what jumped has jumped"
        );
        let before = robot.p("LST");
        assert!(before > 0.9);
        robot.ended(outcome, Symptoms::EPS);
        (before, robot.p("LST"))
    };
    let (before, after) = lost(ActionOutcome::Failed);
    assert!(after > 0.95 * before, "{before} {after}");
    let (_, after) = lost(ActionOutcome::Succeeded);
    assert!(after < 0.9, "{after}");
}

#[test]
fn symptoms_that_cease_while_diagnoses_come_are_missed() {
    let mut robot = Navigation::new();
    robot.rest(1.0, 0);
    for cycle in 1..=20 {
        robot.diagnosis.header.t_capture_ns += CYCLE_NS;
        let inputs = Inputs {
            diagnosis: Some(&robot.diagnosis),
            detection: None,
        };
        robot
            .supervisor
            .step(Entry::Frame(inputs), &mut robot.action);
        let (lost, kind) = match cycle {
            1..3 => (0, RecoveryKind::GoOn),
            3..10 => (2, RecoveryKind::GoOn),
            _ => (2, RecoveryKind::Stop),
        };
        assert_eq!(
            (robot.action.lost_stages, robot.kind()),
            (lost, kind),
            "{cycle}"
        );
    }
    robot.detection.header.t_capture_ns = robot.diagnosis.header.t_capture_ns;
    robot.cycle(0);
    assert_eq!(
        (robot.action.lost_stages, robot.kind()),
        (0, RecoveryKind::GoOn)
    );
}

#[test]
fn without_symptoms_for_long_the_robot_stops_and_decides_anew_when_they_come_back() {
    let mut robot = Navigation::new();
    robot.rest(1.0, 0);
    let before = robot.action.decision_seq;
    robot.supervisor.step(Entry::Missed(10), &mut robot.action);
    assert_eq!(robot.kind(), RecoveryKind::Stop);
    assert_eq!(
        (robot.action.speed_scale, robot.action.lost_stages),
        (0.0, 3)
    );
    robot.cycle(0);
    assert_eq!(robot.kind(), RecoveryKind::GoOn);
    assert_eq!(robot.action.decision_seq, before + 2);
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
    let lost = message(MODEL, |s| s.lost_state = Some("LOST".into()));
    assert!(lost.contains("lost_state: ") && lost.contains("NOM, NNP, HP, RT, PP, WD, LST"));
    let own = message(MODEL, |s| {
        let bit = |bit| OwnSymptom {
            bit,
            counts: Counts::Rising,
        };
        s.symptoms.insert("DOOR".into(), bit(9));
    });
    assert!(own.contains("[supervisor.symptoms] names 'DOOR'"), "{own}");
    assert!(message(MODEL, |s| s.actions.retain(|a, _| a != "MA")).contains("action 'MA'"));
    let twice = "discount: 0.9\nstates: 2\nactions: 1\nobservations: none EPM_LD LD_EPM\n\
                 T: * identity\nO: * uniform\n";
    let same = message(twice, |s| {
        s.actions.retain(|_, _| false);
        s.actions.insert("0".into(), settings_stop());
    });
    assert!(same.contains("'LD_EPM' and 'EPM_LD'"), "{same}");
}

fn settings_stop() -> vigil_decision::RecoveryAction {
    vigil_decision::RecoveryAction {
        kind: vigil_decision::Recovery::Stop,
        speed_scale: None,
        has_end: None,
        epoch_ms: None,
    }
}

/// A robot with a monitor of its battery and an action of its own against it.
const DOCKING: &str = "\
discount: 0.9
values: reward
states: NOM EMPTY
actions: FP DOCK
observations: none BATTERY DOCKED BATTERY_DOCKED
start: 0.99 0.01
T: FP
0.99 0.01
0 1
T: DOCK
1 0
1 0
O: FP
0.99 0.01 0 0
0.1 0.9 0 0
O: DOCK
0.05 0 0.95 0
0.05 0 0.95 0
R: FP : NOM : * : * 1
R: FP : EMPTY : * : * -5
R: DOCK : * : * : * -1
";

/// What such a robot declares.
const DECLARED: &str = "
    evidence = 'symptoms'
    epoch_ms = 5000.0
    [symptoms]
    BATTERY = { bit = 8, counts = 'standing' }
    DOCKED = { bit = 31, counts = 'outcome' }
    [actions]
    FP = { kind = 'go_on' }
    DOCK = { kind = 'own' }
";

#[test]
fn a_symptom_an_outcome_and_an_action_of_ones_own_need_no_code() {
    let (battery, docked) = (1 << 8, 1 << 31);
    let mut robot = Navigation::with(DOCKING, &toml::from_str(DECLARED).unwrap());
    robot.rest(6.0, Symptoms::EPM);
    assert_eq!(
        robot.kind(),
        RecoveryKind::GoOn,
        "a symptom that the model does not know"
    );
    robot.cycle(battery);
    assert_eq!((robot.kind(), robot.action.action), (RecoveryKind::Own, 1));
    assert_eq!(robot.action.speed_scale, 0.0);
    assert!(robot.p("EMPTY") > 0.4);
    (robot.detection.action_seq, robot.detection.action_outcome) =
        (robot.action.decision_seq, ActionOutcome::Running as u32);
    robot.rest(30.0, battery);
    assert_eq!(robot.kind(), RecoveryKind::Own, "it runs");
    robot.ended(ActionOutcome::Succeeded, docked);
    assert_eq!(robot.kind(), RecoveryKind::GoOn);
    assert_eq!(robot.action.impossible_count, 0);
}

#[test]
fn an_action_of_ones_own_that_failed_is_the_step_that_the_model_knows_of() {
    // Docking works in 7 of 10 cases; then DOCKED comes, and else nothing.
    let model = DOCKING
        .replace("T: DOCK\n1 0\n1 0", "T: DOCK\n1 0\n0.7 0.3")
        .replace(
            "O: DOCK\n0.05 0 0.95 0\n0.05 0 0.95 0",
            "O: DOCK\n0.05 0 0.95 0\n0.9 0.1 0 0",
        );
    let mut robot = Navigation::with(&model, &toml::from_str(DECLARED).unwrap());
    robot.cycle(1 << 8);
    assert_eq!(robot.kind(), RecoveryKind::Own);
    let empty = robot.p("EMPTY");
    robot.ended(ActionOutcome::Failed, 0);
    // By hand: 0.3 of EMPTY stays and is not seen to dock, the rest docks without DOCKED.
    let (stays, docks) = (0.3 * empty * 0.9, (1.0 - 0.3 * empty) * 0.05);
    let expected = stays / (stays + docks);
    assert!(
        (robot.p("EMPTY") - expected).abs() < 1e-9,
        "{}",
        robot.p("EMPTY")
    );
    assert!(expected > empty);
    assert_eq!(
        (robot.action.step_action, robot.action.impossible_count),
        (1, 0)
    );
}

#[test]
fn a_steady_cycle_allocates_nothing_and_no_number_goes_bad() {
    let mut robot = Navigation::joint();
    let before = allocations();
    for i in 0..20_000_u32 {
        let (p, unknown) = (f64::from(i % 11) / 20.0, f64::from(i % 7) / 12.0);
        robot.diagnosis.p[0] = 1.0 - p - unknown;
        (robot.diagnosis.p[12], robot.diagnosis.p_unknown) = (p, unknown);
        robot.detection.action_seq = robot.action.decision_seq;
        robot.detection.action_outcome = i / 50 % 4;
        robot.cycle(i / 30 % 128);
        let belief = &robot.action.belief;
        assert!((belief.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(belief.iter().all(|b| b.is_finite() && *b >= 0.0));
        assert!(robot.action.log_evidence.is_finite() && robot.action.margin.is_finite());
        robot
            .supervisor
            .step(Entry::Missed(i % 4), &mut robot.action);
    }
    assert_eq!(allocations() - before, 0);
    assert!(robot.action.impossible_count > 0);
}
