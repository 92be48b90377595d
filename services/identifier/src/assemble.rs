//! From the configuration to an identifier.

use vigil_diagnosis::identify::{
    Diagnoser, Identifier, IdentifierError, IdentifierFilter, Models, NominalIdentifier,
};
use vigil_robot::RobotModel;
use vigil_setup::{Setup, state_risks};

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
    let needs_risks = file.identifier.filter == IdentifierFilter::RiskSensitive;
    let risks = needs_risks.then(|| state_risks(decision)).transpose();
    let risks = risks.map_err(|error| IdentifierError::Build(format!("risks: {error}")))?;
    let models = Models {
        model,
        robot,
        tree,
        risks: risks.as_ref(),
    };
    let (settings, sensors) = (&file.identifier, file.detector.sensors);
    let identifier = Identifier::new(&models, settings, sensors, file.graph.seed)?;
    Ok(Diagnoser::from(identifier))
}
