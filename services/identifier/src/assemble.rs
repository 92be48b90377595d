//! From the configuration to an identifier.

use vigil_diagnosis::identify::{
    ChannelIdentifier, Diagnoser, Identifier, IdentifierError, IdentifierFilter, Models,
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
        RobotModel::Channels(model) => {
            let settings = (file.detector.sensors, file.detector.fault_rate_1_h);
            let identifier = ChannelIdentifier::new(model, robot, tree, settings)?;
            return Ok(Diagnoser::from(identifier));
        }
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
