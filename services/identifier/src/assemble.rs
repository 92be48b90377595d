//! From the configuration to an identifier.

use vigil_inference::FaultTree;
use vigil_pomdp::Pomdp;
use vigil_robot::learned::Model;
use vigil_robot::{Description, RobotModel};
use vigil_setup::Setup;

use crate::{Diagnoser, Identifier, IdentifierError, Watcher};

/// The models that an identifier is built from.
#[derive(Debug, Clone, Copy)]
pub struct Models<'a> {
    /// How the robot behaves.
    pub model: &'a Model,
    /// The robot.
    pub robot: &'a Description,
    /// Its faults.
    pub tree: &'a FaultTree,
    /// What faults cost; only the risk-sensitive filter needs it.
    pub decision: Option<&'a Pomdp>,
}

/// The identifier that a configuration describes.
///
/// # Errors
/// [`IdentifierError`] if model, robot, tree and settings do not fit together.
pub fn assemble(setup: &Setup) -> Result<Diagnoser, IdentifierError> {
    let Setup {
        file,
        model,
        robot,
        tree,
        decision,
        ..
    } = setup;
    let model = match model {
        RobotModel::Faults(model) => model,
        RobotModel::Nominal(_) => return Ok(Diagnoser::from(Watcher::new(tree))),
    };
    let models = Models {
        model,
        robot,
        tree,
        decision: Some(decision),
    };
    let (settings, sensors) = (&file.identifier, file.detector.sensors);
    let identifier = Identifier::new(&models, settings, sensors, file.graph.seed)?;
    Ok(Diagnoser::from(identifier))
}
