//! From the configuration to a detector.

use vigil_robot::RobotModel;
use vigil_setup::Setup;
use vigil_setup::schema::Source;

use crate::{Detector, DetectorError};

/// The detector that a configuration describes.
///
/// # Errors
/// [`DetectorError`] if model, robot and settings do not fit together.
pub fn assemble(setup: &Setup) -> Result<Detector, DetectorError> {
    let file = &setup.file;
    let detector = match &setup.model {
        RobotModel::Faults(model) => Detector::new(model, &setup.robot, &file.detector),
        RobotModel::Nominal(model) => Detector::nominal(model, &setup.robot, &file.detector),
    }?;
    // Recorded frames come at the recording's pace, times the speed.
    let live = file.sensor.source != Source::Playback;
    let period_s = setup.period_ns() as f64 * 1e-9;
    let detector = detector.in_graph(&setup.robot, period_s, live);
    Ok(detector.with_monitors(file.monitors.as_ref()))
}
