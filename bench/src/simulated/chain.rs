//! Detector and identifier, one frame at a time.

use std::error::Error;

use vigil_blocks::{
    DetectionBelief, Entry, FaultBelief, MODE_MULTIPLE, MODE_UNKNOWN, ParticleBlock, SensorFrame,
};
use vigil_detector::Detector;
use vigil_identifier::{Identifier, Input, Models};
use vigil_setup::schema::{self, Sensors};

use super::Rover;

/// What was said after one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// The detector's alarm.
    pub alarm: bool,
    /// Reported mode: `ND`, a node of the tree, `UNKNOWN` or `MULTIPLE`.
    pub mode: String,
    /// Its probability.
    pub p_mode: f64,
    /// Probability that no modelled fault explains the data.
    pub p_unknown: f64,
    /// Leaves of the most probable set, joined by `+`; `ND` for none.
    pub fault_set: String,
}

impl Said {
    /// True if the mode names a fault with more than `p`.
    #[must_use]
    pub fn names_a_fault(&self, p: f64) -> bool {
        self.p_mode > p && self.mode != "ND" && self.mode != "UNKNOWN"
    }
}

/// Detector and identifier with the settings that ship, from scratch.
#[derive(Debug, Clone)]
pub struct Chain {
    detector: Detector,
    identifier: Identifier,
    names: Vec<String>,
    detection: Box<DetectionBelief>,
    detection_particles: Box<ParticleBlock>,
    diagnosis: Box<FaultBelief>,
    diagnosis_particles: Box<ParticleBlock>,
}

impl Chain {
    /// A chain that uses these sensors.
    ///
    /// # Errors
    /// If model, robot, tree and settings do not fit together.
    pub fn new(rover: &Rover, sensors: Sensors, seed: u64) -> Result<Self, Box<dyn Error>> {
        let Rover { robot, model, tree } = rover;
        let detector = schema::Detector {
            sensors,
            ..schema::Detector::default()
        };
        let identifier = schema::Identifier::default();
        let models = Models {
            model,
            robot,
            tree,
            decision: None,
        };
        let names = tree.nodes().iter().map(|node| node.name.clone());
        Ok(Self {
            detector: Detector::new(model, robot, &detector)?,
            identifier: Identifier::new(&models, &identifier, sensors, seed)?,
            names: names.collect(),
            detection: Box::default(),
            detection_particles: Box::default(),
            diagnosis: Box::default(),
            diagnosis_particles: Box::default(),
        })
    }

    /// Takes a frame; true if the detector's alarm stands.
    pub fn take(&mut self, frame: &SensorFrame) -> bool {
        let (detection, particles) = (&mut *self.detection, &mut *self.detection_particles);
        self.detector
            .step(Entry::Frame(frame), detection, particles);
        let input = Input {
            frame,
            detection: Some((detection, particles)),
        };
        let (diagnosis, particles) = (&mut *self.diagnosis, &mut *self.diagnosis_particles);
        self.identifier
            .step(Entry::Frame(input), diagnosis, particles);
        self.detection.alarm != 0
    }

    /// What is said now, in words.
    #[must_use]
    pub fn said(&self) -> Said {
        let belief = &self.diagnosis;
        let name = |node: usize| self.names.get(node).map_or("?", String::as_str);
        let mode = match belief.mode {
            MODE_UNKNOWN => "UNKNOWN",
            MODE_MULTIPLE => "MULTIPLE",
            node => name(node as usize),
        };
        let leaves = belief.sets[0].leaves;
        let set: Vec<&str> = (1..u64::BITS as usize)
            .filter(|i| leaves >> i & 1 == 1)
            .map(name)
            .collect();
        Said {
            alarm: self.detection.alarm != 0,
            mode: mode.to_owned(),
            p_mode: belief.p_mode,
            p_unknown: belief.p_unknown,
            fault_set: if set.is_empty() {
                name(0).to_owned()
            } else {
                set.join("+")
            },
        }
    }
}
