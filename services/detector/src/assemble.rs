//! From the configuration to a detector.

use vigil_diagnosis::Sensors;
use vigil_robot::{Description, MeasuredChannels, RobotModel};
use vigil_setup::Setup;
use vigil_setup::graph_file::Source;

use vigil_diagnosis::detect::{Detector, DetectorError};

/// The detector that a configuration describes.
///
/// # Errors
/// [`DetectorError`] if model, robot and settings do not fit together.
pub fn assemble(setup: &Setup) -> Result<Detector, DetectorError> {
    let file = &setup.file;
    let detector = match &setup.model {
        RobotModel::Faults(model) => Detector::new(model, &setup.robot, &file.detector),
        RobotModel::Channels(model) => Detector::of_channels(model, &setup.robot, &file.detector),
    }?;
    // Recorded frames come at the recording's pace, times the speed.
    let live = file.sensor.source != Source::Playback;
    let period_s = setup.period_ns() as f64 * 1e-9;
    let looked_at = Description {
        measured: looked_at(setup),
        ..setup.robot.clone()
    };
    let detector = detector.in_graph(&looked_at, period_s, live);
    Ok(detector.with_monitors(file.monitors.as_ref()))
}

/// What of the robot's channels the detector looks at: what is wrong with the others hides nothing.
fn looked_at(setup: &Setup) -> MeasuredChannels {
    let measured = setup.robot.measured;
    let sensors = setup.file.detector.sensors;
    if sensors == Sensors::Pose {
        return MeasuredChannels {
            pose: measured.pose,
            wheel_rates: false,
            steer: false,
            yaw_rate: false,
            currents: false,
        };
    }
    let RobotModel::Faults(model) = &setup.model else {
        return measured;
    };
    // The rover's description leaves out what only some of its graphs use.
    let further = model.further.as_ref().filter(|_| sensors == Sensors::All);
    MeasuredChannels {
        yaw_rate: further.is_some_and(|further| further.yaw_rate.is_some()),
        currents: further.is_some_and(|further| further.currents.is_some()),
        ..measured
    }
}
