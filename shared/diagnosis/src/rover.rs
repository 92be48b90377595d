//! The shipped rover, for tests that drive real objects.

use std::path::{Path, PathBuf};

use vigil_robot::learned::Model;
use vigil_robot::{Description, FaultTree};

use crate::Sensors;
use crate::identify::{self, Identifier, LeafMap, Models};

/// A file of `config`.
fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../config")
        .join(name)
}

/// Description, model and fault tree.
pub struct Rover {
    pub robot: Description,
    pub model: Model,
    pub tree: FaultTree,
}

impl Rover {
    /// With the faults of motion and encoders.
    pub fn new() -> Self {
        Self::with("trees/rover.toml")
    }

    /// With those of gyro and currents too.
    pub fn with_all_faults() -> Self {
        Self::with("trees/rover-all.toml")
    }

    fn with(tree: &str) -> Self {
        let model = std::fs::read_to_string(config("models/rover.toml")).unwrap();
        Self {
            robot: vigil_setup::load_robot(&config("robots/rover.toml")).unwrap(),
            model: Model::from_toml(&model).unwrap(),
            tree: vigil_setup::load_tree(&config(tree)).unwrap(),
        }
    }

    pub fn leaves(&self, sensors: Sensors) -> LeafMap {
        LeafMap::new(&self.tree, &self.model, &self.robot, sensors).unwrap()
    }

    /// With the default settings, by pose and encoders.
    pub fn identifier(&self) -> Identifier {
        let models = Models {
            model: &self.model,
            robot: &self.robot,
            tree: &self.tree,
            risks: None,
        };
        let settings = identify::Settings::default();
        Identifier::new(&models, &settings, Sensors::PoseEncoders, 1).unwrap()
    }
}
