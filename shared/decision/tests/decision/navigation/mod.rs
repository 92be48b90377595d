//! The navigation model behind the supervisor, with symptoms and outcomes in each cycle.

use vigil_blocks::{Action, ActionOutcome, DetectionBelief, Entry, FaultBelief, RecoveryKind};
use vigil_cycle::allocation::allocations;
use vigil_decision::{Compensation, Inputs, Settings, Supervisor};
use vigil_pomdp::policy_file::PolicyFile;
use vigil_pomdp::{PointBased, Pomdp, Tracker};
use vigil_robot::FaultTree;
use vigil_setup::graph_file::GraphFile;

/// Time between cycles.
pub const CYCLE_NS: u64 = 10_000_000;
/// The paper's model.
pub const MODEL: &str = include_str!("../../../../../config/navigation.pomdp");
/// The shipped model of navigation and hardware.
pub const JOINT: &str = include_str!("../../../../../config/corridor.pomdp");
const GRAPH: &str = include_str!("../../../../../config/corridor-obstacle.toml");

/// Q-MDP about the paper's model.
pub fn settings() -> Settings {
    let mut file = toml::from_str(GRAPH).unwrap();
    by_the_papers_model(&mut file);
    file.supervisor
}

/// Has a corridor decide by the paper's model, which has fewer states and actions.
pub fn by_the_papers_model(file: &mut GraphFile) {
    let paper = ["FP", "NP", "RL", "GO", "MA", "SH", "GU"];
    file.files.decision = "navigation.pomdp".to_owned();
    file.supervisor
        .actions
        .retain(|name, _| paper.contains(&name.as_str()));
    file.supervisor.lost_state = None;
    (file.supervisor.policy, file.supervisor.policy_file) = ("qmdp".to_owned(), None);
}

/// As shipped.
pub fn joint_settings() -> Settings {
    toml::from_str::<GraphFile>(GRAPH).unwrap().supervisor
}

pub fn tree() -> FaultTree {
    let config = std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../config");
    vigil_setup::load_tree(&config.join("trees/rover.toml")).unwrap()
}

pub fn build(model: &str, settings: &Settings) -> Result<Supervisor, String> {
    let config = std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../config");
    let robot = vigil_setup::load_robot(&config.join("robots/rover.toml")).unwrap();
    let model = Pomdp::parse(model).unwrap();
    let solved = settings.policy_file.as_ref().map(|name| {
        let bytes = std::fs::read(config.join(name)).unwrap();
        let file = PolicyFile::read(&bytes, &model).unwrap();
        PointBased::new(&model, &file.vectors).unwrap()
    });
    let compensation = (0..6).map(|wheel| Compensation {
        wheel,
        curvature_gain: 1.0,
        curvature_offset_1_m: 0.1 * wheel as f64,
    });
    let compensation = compensation.collect();
    let solved = solved.as_ref();
    Supervisor::new(model, solved, &tree(), &robot, settings, compensation, 10)
        .map_err(|e| e.to_string())
}

/// A supervisor, and what it is robot.
pub struct Navigation {
    pub supervisor: Supervisor,
    pub action: Action,
    pub detection: DetectionBelief,
    pub diagnosis: FaultBelief,
    states: Vec<String>,
}

impl Navigation {
    /// By the paper's model.
    pub fn new() -> Self {
        Self::with(MODEL, &settings())
    }

    /// By the shipped model of navigation and hardware.
    pub fn joint() -> Self {
        Self::with(JOINT, &joint_settings())
    }

    pub fn with(model: &str, settings: &Settings) -> Self {
        let mut diagnosis = FaultBelief {
            tree_hash: tree().hash(),
            ..FaultBelief::default()
        };
        (diagnosis.p[0], diagnosis.p_predicted[0]) = (1.0, 1.0);
        Self {
            supervisor: build(model, settings).unwrap(),
            states: Pomdp::parse(model).unwrap().states().to_vec(),
            action: Action::default(),
            detection: DetectionBelief::default(),
            diagnosis,
        }
    }

    /// One cycle with these symptoms.
    pub fn cycle(&mut self, symptoms: u32) {
        self.detection.symptoms = symptoms;
        self.detection.header.t_capture_ns += CYCLE_NS;
        self.diagnosis.header.t_capture_ns += CYCLE_NS;
        let inputs = Inputs {
            diagnosis: Some(&self.diagnosis),
            detection: Some(&self.detection),
        };
        self.supervisor.step(Entry::Frame(inputs), &mut self.action);
    }

    pub fn rest(&mut self, seconds: f64, symptoms: u32) {
        (0..(seconds * 100.0) as u32).for_each(|_| self.cycle(symptoms));
    }

    /// The robot reports how the present decision ended.
    pub fn ended(&mut self, outcome: ActionOutcome, symptoms: u32) {
        self.detection.action_seq = self.action.decision_seq;
        self.detection.action_outcome = outcome as u32;
        self.cycle(symptoms);
    }

    /// The identifier's probability of this leaf, alone.
    pub fn identify(&mut self, leaf: &str, p: f64) {
        self.nothing();
        self.diagnosis.identifying = 1;
        self.diagnosis.p[0] = 1.0 - p;
        self.diagnosis.p[tree().index(leaf).unwrap()] = p;
    }

    /// The same of something that no fault of the tree explains.
    pub fn unknown(&mut self, p: f64) {
        self.nothing();
        self.diagnosis.identifying = 1;
        (self.diagnosis.p[0], self.diagnosis.p_unknown) = (1.0 - p, p);
    }

    /// It watches.
    pub fn nothing(&mut self) {
        self.diagnosis.identifying = 0;
        self.diagnosis.p.fill(0.0);
        (self.diagnosis.p[0], self.diagnosis.p_unknown) = (1.0, 0.0);
        self.diagnosis.set_count = 0;
    }

    pub fn kind(&self) -> RecoveryKind {
        RecoveryKind::from_repr(self.action.kind).unwrap()
    }

    /// Belief in the states with this exception.
    pub fn p(&self, exception: &str) -> f64 {
        let has = |name: &String| name.split('-').any(|part| part == exception);
        let held = self.states.iter().zip(&self.action.belief);
        held.filter(|(name, _)| has(name)).map(|(_, b)| b).sum()
    }
}

/// The belief after these steps, by the tracker alone.
pub fn tracked(steps: &[(usize, &str)]) -> Vec<f64> {
    let model = Pomdp::parse(MODEL).unwrap();
    let mut tracker = Tracker::new(&model);
    for (action, name) in steps {
        let z = model.observations().iter().position(|z| z == name);
        tracker.update(&model, *action, z.unwrap());
    }
    tracker.belief().to_vec()
}

/// Soft evidence of 1 for every state may round.
pub fn assert_near(robot: &Navigation, expected: &[f64]) {
    for (found, expected) in robot.action.belief.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

/// Index of FP.
pub const FP: usize = 0;

/// A cycle with these symptoms and without a diagnosis, which must not allocate.
pub fn cycle_without_diagnosis(
    supervisor: &mut Supervisor,
    symptoms: u32,
    detection: &mut DetectionBelief,
    action: &mut Action,
) {
    detection.header.t_capture_ns += CYCLE_NS;
    detection.symptoms = symptoms;
    let inputs = Inputs {
        diagnosis: None,
        detection: Some(detection),
    };
    let before = allocations();
    supervisor.step(Entry::Frame(inputs), action);
    assert_eq!(allocations() - before, 0);
}
