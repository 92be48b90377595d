//! From the configuration to an identifier.

use vigil_setup::Setup;

use crate::{Identifier, IdentifierError};

/// The identifier that a configuration describes.
///
/// # Errors
/// [`IdentifierError`] if model, robot, tree and settings do not fit together.
pub fn assemble(setup: &Setup) -> Result<Identifier, IdentifierError> {
    let Setup {
        file,
        model,
        robot,
        tree,
        ..
    } = setup;
    let (settings, sensors) = (&file.identifier, file.detector.sensors);
    Identifier::new(model, robot, tree, settings, sensors, file.graph.seed)
}
