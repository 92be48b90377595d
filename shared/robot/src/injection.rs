//! What an operator asks for when breaking a simulated robot, and when.

use crate::Description;
use crate::fault::{Fault, FaultError};

/// A change of the simulated robot's health.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// Break something.
    Inject(Fault),
    /// Mend everything of the wheel with this index.
    Clear(usize),
}

/// A change at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Injection {
    /// What changes.
    pub change: Change,
    /// When, s after the start of the drive.
    pub at_s: f64,
}

/// Why the text of an injection was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum InjectionError {
    /// The fault is wrong.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// There is no time.
    #[error("'{0}' has no time: expected SPEC@T, for example stuck:RM@5")]
    NoTime(String),
    /// The time is wrong.
    #[error("'{0}' is not a time: allowed is any finite number of seconds from 0")]
    Time(String),
}

impl Injection {
    /// Parses `SPEC@T`: a change and the seconds after the start of the drive.
    ///
    /// # Errors
    /// [`InjectionError`] naming what was given and what is allowed.
    pub fn parse(text: &str, robot: &Description) -> Result<Self, InjectionError> {
        let (spec, time) = text
            .rsplit_once('@')
            .ok_or_else(|| InjectionError::NoTime(text.to_owned()))?;
        let at_s = time
            .parse::<f64>()
            .ok()
            .filter(|t| t.is_finite() && *t >= 0.0)
            .ok_or_else(|| InjectionError::Time(time.to_owned()))?;
        Ok(Self {
            change: Self::parse_change(spec, robot)?,
            at_s,
        })
    }

    /// Parses `stuck:WHEEL`, `encoder:WHEEL:zero|frozen|noise` or `clear:WHEEL`.
    ///
    /// # Errors
    /// [`FaultError`] naming what was given and what is allowed.
    pub fn parse_change(text: &str, robot: &Description) -> Result<Change, FaultError> {
        match text.split_once(':') {
            Some(("clear", wheel)) => Fault::wheel_of(wheel, robot).map(Change::Clear),
            _ => Fault::parse(text, robot).map(Change::Inject),
        }
    }
}
