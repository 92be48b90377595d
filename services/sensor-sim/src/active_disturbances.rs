//! Active disturbances, and their effects on body and sensors.

use vigil_robot::disturbance_kind::{KINDS, PARAMETERS};
use vigil_robot::kinematics::{Ackermann6, ROVER_WHEELS};
use vigil_robot::slip::{Condition, Soil, WheelCondition};
use vigil_robot::{Disturbance, DisturbanceKind};

/// Rolling resistance of firm soil, force per unit of load, that `sinkage` multiplies. Chosen by
/// hand: with a larger one the same `sinkage` brakes harder. The bearing's friction contains the
/// part up to a factor of 1, so only the excess is added.
const FIRM_RESISTANCE: f64 = 0.05;

/// At most one disturbance of each kind at each place.
#[derive(Debug, Clone)]
pub(crate) struct ActiveDisturbances {
    parameters: [[Option<[f64; PARAMETERS]>; ROVER_WHEELS]; KINDS.len()],
}

impl ActiveDisturbances {
    pub(crate) const fn none() -> Self {
        Self {
            parameters: [[None; ROVER_WHEELS]; KINDS.len()],
        }
    }

    /// Starts one, which replaces one of its kind. False if its place does not exist.
    pub(crate) fn set(&mut self, disturbance: &Disturbance) -> bool {
        let kind = &mut self.parameters[disturbance.kind.index()];
        kind.get_mut(disturbance.place).is_some_and(|place| {
            *place = Some(disturbance.parameter);
            true
        })
    }

    /// Ends a kind, at one place or everywhere.
    pub(crate) fn end(&mut self, kind: DisturbanceKind, place: Option<usize>) {
        for (i, on) in self.parameters[kind.index()].iter_mut().enumerate() {
            if place.is_none_or(|place| place == i) {
                *on = None;
            }
        }
    }

    /// True while there is one.
    pub(crate) fn is_any(&self) -> bool {
        self.parameters.iter().flatten().any(Option::is_some)
    }

    /// First parameter of a kind at a place, if it is active.
    pub(crate) fn at(&self, kind: DisturbanceKind, place: usize) -> Option<f64> {
        self.parameters[kind.index()]
            .get(place)
            .copied()
            .flatten()
            .map(|p| p[0])
    }

    /// The gyro's measurement of a yaw rate, with this noise, rad/s.
    pub(crate) fn yaw_rate(&self, true_rad_s: f64, noise_rad_s: f64) -> f64 {
        use DisturbanceKind as D;
        let bias = |kind| self.at(kind, 0).unwrap_or(0.0);
        let noise_rad_s = self.at(D::GyroNoise, 0).unwrap_or(1.0) * noise_rad_s;
        let rate = true_rad_s + bias(D::YawRateBias) + bias(D::GyroBias) + noise_rad_s;
        self.at(D::GyroScale, 0).map_or(rate, |gain| gain * rate)
    }

    /// The measurement of a wheel's current, with this noise, A.
    pub(crate) fn current(&self, wheel: usize, true_a: f64, noise_a: f64) -> f64 {
        use DisturbanceKind as D;
        let noise_a = self.at(D::CurrentNoise, wheel).unwrap_or(1.0) * noise_a;
        let current = true_a + self.at(D::CurrentBias, wheel).unwrap_or(0.0) + noise_a;
        self.at(D::CurrentScale, wheel)
            .map_or(current, |gain| gain * current)
    }

    /// The measurement of a wheel's steering angle at a commanded one, without noise, rad.
    pub(crate) fn steer(&self, wheel: usize, commanded_rad: f64) -> f64 {
        use DisturbanceKind as D;
        let more = |kind| self.at(kind, wheel).unwrap_or(0.0);
        let servo_rad = self.at(D::SteerHeld, wheel).unwrap_or(commanded_rad);
        servo_rad + more(D::SteerJump) + more(D::SteerBias)
    }

    /// The state of body and wheels.
    pub(crate) fn condition(&self) -> Condition {
        use DisturbanceKind as D;
        let rover = |kind| self.at(kind, 0).unwrap_or(0.0);
        let shift = self.parameters[D::PayloadShift.index()][0].unwrap_or_default();
        Condition {
            wheels: std::array::from_fn(|i| {
                let of = |kind, otherwise| self.at(kind, i).unwrap_or(otherwise);
                WheelCondition {
                    steer_held_rad: self.at(D::SteerHeld, i),
                    steer_offset_rad: of(D::SteerJump, 0.0) + of(D::SteerOffsetHidden, 0.0),
                    torque_share: 1.0 - of(D::TorqueLoss, 0.0),
                    radius_share: of(D::Puncture, 1.0),
                    resistance: FIRM_RESISTANCE * (of(D::Sinkage, 1.0) - 1.0),
                    drag_n: of(D::Brush, 0.0),
                }
            }),
            force_n: [-rover(D::Tether), 0.0],
            slope_rad: rover(D::Slope),
            side_slope_rad: rover(D::SideSlope),
            mass_offset_m: shift,
        }
    }

    /// `soil` with the friction of its soft side.
    pub(crate) fn soil(&self, soil: Soil, kinematics: &Ackermann6) -> Soil {
        let share = |i: usize| {
            let side = usize::from(kinematics.y_m[i] < 0.0);
            self.at(DisturbanceKind::SoilSoft, side).unwrap_or(1.0)
        };
        Soil {
            friction: std::array::from_fn(|i| soil.friction[i] * share(i)),
            ..soil
        }
    }
}
