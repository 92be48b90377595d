//! Faults that can be injected or modelled, and their text form.

use std::fmt;

use crate::description::Description;

/// Kind of a wheel fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum FaultKind {
    /// The motor is stuck: the wheel is locked and dragged.
    Stuck = 1,
    /// The encoder reports exactly 0.
    EncoderZero = 2,
    /// The encoder repeats its last value.
    EncoderFrozen = 3,
    /// The encoder reports noise.
    EncoderNoise = 4,
}

impl FaultKind {
    /// The kind behind a wire code ([`vigil_blocks::Control`]), if this version knows it.
    #[must_use]
    pub const fn from_wire(code: u32) -> Option<Self> {
        Some(match code {
            1 => Self::Stuck,
            2 => Self::EncoderZero,
            3 => Self::EncoderFrozen,
            4 => Self::EncoderNoise,
            _ => return None,
        })
    }
}

/// A fault of one wheel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Fault {
    /// What is broken.
    pub kind: FaultKind,
    /// Which wheel, by index in the robot's description.
    pub wheel: usize,
}

/// Why a fault's text was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FaultError {
    /// The form is wrong.
    #[error("'{0}' is no fault or disturbance; `vigil inject --list` lists what can be injected")]
    Form(String),
    /// The kind is known, but the rest of it has another form.
    #[error("'{found}' does not have the form {form}")]
    Incomplete {
        /// What was given.
        found: String,
        /// Form of this kind.
        form: String,
    },
    /// A parameter is out of range.
    #[error("{name}: {unit} is {found}: allowed is {low} to {high}")]
    Parameter {
        /// Name of the kind.
        name: &'static str,
        /// Unit or meaning of the parameter.
        unit: &'static str,
        /// What was given.
        found: f64,
        /// Least value.
        low: f64,
        /// Greatest value.
        high: f64,
    },
    /// There is no such side.
    #[error("'{0}' is not a side: expected left or right")]
    Side(String),
    /// The wheel cannot be steered.
    #[error("wheel {wheel} of {robot} has no steering servo: expected one of {allowed}")]
    NotSteered {
        /// What was given.
        wheel: String,
        /// Name of the robot.
        robot: String,
        /// Names of its steered wheels.
        allowed: String,
    },
    /// The wheel does not exist.
    #[error("'{wheel}' is not a wheel of {robot}: expected one of {allowed}")]
    Wheel {
        /// What was given.
        wheel: String,
        /// Name of the robot.
        robot: String,
        /// Names of its wheels.
        allowed: String,
    },
}

impl FaultError {
    /// `text` is nothing that can be injected.
    pub(crate) fn form(text: &str) -> Self {
        Self::Form(text.to_owned())
    }
}

impl Fault {
    /// Parses `stuck:WHEEL` or `encoder:WHEEL:zero|frozen|noise`.
    ///
    /// # Errors
    /// [`FaultError`] naming what was given and what is allowed.
    pub fn parse(text: &str, robot: &Description) -> Result<Self, FaultError> {
        let parts: Vec<&str> = text.split(':').collect();
        let (kind, wheel) = match parts.as_slice() {
            ["stuck", wheel] => (FaultKind::Stuck, *wheel),
            ["encoder", wheel, "zero"] => (FaultKind::EncoderZero, *wheel),
            ["encoder", wheel, "frozen"] => (FaultKind::EncoderFrozen, *wheel),
            ["encoder", wheel, "noise"] => (FaultKind::EncoderNoise, *wheel),
            [kind, ..] => return Err(Self::form_error(kind, text)),
            [] => return Err(FaultError::form(text)),
        };
        Self::wheel_of(wheel, robot).map(|wheel| Self { kind, wheel })
    }

    /// Why a text of this kind is no fault.
    fn form_error(kind: &str, text: &str) -> FaultError {
        let form = match kind {
            "stuck" => "stuck:WHEEL",
            "encoder" => "encoder:WHEEL:zero|frozen|noise",
            _ => return FaultError::form(text),
        };
        FaultError::Incomplete {
            found: text.to_owned(),
            form: form.to_owned(),
        }
    }

    /// Index of a wheel by name, or the error that names the wheels there are.
    ///
    /// # Errors
    /// [`FaultError::Wheel`].
    pub fn wheel_of(name: &str, robot: &Description) -> Result<usize, FaultError> {
        robot.wheel_index(name).ok_or_else(|| FaultError::Wheel {
            wheel: name.to_owned(),
            robot: robot.name.clone(),
            allowed: robot
                .wheels
                .iter()
                .map(|w| w.name.as_str())
                .collect::<Vec<_>>()
                .join(" "),
        })
    }

    /// Text form, as [`Self::parse`] takes it.
    #[must_use]
    pub fn text(&self, robot: &Description) -> String {
        let wheel = robot
            .wheels
            .get(self.wheel)
            .map_or("?", |w| w.name.as_str());
        match self.kind {
            FaultKind::Stuck => format!("stuck:{wheel}"),
            kind => format!("encoder:{wheel}:{kind}"),
        }
    }
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stuck => "stuck",
            Self::EncoderZero => "zero",
            Self::EncoderFrozen => "frozen",
            Self::EncoderNoise => "noise",
        })
    }
}
