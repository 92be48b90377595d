//! The kinds of disturbance: names, places, parameters, wire codes.

use strum::EnumMessage;

use crate::description::Description;

/// Parameters that a disturbance has at most.
pub const PARAMETERS: usize = 2;
/// First wire code of a disturbance; fault kinds lie below.
const FIRST_CODE: u32 = 101;

/// What a disturbance does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, EnumMessage)]
#[repr(u32)]
pub enum DisturbanceKind {
    /// A steering servo slips: the wheel and its sensor turn by an angle, rad.
    SteerJump = FIRST_CODE,
    /// A steering linkage bends: the wheel turns by an angle, rad; its sensor does not see it.
    SteerOffsetHidden,
    /// Something pulls the body backward with a force, N.
    Tether,
    /// A motor loses a share of its torque at every rate error, and of its torque limit.
    TorqueLoss,
    /// The gyro has a bias, rad/s, and the pose's yaw drifts with it.
    YawRateBias,
    /// The pose's position drifts, m/s, to the left of the heading at the onset.
    PoseDrift,
    /// The pose comes late, s.
    PoseDelay,
    /// A share of the poses is missing, each one at random.
    PoseDrop,
    /// Distances from the position at the onset appear scaled by a factor.
    PoseScale,
    /// A wheel sinks in: rolling resistance of the soil, as a factor on that of firm soil.
    Sinkage,
    /// The ground rises ahead by an angle, rad.
    Slope,
    /// The ground rises to the left by an angle, rad.
    SideSlope,
    /// A brush or cable above a wheel drags on the body with a force, N, against its motion there.
    Brush,
    /// A wheel's radius shrinks to a share.
    Puncture,
    /// The friction under all wheels of one side falls to a share.
    SoilSoft,
    /// An encoder reports its rate scaled by a factor.
    EncoderScale,
    /// An encoder reports late, s.
    EncoderDelay,
    /// The centre of mass moves, m forward and m to the left.
    PayloadShift,
    /// An encoder reports its rate and a constant more, rad/s.
    EncoderBias,
    /// An encoder reports an addition that grows from 0, rad/s per second.
    EncoderDrift,
    /// The gyro alone reports a constant more, rad/s.
    GyroBias,
    /// The gyro reports what it would, noise included, scaled by a factor: 0 for a dead one.
    GyroScale,
    /// A current sensor reports a constant more, A.
    CurrentBias,
    /// A current sensor reports what it would, noise included, scaled: by 0 for a dead one.
    CurrentScale,
    /// A steering servo stands at an angle whatever it is told, rad; its sensor sees it.
    SteerHeld,
    /// A steering sensor alone reports an angle more, rad.
    SteerBias,
    /// The pose jumps, m, to the left of the heading at the onset.
    PoseJump,
    /// The pose is reported anew only every so many seconds, and repeated in between.
    PoseHeld,
    /// The gyro's noise is so many times the usual.
    GyroNoise,
    /// The noise of a wheel's current sensor is so many times the usual.
    CurrentNoise,
}

/// Where a disturbance acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// On the rover or its pose sensor.
    Rover,
    /// On one wheel.
    Wheel,
    /// On one wheel that has a servo.
    SteeredWheel,
    /// On the left or the right side.
    Side,
}

/// Names of the sides, by index.
pub const SIDES: [&str; 2] = ["left", "right"];

/// A parameter of a kind: its unit in specifications, range, and value if none is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Unit or meaning, as specifications show it.
    pub unit: &'static str,
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
    /// Value if none is given.
    pub default: f64,
}

/// Name, place and parameters of a kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DisturbanceSpec {
    /// The kind.
    pub kind: DisturbanceKind,
    /// First word of its specification.
    pub name: &'static str,
    /// Where it acts.
    pub place: Place,
    /// Its parameters, at least one and at most [`PARAMETERS`].
    pub parameters: &'static [Parameter],
}

const fn parameter(unit: &'static str, low: f64, high: f64, default: f64) -> Parameter {
    Parameter {
        unit,
        low,
        high,
        default,
    }
}

const fn spec(
    kind: DisturbanceKind,
    name: &'static str,
    place: Place,
    parameters: &'static [Parameter],
) -> DisturbanceSpec {
    DisturbanceSpec {
        kind,
        name,
        place,
        parameters,
    }
}

const ANGLE: &[Parameter] = &[parameter("RAD", -0.6, 0.6, 0.2)];
const SLOPE: &[Parameter] = &[parameter("RAD", -0.3, 0.3, 0.15)];
const PULL: &[Parameter] = &[parameter("N", 0.0, 80.0, 20.0)];
const LOSS: &[Parameter] = &[parameter("SHARE", 0.0, 1.0, 0.5)];
const BIAS: &[Parameter] = &[parameter("RAD_PER_S", -0.5, 0.5, 0.02)];
const DRIFT: &[Parameter] = &[parameter("M_PER_S", -0.5, 0.5, 0.02)];
const DELAY: &[Parameter] = &[parameter("S", 0.0, DELAY_MAX_S, 0.3)];
const JUMP: &[Parameter] = &[parameter("M", -5.0, 5.0, 0.3)];
const HOLD: &[Parameter] = &[parameter("S", 0.0, 3600.0, 60.0)];
const DROP: &[Parameter] = &[parameter("SHARE", 0.0, 1.0, 1.0)];
const SCALE: &[Parameter] = &[parameter("FACTOR", 0.5, 2.0, 1.05)];
const SINKAGE: &[Parameter] = &[parameter("FACTOR", 1.0, 40.0, 3.0)];
const RADIUS: &[Parameter] = &[parameter("FACTOR", 0.5, 1.0, 0.9)];
const FRICTION: &[Parameter] = &[parameter("FACTOR", 0.1, 1.0, 0.4)];
const RATE: &[Parameter] = &[parameter("FACTOR", -2.0, 3.0, 1.2)];
const MORE: &[Parameter] = &[parameter("RAD_PER_S", -5.0, 5.0, 0.6)];
const GROWS: &[Parameter] = &[parameter("RAD_PER_S2", -0.5, 0.5, 0.05)];
const AMPERES: &[Parameter] = &[parameter("A", -10.0, 10.0, 0.5)];
const GAIN: &[Parameter] = &[parameter("FACTOR", -2.0, 3.0, 0.0)];
const NOISE: &[Parameter] = &[parameter("FACTOR", 1.0, 100.0, 20.0)];
const SHIFT: &[Parameter] = &[
    parameter("M_FORWARD", -0.1, 0.1, -0.08),
    parameter("M_LEFT", -0.15, 0.15, 0.1),
];

/// Longest delay of a sensor, s.
pub const DELAY_MAX_S: f64 = 2.0;

/// Every kind, in the order of the codes.
pub const KINDS: [DisturbanceSpec; 30] = {
    use DisturbanceKind as D;
    use Place::{Rover, Side, SteeredWheel, Wheel};
    [
        spec(D::SteerJump, "steer-jump", SteeredWheel, ANGLE),
        spec(
            D::SteerOffsetHidden,
            "steer-offset-hidden",
            SteeredWheel,
            ANGLE,
        ),
        spec(D::Tether, "tether", Rover, PULL),
        spec(D::TorqueLoss, "torque-loss", Wheel, LOSS),
        spec(D::YawRateBias, "yaw-rate-bias", Rover, BIAS),
        spec(D::PoseDrift, "pose-drift", Rover, DRIFT),
        spec(D::PoseDelay, "pose-delay", Rover, DELAY),
        spec(D::PoseDrop, "pose-drop", Rover, DROP),
        spec(D::PoseScale, "pose-scale", Rover, SCALE),
        spec(D::Sinkage, "sinkage", Wheel, SINKAGE),
        spec(D::Slope, "slope", Rover, SLOPE),
        spec(D::SideSlope, "side-slope", Rover, SLOPE),
        spec(D::Brush, "brush", Wheel, PULL),
        spec(D::Puncture, "puncture", Wheel, RADIUS),
        spec(D::SoilSoft, "soil-soft", Side, FRICTION),
        spec(D::EncoderScale, "encoder-scale", Wheel, RATE),
        spec(D::EncoderDelay, "encoder-delay", Wheel, DELAY),
        spec(D::PayloadShift, "payload-shift", Rover, SHIFT),
        spec(D::EncoderBias, "encoder-bias", Wheel, MORE),
        spec(D::EncoderDrift, "encoder-drift", Wheel, GROWS),
        spec(D::GyroBias, "gyro-bias", Rover, BIAS),
        spec(D::GyroScale, "gyro-scale", Rover, GAIN),
        spec(D::CurrentBias, "current-bias", Wheel, AMPERES),
        spec(D::CurrentScale, "current-scale", Wheel, GAIN),
        spec(D::SteerHeld, "steer-held", SteeredWheel, ANGLE),
        spec(D::SteerBias, "steer-bias", SteeredWheel, ANGLE),
        spec(D::PoseJump, "pose-jump", Rover, JUMP),
        spec(D::PoseHeld, "pose-held", Rover, HOLD),
        spec(D::GyroNoise, "gyro-noise", Rover, NOISE),
        spec(D::CurrentNoise, "current-noise", Wheel, NOISE),
    ]
};

impl DisturbanceKind {
    /// Position in [`KINDS`].
    #[must_use]
    pub const fn index(self) -> usize {
        (self as u32 - FIRST_CODE) as usize
    }

    /// Name, place and parameters.
    #[must_use]
    pub const fn spec(self) -> &'static DisturbanceSpec {
        &KINDS[self.index()]
    }

    /// The kind behind a wire code ([`vigil_blocks::Control`]), if this version knows it.
    #[must_use]
    pub fn from_wire(code: u32) -> Option<Self> {
        let row = KINDS.get(code.checked_sub(FIRST_CODE)? as usize)?;
        Some(row.kind)
    }

    /// The kind with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let row = KINDS.iter().find(|row| row.name == name)?;
        Some(row.kind)
    }
}

impl DisturbanceSpec {
    /// Its specification in words: `brush:WHEEL[:N]`.
    #[must_use]
    pub fn form(&self) -> String {
        let place = match self.place {
            Place::Rover => "",
            Place::Wheel => ":WHEEL",
            Place::SteeredWheel => ":STEERED_WHEEL",
            Place::Side => ":left|right",
        };
        let units: Vec<String> = self
            .parameters
            .iter()
            .map(|p| format!("[:{}", p.unit))
            .collect();
        format!(
            "{}{place}{}{}",
            self.name,
            units.concat(),
            "]".repeat(units.len())
        )
    }

    /// What it does, and what its parameters are if none are given.
    #[must_use]
    pub fn meaning(&self) -> String {
        let about = self.kind.get_documentation().unwrap_or_default();
        let values = self.parameters.iter().map(|it| it.default.to_string());
        let values: Vec<String> = values.collect();
        format!("{about} Default: {}.", values.join(", "))
    }

    /// Name of the place with this index; `None` for the whole rover.
    #[must_use]
    pub(crate) fn place_name<'a>(&self, place: usize, robot: &'a Description) -> Option<&'a str> {
        match self.place {
            Place::Rover => None,
            Place::Side => SIDES.get(place).copied(),
            Place::Wheel | Place::SteeredWheel => Some(
                robot
                    .wheels
                    .get(place)
                    .map_or("?", |wheel| wheel.name.as_str()),
            ),
        }
    }
}
