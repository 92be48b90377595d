//! Counter-steering against a stuck wheel.

use super::motion::MotionModel;

/// Wanted curvature at which the line is exact, either way, 1/m: of all lines these nodes make one
/// that is least wrong for curvatures up to 0.5 /m (Chebyshev's nodes, 0.5/√2).
const EXACT_AT_1_M: f64 = 0.35;
/// Speed for which the line is made, m/s: the middle of what the rover's model was learned from.
const SPEED_M_S: f64 = 0.2;
/// Corrections of a command at most. Chosen: each leaves the error that the fault's curve makes of
/// it, a part; a curve that is steeper than the command has no such command.
const CORRECTIONS: u32 = 100;
/// Curvature error that is left, 1/m. Chosen: far below what a servo resolves.
const ERROR_1_M: f64 = 1e-9;

/// Gain and offset (1/m) such that a robot that moves so, commanded `gain·κ + offset`, drives the
/// curvature κ. A tangent at the command 0 would be worse: counter-steered, even straight ahead
/// lies at a command of 0.1 to 0.2 /m. `None` if such curvatures cannot be driven.
pub(super) fn line(motion: &MotionModel) -> Option<(f64, f64)> {
    let right = command_for(motion, -EXACT_AT_1_M)?;
    let left = command_for(motion, EXACT_AT_1_M)?;
    let gain = (left - right) / (2.0 * EXACT_AT_1_M);
    Some((gain, 0.5 * (left + right)))
}

/// The curvature to command so that `wanted` is driven, 1/m: the error is taken off the command
/// again and again, which converges while a robot's driven curvature rises with the commanded one,
/// less than twice as fast.
fn command_for(motion: &MotionModel, wanted: f64) -> Option<f64> {
    let mut command = wanted;
    for _ in 0..CORRECTIONS {
        let forward = motion.forward.value(command, SPEED_M_S);
        let error = motion.yaw.value(command, SPEED_M_S) / forward - wanted;
        if !error.is_finite() {
            return None;
        }
        if error.abs() <= ERROR_1_M {
            return Some(command);
        }
        command -= error;
    }
    None
}
