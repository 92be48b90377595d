//! A supervisor with a decision model by hand, with what the identifier believes in each cycle.

use std::path::PathBuf;

use vigil_blocks::{Action, DetectionBelief, Entry, FaultBelief, RecoveryKind};
use vigil_decision::{Compensation, Inputs, Supervisor};
use vigil_pomdp::Pomdp;
use vigil_robot::Description;
use vigil_robot::FaultTree;

/// Time between cycles.
pub const CYCLE_NS: u64 = 10_000_000;

/// The shipped configuration.
pub fn config() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../config")
}

/// A decision model of the rover's faults that is no generated one.
pub const MODEL: &str = include_str!("by_hand.pomdp");

/// The decision model.
pub fn model() -> Pomdp {
    Pomdp::parse(MODEL).unwrap()
}

/// The settings that fit it.
pub fn settings() -> vigil_decision::Settings {
    toml::from_str(include_str!("by_hand.toml")).unwrap()
}

/// A diagnosis of these exact sets of faults, and of nothing else.
pub fn of_sets(tree: &FaultTree, sets: &[(&[&str], f64)]) -> FaultBelief {
    let mut belief = FaultBelief {
        identifying: 1,
        tree_hash: tree.hash(),
        set_count: sets.len() as u32,
        ..Default::default()
    };
    for (set, (leaves, p)) in belief.sets.iter_mut().zip(sets) {
        set.p = *p;
        for leaf in *leaves {
            let node = tree.index(leaf).unwrap();
            set.leaves |= 1 << node;
            belief.p[node] += p;
        }
    }
    belief.p_predicted = belief.p;
    belief
}

/// A supervisor and what it takes.
pub struct World {
    pub supervisor: Supervisor,
    pub tree: FaultTree,
    pub robot: Description,
    pub t_ns: u64,
    pub action: Action,
}

impl World {
    /// With its settings.
    pub fn new() -> Self {
        Self::with(|_| {})
    }

    /// With its settings, changed.
    pub fn with(change: impl FnOnce(&mut vigil_decision::Settings)) -> Self {
        let tree = vigil_setup::load_tree(&config().join("trees/rover.toml")).unwrap();
        let robot = vigil_setup::load_robot(&config().join("robots/rover.toml")).unwrap();
        let mut settings = settings();
        change(&mut settings);
        let compensation = (0..6)
            .map(|wheel| Compensation {
                wheel,
                curvature_gain: 1.1,
                curvature_offset_1_m: wheel as f64,
            })
            .collect();
        let supervisor =
            Supervisor::new(model(), None, &tree, &robot, &settings, compensation, 10).unwrap();
        Self {
            supervisor,
            tree,
            robot,
            t_ns: 0,
            action: Action::default(),
        }
    }

    /// One cycle in which the identifier believes `p` (by name), having predicted `predicted`;
    /// while it identifies, the detector's alarm stands.
    pub fn cycle(&mut self, identifying: bool, p: &[(&str, f64)], predicted: &[(&str, f64)]) {
        self.t_ns += CYCLE_NS;
        let mut belief = FaultBelief {
            identifying: u32::from(identifying),
            tree_hash: self.tree.hash(),
            ..Default::default()
        };
        belief.header.t_capture_ns = self.t_ns;
        for (of, list) in [(false, p), (true, predicted)] {
            for (name, value) in list {
                let node = self.tree.index(name);
                match (node, of) {
                    (Some(i), false) => belief.p[i] = *value,
                    (Some(i), true) => belief.p_predicted[i] = *value,
                    (None, false) => belief.p_unknown = *value,
                    (None, true) => belief.p_unknown_predicted = *value,
                }
            }
        }
        let mut detection = DetectionBelief {
            alarm: u32::from(identifying),
            ..DetectionBelief::default()
        };
        detection.header.t_capture_ns = self.t_ns;
        let inputs = Inputs {
            diagnosis: Some(&belief),
            detection: Some(&detection),
        };
        self.supervisor.step(Entry::Frame(inputs), &mut self.action);
    }

    /// Cycles with a belief that no data changes.
    pub fn rest(&mut self, cycles: usize, identifying: bool, p: &[(&str, f64)]) {
        (0..cycles).for_each(|_| self.cycle(identifying, p, p));
    }

    /// A diagnosis of these exact sets of faults, and of nothing else.
    pub fn of_sets(&mut self, sets: &[(&[&str], f64)]) -> FaultBelief {
        self.t_ns += CYCLE_NS;
        let mut belief = of_sets(&self.tree, sets);
        belief.header.t_capture_ns = self.t_ns;
        belief
    }

    /// One cycle with an arbitrary diagnosis and no detection.
    pub fn diagnose(&mut self, diagnosis: &FaultBelief) {
        let inputs = Inputs {
            diagnosis: Some(diagnosis),
            detection: None,
        };
        self.supervisor.step(Entry::Frame(inputs), &mut self.action);
    }

    /// What the robot is to do.
    pub fn kind(&self) -> RecoveryKind {
        RecoveryKind::from_repr(self.action.kind).unwrap()
    }

    /// Belief in a state.
    pub fn belief(&self, name: &str) -> f64 {
        let states = model().states().to_vec();
        self.action.belief[states.iter().position(|s| s == name).unwrap()]
    }
}
