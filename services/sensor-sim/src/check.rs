//! Ranges of a world's settings.

use vigil_robot::Description;
use vigil_robot::fault::FaultError;
use vigil_robot::kinematics::{GeometryError, ROVER_WHEELS};
use vigil_setup::OutOfRange;
use vigil_setup::graph_file::DriveSegment;

/// Why a world or a change of it was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// The robot is not one that the simulator knows.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// A number is out of range.
    #[error("{quantity} is {found}: allowed is {allowed}")]
    Quantity {
        /// Which number.
        quantity: &'static str,
        /// Its value.
        found: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] OutOfRange),
    /// A parameter of a disturbance is out of range.
    #[error(transparent)]
    Parameter(#[from] FaultError),
    /// A disturbance cannot act there.
    #[error("{kind}: place {found} does not exist: allowed are the indices of its places")]
    Place {
        /// Form of the disturbance.
        kind: String,
        /// Index of the place.
        found: usize,
    },
    /// There is no such wheel.
    #[error("wheel {found} does not exist: allowed is 0 to 5")]
    Wheel {
        /// Its index.
        found: usize,
    },
}

pub(crate) fn quantity(quantity: &'static str, found: f64, allowed: &'static str) -> WorldError {
    WorldError::Quantity {
        quantity,
        found,
        allowed,
    }
}

pub(crate) fn wheel(found: usize) -> Result<(), WorldError> {
    if found < ROVER_WHEELS {
        Ok(())
    } else {
        Err(WorldError::Wheel { found })
    }
}

pub(crate) fn rate(rate_hz: f64) -> Result<(), WorldError> {
    if !(1.0..=1e4).contains(&rate_hz) {
        return Err(quantity("rate_hz", rate_hz, "1 to 10000"));
    }
    Ok(())
}

pub(crate) fn drive(drive: &[DriveSegment]) -> Result<(), WorldError> {
    for segment in drive {
        let duration_s = segment.duration_s;
        if !(duration_s.is_finite() && duration_s > 0.0) {
            let allowed = "any finite number above 0";
            return Err(quantity("duration_s", duration_s, allowed));
        }
        for (name, found) in [
            ("curvature_1_m", segment.curvature_1_m),
            ("speed_m_s", segment.speed_m_s),
        ] {
            if !found.is_finite() {
                return Err(quantity(name, found, "any finite number"));
            }
        }
    }
    Ok(())
}

pub(crate) fn noise(robot: &Description) -> Result<(), WorldError> {
    let noise = &robot.noise;
    let rate_hz = noise.reference_rate_hz;
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        let allowed = "any finite number above 0";
        return Err(quantity("noise.reference_rate_hz", rate_hz, allowed));
    }
    for (name, found) in [
        ("noise.position_m", noise.position_m),
        ("noise.yaw_rad", noise.yaw_rad),
        ("noise.yaw_rate_rad_s", noise.yaw_rate_rad_s),
        ("noise.wheel_rate_rad_s", noise.wheel_rate_rad_s),
        ("noise.steer_rad", noise.steer_rad),
        ("noise.current_a", noise.current_a),
    ] {
        if !(found.is_finite() && found >= 0.0) {
            return Err(quantity(name, found, "any finite number from 0"));
        }
    }
    Ok(())
}
