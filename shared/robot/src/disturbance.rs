//! Disturbances: what may happen to the simulated rover beside its faults.
//!
//! A [`Fault`] is a stuck wheel, or an encoder that reads zero, noise or the same for ever. A
//! [`Disturbance`] is anything else that the simulated world can carry out. Many are of a part that
//! may have a leaf: an encoder, a steering servo, the pose. With all sensors these are also a
//! motor's torque, the gyro and the current sensors. Others have no leaf, such as `tether`: filters
//! are tried on what they do not model.
//! The text form is here because the launcher checks it before it starts anything, and prints it.

use crate::description::Description;
use crate::disturbance_kind::{DisturbanceKind, DisturbanceSpec, PARAMETERS, Place, SIDES};
use crate::fault::{Fault, FaultError};

impl DisturbanceSpec {
    /// Index of the place called `name`.
    ///
    /// # Errors
    /// [`FaultError`] naming the places there are.
    pub(crate) fn place_of(&self, name: &str, robot: &Description) -> Result<usize, FaultError> {
        match self.place {
            Place::Rover => Err(FaultError::Incomplete {
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
}

/// A disturbance: what, where, how much.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance {
    /// What it is.
    pub kind: DisturbanceKind,
    /// Where: index of the wheel in the robot's description or of the side in [`SIDES`]; 0 for the
    /// rover as a whole.
    pub place: usize,
    /// How much, in the units of [`DisturbanceSpec::parameters`]; unused ones are 0.
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
        let spec = kind.spec();
        let wrong = || FaultError::Incomplete {
            found: text.to_owned(),
            form: spec.form(),
        };
        let place = match spec.place {
            Place::Rover => 0,
            _ => spec.place_of(parts.next().ok_or_else(wrong)?, robot)?,
        };
        let mut parameter = [0.0; PARAMETERS];
        for (value, allowed) in parameter.iter_mut().zip(spec.parameters) {
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
        let spec = self.kind.spec();
        for (found, allowed) in self.parameter.iter().zip(spec.parameters) {
            if !(allowed.low..=allowed.high).contains(found) {
                return Err(FaultError::Parameter {
                    name: spec.name,
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
        let spec = self.kind.spec();
        let mut text = spec.name.to_owned();
        if let Some(place) = spec.place_name(self.place, robot) {
            text = format!("{text}:{place}");
        }
        for (value, _) in self.parameter.iter().zip(spec.parameters) {
            text = format!("{text}:{value}");
        }
        text
    }
}
