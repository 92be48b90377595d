//! The simulated rover through detector and identifier in one process, as they run live.

mod stages;

pub use stages::Stages;

use std::error::Error;
use std::path::Path;

use vigil_diagnosis::Sensors;
use vigil_robot::Description;
use vigil_robot::FaultTree;
use vigil_robot::learned::Model;

/// The two sets of channels, and their names.
pub const SENSOR_SETS: [(Sensors, &str); 2] = [
    (Sensors::Pose, "pose"),
    (Sensors::PoseEncoders, "pose+encoders"),
];

/// The same, and everything that the frames hold.
pub const ALL_SETS: [(Sensors, &str); 3] = [SENSOR_SETS[0], SENSOR_SETS[1], (Sensors::All, "all")];

/// The rover as it ships.
#[derive(Debug)]
pub struct Rover {
    /// Its description.
    pub robot: Description,
    /// What was learned of it.
    pub model: Model,
    /// Its faults.
    pub tree: FaultTree,
}

impl Rover {
    /// Reads the configuration below `root`.
    ///
    /// # Errors
    /// A file that cannot be read or does not fit.
    pub fn read(root: &Path) -> Result<Self, Box<dyn Error>> {
        let robot = vigil_setup::load_robot(&root.join("config/robots/rover.toml"))?;
        let model = vigil_setup::load_model(&root.join("config/models/rover.toml"), Some(&robot))?;
        let model = model
            .with_faults()
            .ok_or("the rover's model has no faults")?;
        let tree = vigil_setup::load_tree(&root.join("config/trees/rover.toml"))?;
        Ok(Self { robot, model, tree })
    }
}
