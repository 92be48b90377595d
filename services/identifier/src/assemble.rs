//! From the configuration to an identifier.

use vigil_diagnosis::identify::{
    Diagnoser, Identifier, IdentifierError, Models, NominalIdentifier,
};
use vigil_robot::RobotModel;
use vigil_setup::Setup;

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
        RobotModel::Nominal(_) => return Ok(Diagnoser::from(NominalIdentifier::new(tree))),
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
