//! Tolerance: how far a healthy robot may depart from its model, per channel.

use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vigil_checkpoint::CheckpointValue;
use vigil_inference::slow_state::Drift;
use vigil_inference::track::MotionNoise;

/// Standard deviation of the motion's offset over its tolerance. Chosen: together with the slope a
/// tolerance is 2.4 to 4 deviations, by the axis.
const OFFSET_SHARE: f64 = 0.25;
/// Standard deviation of a slope over its tolerance: 2.5 deviations hold 99 % of the slopes.
const SLOPE_SHARE: f64 = 0.4;
/// Share of the changes of ground that are sudden; the others come little by little. Chosen: one
/// change in ten lengths; half as many ask for 0.7 nats more evidence of each.
const SUDDEN_SHARE: f64 = 0.1;

/// Healthy variation, in physical units. Each value is the largest magnitude that is no fault. The
/// filters estimate the variation up to it; what is beyond is a material departure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema, CheckpointValue)]
#[serde(deny_unknown_fields)]
pub struct Tolerance {
    /// Yaw per metre travelled beside that of the model, rad/m.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub yaw_rad_m: f64,
    /// Share of the commanded travel that slips, is lost uphill or gained downhill, m/m.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub forward_m_m: f64,
    /// Travel to the side per metre, m/m: on a side slope.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub lateral_m_m: f64,
    /// Share of its rate by which every wheel falls behind under load.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub wheel_ratio: f64,
    /// Rate by which one wheel differs from the others, rad/s.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0))]
    pub wheel_rate_rad_s: f64,
    /// Angle between a servo and its command, rad.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub steer_rad: f64,
    /// Length over which the context changes, m.
    #[schemars(range(max = 1e4), extend("exclusiveMinimum" = 0))]
    pub length_m: f64,
    /// Tolerance of gyro and currents; left out: none.
    #[serde(default)]
    pub further: Option<FurtherTolerance>,
}

/// Healthy variation of gyro and currents.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema, CheckpointValue)]
#[serde(deny_unknown_fields)]
pub struct FurtherTolerance {
    /// Bias of the gyro, rad/s.
    #[schemars(range(max = 10.0), extend("exclusiveMinimum" = 0))]
    pub yaw_rate_rad_s: f64,
    /// What slopes add to the current of every wheel, A.
    #[schemars(range(max = 1e3), extend("exclusiveMinimum" = 0))]
    pub current_a: f64,
    /// By how much one wheel's current differs from the model on level ground, A.
    #[schemars(range(max = 1e3), extend("exclusiveMinimum" = 0))]
    pub current_wheel_a: f64,
    /// By how much it differs on slopes besides, as a share of what these add.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub current_share: f64,
}

impl Tolerance {
    /// The noise of nominal motion on any ground within the tolerance.
    #[must_use]
    pub fn widened(&self, noise: &MotionNoise) -> MotionNoise {
        let (offset, slope) = (self.offset_sd(), self.slope_sd());
        MotionNoise {
            offset: noise.offset + Matrix3::from_diagonal(&offset.component_mul(&offset)),
            deviation: noise.deviation + Matrix3::from_diagonal(&slope.component_mul(&slope)),
            length_m: self.length_m,
            drift: self.drift(),
            bound: Vector3::new(self.yaw_rad_m, self.forward_m_m, self.lateral_m_m),
            changes_1_m: SUDDEN_SHARE / self.length_m,
            ..*noise
        }
    }

    /// Deviations of the motion's offset by motors that yield under load: yaw, forward, lateral.
    fn offset_sd(&self) -> Vector3<f64> {
        let half = 0.5 * self.lateral_m_m;
        Vector3::new(self.yaw_rad_m, self.forward_m_m, half) * OFFSET_SHARE
    }

    /// Deviations by slopes, which shift the robot and act alike forward and to the side.
    fn slope_sd(&self) -> Vector3<f64> {
        Vector3::new(0.0, self.lateral_m_m, self.lateral_m_m) * SLOPE_SHARE
    }

    /// Variance by which the offsets change per metre.
    fn drift(&self) -> Vector3<f64> {
        let sd = self.offset_sd();
        sd.component_mul(&sd) / self.length_m
    }

    /// The noise of a fault's motion, with the drift of ground and slope of a healthy robot.
    #[must_use]
    pub fn with_ground_drift(&self, noise: &MotionNoise) -> MotionNoise {
        let slope = self.slope_sd();
        MotionNoise {
            // A slope, too, changes under a fault.
            drift: noise.drift + self.drift() + slope.component_mul(&slope) / self.length_m,
            ..*noise
        }
    }

    /// How all wheels' rates drift together, relative to them.
    #[must_use]
    pub const fn wheels(&self) -> Drift {
        Drift {
            tolerance: self.wheel_ratio,
            length_m: self.length_m,
        }
    }

    /// How one wheel's rate drifts beside the others, rad/s.
    #[must_use]
    pub const fn wheel(&self) -> Drift {
        Drift {
            tolerance: self.wheel_rate_rad_s,
            length_m: self.length_m,
        }
    }

    /// Part of a steering angle's residual beyond the tolerance, rad. A servo yields to the scrub
    /// of its wheel as soon as the command changes, so its offset is no slow state.
    #[must_use]
    pub(crate) fn beyond_steer(&self, residual_rad: f64) -> f64 {
        residual_rad - residual_rad.clamp(-self.steer_rad, self.steer_rad)
    }
}
