//! The simulated rover through detector and identifier in one process, as they run live.

mod stages;

pub use stages::Stages;

use std::error::Error;

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
    /// Reads the configuration.
    ///
    /// # Errors
    /// A file that cannot be read or does not fit.
    pub fn read() -> Result<Self, Box<dyn Error>> {
        let setup = crate::load("rover.toml")?;
        let model = setup.model.with_faults();
        Ok(Self {
            robot: setup.robot,
            model: model.ok_or("the rover's model has no faults")?,
            tree: setup.tree,
        })
    }
}
