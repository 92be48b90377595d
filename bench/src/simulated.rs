//! The simulated rover through detector and identifier in one process, as they run live.

use std::error::Error;

use vigil_diagnosis::Sensors;
use vigil_evaluation::scoring::Taxonomy;
use vigil_evaluation::stages::{Stages, Vocabulary};
use vigil_robot::Description;
use vigil_robot::FaultTree;
use vigil_robot::learned::Model;
use vigil_setup::Setup;

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

/// Words and priors of a graph's faults.
#[must_use]
pub fn taxonomy(setup: &Setup) -> Taxonomy {
    let words = Taxonomy::new(&setup.tree, &setup.robot);
    words.with_prior_unknown(setup.file.identifier.p_unknown)
}

/// The stages of a configuration, but for the sensors they use, the rate and the seed.
///
/// # Errors
/// If model, robot, tree and settings do not fit together.
pub fn stages(
    setup: &Setup,
    sensors: Sensors,
    rate_hz: f64,
    seed: u64,
) -> Result<Stages, Box<dyn Error>> {
    let mut setup = setup.clone();
    setup.file.graph.rate_hz = rate_hz;
    setup.file.graph.seed = seed;
    setup.file.detector.sensors = sensors;
    let vocabulary = Vocabulary {
        taxonomy: taxonomy(&setup),
        robot: setup.robot.clone(),
        actions: setup.decision.actions().to_vec(),
    };
    Ok(Stages::new(
        vigil_detector::assemble(&setup)?,
        vigil_identifier::assemble(&setup)?,
        Some(vigil_supervisor::assemble(&setup)?),
        vocabulary,
    ))
}
