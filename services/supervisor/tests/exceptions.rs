//! The navigation model behind the supervisor: epochs, evidence, and what does not fit.

#![allow(clippy::unwrap_used, missing_docs)]

use vigil_blocks::{
    Action, ActionOutcome, ControlMode, DetectionBelief, Entry, FaultBelief, RecoveryKind, Symptoms,
};
use vigil_cycle::allocation::{CountingAllocator, allocations};
use vigil_decision::{Pomdp, Tracker};
use vigil_inference::FaultTree;
use vigil_setup::schema::{GraphFile, Supervisor as Settings};
use vigil_supervisor::{Inputs, Supervisor};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

const CYCLE_NS: u64 = 10_000_000;
const MODEL: &str = include_str!("../../../config/navigation.pomdp");
const GRAPH: &str = include_str!("../../../config/corridor-obstacle.toml");

fn settings() -> Settings {
    toml::from_str::<GraphFile>(GRAPH).unwrap().supervisor
}

fn tree() -> FaultTree {
    let config = std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../config");
    vigil_setup::load_tree(&config.join("trees/rover.toml")).unwrap()
}

fn build(model: &str, settings: &Settings) -> Result<Supervisor, String> {
    let config = std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../config");
    let robot = vigil_setup::load_robot(&config.join("robots/rover.toml")).unwrap();
    let model = Pomdp::parse(model).unwrap();
    Supervisor::new(model, None, &tree(), &robot, settings, Vec::new(), 10)
        .map_err(|e| e.to_string())
}

/// A supervisor, and what it is told.
struct Told {
    supervisor: Supervisor,
    action: Action,
    detection: DetectionBelief,
    diagnosis: FaultBelief,
}

impl Told {
    fn new() -> Self {
        let mut diagnosis = FaultBelief {
            tree_hash: tree().hash(),
            ..FaultBelief::default()
        };
        (diagnosis.p[0], diagnosis.p_predicted[0]) = (1.0, 1.0);
        Self {
            supervisor: build(MODEL, &settings()).unwrap(),
            action: Action::default(),
            detection: DetectionBelief::default(),
            diagnosis,
        }
    }

    /// One cycle with these symptoms.
    fn cycle(&mut self, symptoms: u32) {
        self.detection.symptoms = symptoms;
        self.detection.header.t_capture_ns += CYCLE_NS;
        self.diagnosis.header.t_capture_ns += CYCLE_NS;
        let inputs = Inputs {
            diagnosis: Some(&self.diagnosis),
            detection: Some(&self.detection),
        };
        self.supervisor.step(Entry::Frame(inputs), &mut self.action);
    }

    fn rest(&mut self, seconds: f64, symptoms: u32) {
        (0..(seconds * 100.0) as u32).for_each(|_| self.cycle(symptoms));
    }

    /// The robot reports how the present decision ended.
    fn ended(&mut self, outcome: ActionOutcome, symptoms: u32) {
        self.detection.action_seq = self.action.decision_seq;
        self.detection.action_outcome = outcome as u32;
        self.cycle(symptoms);
    }

    /// The identifier's probability of a fault, and what it predicted.
    fn identify(&mut self, p: f64, predicted: f64) {
        self.diagnosis.identifying = 1;
        self.diagnosis.p[0] = 1.0 - p;
        self.diagnosis.p_predicted[0] = 1.0 - predicted;
    }

    fn kind(&self) -> RecoveryKind {
        RecoveryKind::from_wire(self.action.kind).unwrap()
    }

    fn hp(&self) -> f64 {
        self.action.belief[2]
    }
}

/// The belief after these steps, by the tracker alone.
fn tracked(steps: &[(usize, &str)]) -> Vec<f64> {
    let model = Pomdp::parse(MODEL).unwrap();
    let mut tracker = Tracker::new(&model);
    for (action, name) in steps {
        let z = model.observations().iter().position(|z| z == name);
        tracker.update(&model, *action, z.unwrap());
    }
    tracker.belief().to_vec()
}

/// Soft evidence of 1 for every state may round.
fn assert_near(told: &Told, expected: &[f64]) {
    for (found, expected) in told.action.belief.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

const FP: usize = 0;
const NP: usize = 1;
const GO: usize = 3;

#[test]
fn a_firing_counts_once_however_many_cycles_carry_it() {
    let mut told = Told::new();
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
    let mut told = Told::new();
    told.rest(40.0, 0);
    assert_eq!(
        (told.kind(), told.action.decision_seq),
        (RecoveryKind::GoOn, 1)
    );
    told.cycle(Symptoms::EPS | Symptoms::SD);
    let (before, kind) = (told.action.decision_seq, told.kind());
    assert_ne!(kind, RecoveryKind::GoOn);
    for decisions in 1..10 {
        told.ended(ActionOutcome::Failed, Symptoms::EPS | Symptoms::SD);
        assert_eq!(told.action.decision_seq, before + decisions);
    }
    // Nothing helps, and it spins on the spot: hardware.
    assert_eq!(told.kind(), RecoveryKind::CallForHelp);
}

#[test]
fn an_impossible_set_is_counted_and_the_belief_restored() {
    // "Overtaken" after following the path; and a set that no observation is.
    for outcome in [Symptoms::BO, Symptoms::BO | Symptoms::ALT] {
        let mut told = Told::new();
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
fn the_identifiers_evidence_counts_once() {
    let mut told = Told::new();
    told.rest(1.0, 0);
    told.identify(0.5, 0.5);
    told.cycle(0);
    assert!(
        (told.hp() - 0.5).abs() < 1e-9,
        "it begins to identify: taken over"
    );
    let (believed, action) = (told.action.belief, told.action.action as usize);
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
    tracker.update(&model, action, eps.unwrap());
    tracker.weigh(&[1.0, 1.0, 3.0, 1.0, 1.0, 1.0, 1.0]);
    assert!(
        tracker.belief()[2] > 0.7,
        "not so far below the identifier's as to be taken over"
    );
    assert_near(&told, tracker.belief());
}

#[test]
fn hardware_is_called_help_for_at_once_and_until_the_identifier_clears_it() {
    let mut told = Told::new();
    told.rest(1.0, 0);
    told.identify(0.99, 0.9);
    told.cycle(0);
    assert_eq!(told.kind(), RecoveryKind::CallForHelp);
    assert!((told.hp() - 0.99).abs() < 1e-9);
    // The model expects help to mend it nine times in ten; the identifier still sees it.
    told.identify(0.99, 0.99);
    for _ in 0..5 {
        told.ended(ActionOutcome::Succeeded, 0);
        assert!(told.hp() > 0.94 && told.kind() == RecoveryKind::CallForHelp);
    }
    // It returns to watching.
    (told.diagnosis.identifying, told.diagnosis.p[0]) = (0, 1.0);
    told.cycle(0);
    assert_eq!((told.kind(), told.hp() < 0.01), (RecoveryKind::GoOn, true));
}

#[test]
fn a_watching_identifier_says_nothing_and_one_of_another_tree_is_refused() {
    let mut told = Told::new();
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

#[test]
fn without_symptoms_for_long_the_robot_stops_and_decides_anew_when_they_come_back() {
    let mut told = Told::new();
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
    assert!(state.contains("'HW'") && state.contains("NOM, NNP, HP, RT, PP, WD, LST"));
    assert!(message(MODEL, |s| s.actions.retain(|a, _| a != "MA")).contains("action 'MA'"));
    let twice = "discount: 0.9\nstates: 2\nactions: 1\nobservations: none EPM_LD LD_EPM\n\
                 T: * identity\nO: * uniform\n";
    let same = message(twice, |s| {
        s.actions.retain(|_, _| false);
        s.actions.insert("0".into(), settings_stop());
        s.hardware_state = None;
    });
    assert!(same.contains("'LD_EPM' and 'EPM_LD'"), "{same}");
}

fn settings_stop() -> vigil_setup::schema::RecoveryAction {
    vigil_setup::schema::RecoveryAction {
        kind: vigil_setup::schema::Recovery::Stop,
        speed_scale: None,
    }
}

#[test]
fn a_steady_cycle_allocates_nothing_and_no_number_goes_bad() {
    let mut told = Told::new();
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
