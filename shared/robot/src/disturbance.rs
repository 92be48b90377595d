//! What may go wrong with a rover that no model of a fault contains.
//!
//! A [`crate::Fault`] has a leaf in the fault tree and a learned model; a [`Disturbance`] has
//! neither. It exists in the simulated world only, so that filters can be tried on what nobody told
//! them about. The physics of those that act on the body or a wheel is in
//! [`crate::slip::Condition`]; the others act on a sensor.

use crate::Description;
use crate::fault::{Fault, FaultError};

/// Parameters that a disturbance has at most.
pub const PARAMETERS: usize = 2;
/// First wire code of a disturbance; fault kinds lie below.
const FIRST_CODE: u32 = 101;

/// Kind of a disturbance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
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
    /// That of a wheel's current sensor is.
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
pub struct Kind {
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

const fn row(
    kind: DisturbanceKind,
    name: &'static str,
    place: Place,
    parameters: &'static [Parameter],
) -> Kind {
    Kind {
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
pub const KINDS: [Kind; 30] = {
    use DisturbanceKind as D;
    use Place::{Rover, Side, SteeredWheel, Wheel};
    [
        row(D::SteerJump, "steer-jump", SteeredWheel, ANGLE),
        row(
            D::SteerOffsetHidden,
            "steer-offset-hidden",
            SteeredWheel,
            ANGLE,
        ),
        row(D::Tether, "tether", Rover, PULL),
        row(D::TorqueLoss, "torque-loss", Wheel, LOSS),
        row(D::YawRateBias, "yaw-rate-bias", Rover, BIAS),
        row(D::PoseDrift, "pose-drift", Rover, DRIFT),
        row(D::PoseDelay, "pose-delay", Rover, DELAY),
        row(D::PoseDrop, "pose-drop", Rover, DROP),
        row(D::PoseScale, "pose-scale", Rover, SCALE),
        row(D::Sinkage, "sinkage", Wheel, SINKAGE),
        row(D::Slope, "slope", Rover, SLOPE),
        row(D::SideSlope, "side-slope", Rover, SLOPE),
        row(D::Brush, "brush", Wheel, PULL),
        row(D::Puncture, "puncture", Wheel, RADIUS),
        row(D::SoilSoft, "soil-soft", Side, FRICTION),
        row(D::EncoderScale, "encoder-scale", Wheel, RATE),
        row(D::EncoderDelay, "encoder-delay", Wheel, DELAY),
        row(D::PayloadShift, "payload-shift", Rover, SHIFT),
        row(D::EncoderBias, "encoder-bias", Wheel, MORE),
        row(D::EncoderDrift, "encoder-drift", Wheel, GROWS),
        row(D::GyroBias, "gyro-bias", Rover, BIAS),
        row(D::GyroScale, "gyro-scale", Rover, GAIN),
        row(D::CurrentBias, "current-bias", Wheel, AMPERES),
        row(D::CurrentScale, "current-scale", Wheel, GAIN),
        row(D::SteerHeld, "steer-held", SteeredWheel, ANGLE),
        row(D::SteerBias, "steer-bias", SteeredWheel, ANGLE),
        row(D::PoseJump, "pose-jump", Rover, JUMP),
        row(D::PoseHeld, "pose-held", Rover, HOLD),
        row(D::GyroNoise, "gyro-noise", Rover, NOISE),
        row(D::CurrentNoise, "current-noise", Wheel, NOISE),
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
    pub const fn row(self) -> &'static Kind {
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

impl Kind {
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

    /// Index of the place called `name`.
    ///
    /// # Errors
    /// [`FaultError`] naming the places there are.
    pub fn place_of(&self, name: &str, robot: &Description) -> Result<usize, FaultError> {
        match self.place {
            Place::Rover => Err(FaultError::Disturbance {
                found: format!("{}:{name}", self.name),
                form: self.form(),
            }),
            Place::Wheel => Fault::wheel_of(name, robot),
            Place::SteeredWheel => {
                let wheel = Fault::wheel_of(name, robot)?;
                if robot.wheels.get(wheel).is_some_and(|wheel| wheel.steered) {
                    return Ok(wheel);
                }
                let steered = robot.wheels.iter().filter(|wheel| wheel.steered);
                let names: Vec<&str> = steered.map(|wheel| wheel.name.as_str()).collect();
                Err(FaultError::NotSteered {
                    wheel: name.to_owned(),
                    robot: robot.name.clone(),
                    allowed: names.join(" "),
                })
            }
            Place::Side => {
                let side = SIDES.iter().position(|side| *side == name);
                side.ok_or_else(|| FaultError::Side(name.to_owned()))
            }
        }
    }

    /// Name of the place with this index; `None` for the whole rover.
    #[must_use]
    pub fn place_name<'a>(&self, place: usize, robot: &'a Description) -> Option<&'a str> {
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

/// A disturbance: what, where, how much.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance {
    /// What it is.
    pub kind: DisturbanceKind,
    /// Where: index of the wheel in the robot's description or of the side in [`SIDES`]; 0 for the
    /// rover as a whole.
    pub place: usize,
    /// How much, in the units of [`Kind::parameters`]; unused ones are 0.
    pub parameter: [f64; PARAMETERS],
}

impl Disturbance {
    /// Parses `KIND[:PLACE][:PARAMETER]...`; parameters left out have their default.
    ///
    /// # Errors
    /// [`FaultError`] naming what was given and what is allowed.
    pub fn parse(text: &str, robot: &Description) -> Result<Self, FaultError> {
        let mut parts = text.split(':');
        let name = parts.next().unwrap_or_default();
        let kind = DisturbanceKind::named(name).ok_or_else(|| FaultError::form(text))?;
        let row = kind.row();
        let wrong = || FaultError::Disturbance {
            found: text.to_owned(),
            form: row.form(),
        };
        let place = match row.place {
            Place::Rover => 0,
            _ => row.place_of(parts.next().ok_or_else(wrong)?, robot)?,
        };
        let mut parameter = [0.0; PARAMETERS];
        for (value, allowed) in parameter.iter_mut().zip(row.parameters) {
            *value = match parts.next() {
                None => allowed.default,
                Some(number) => number.parse().map_err(|_| wrong())?,
            };
        }
        if parts.next().is_some() {
            return Err(wrong());
        }
        let this = Self {
            kind,
            place,
            parameter,
        };
        this.check().map(|()| this)
    }

    /// Whether every parameter is within its range.
    ///
    /// # Errors
    /// [`FaultError::Parameter`] for the first that is not.
    pub fn check(&self) -> Result<(), FaultError> {
        let row = self.kind.row();
        for (found, allowed) in self.parameter.iter().zip(row.parameters) {
            if !(allowed.low..=allowed.high).contains(found) {
                return Err(FaultError::Parameter {
                    name: row.name,
                    unit: allowed.unit,
                    found: *found,
                    low: allowed.low,
                    high: allowed.high,
                });
            }
        }
        Ok(())
    }

    /// Text form, as [`Self::parse`] takes it, with every parameter.
    #[must_use]
    pub fn text(&self, robot: &Description) -> String {
        let row = self.kind.row();
        let mut text = row.name.to_owned();
        if let Some(place) = row.place_name(self.place, robot) {
            text = format!("{text}:{place}");
        }
        for (value, _) in self.parameter.iter().zip(row.parameters) {
            text = format!("{text}:{value}");
        }
        text
    }
}
