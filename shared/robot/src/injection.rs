//! Injections: faults and disturbances that an operator starts or ends in the simulated rover.
//!
//! The text form is checked by launcher and `vigil inject` before anything starts; the numbers
//! travel in [`vigil_blocks::Control`] and [`vigil_blocks::Event`].

use vigil_blocks::Event;

use crate::description::Description;
use crate::disturbance::Disturbance;
use crate::disturbance_kind::{DisturbanceKind, KINDS, PARAMETERS};
use crate::fault::{Fault, FaultError, FaultKind};

/// A change of the simulated robot's health.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Change {
    /// Start a fault.
    Inject(Fault),
    /// Start a disturbance.
    Disturb(Disturbance),
    /// End every fault and disturbance of the wheel with this index.
    Clear(usize),
    /// End a kind of disturbance, at one place or everywhere.
    EndDisturbance(DisturbanceKind, Option<usize>),
    /// End everything.
    ClearAll,
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

/// What can be injected, faults, disturbances and their end, each with its meaning.
#[must_use]
pub fn forms() -> Vec<[String; 2]> {
    let faults = [
        ["stuck:WHEEL", "A wheel does not turn."],
        [
            "encoder:WHEEL:zero|frozen|noise",
            "An encoder reports 0, its last rate, or noise alone.",
        ],
    ];
    let ends = [
        ["clear:WHEEL", "Ends all that is wrong with a wheel."],
        ["clear:KIND[:PLACE]", "Ends a disturbance."],
        ["clear:all", "Ends everything."],
    ];
    let owned = |texts: [&str; 2]| texts.map(str::to_owned);
    let disturbances = KINDS.iter().map(|kind| [kind.form(), kind.meaning()]);
    let faults = faults.into_iter().map(owned);
    let ends = ends.into_iter().map(owned);
    faults.chain(disturbances).chain(ends).collect()
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

    /// Parses a change: a fault ([`Fault::parse`]), a disturbance ([`Disturbance::parse`]),
    /// `clear:WHEEL`, `clear:KIND[:PLACE]` or `clear:all`.
    ///
    /// # Errors
    /// [`FaultError`] naming what was given and what is allowed.
    pub fn parse_change(text: &str, robot: &Description) -> Result<Change, FaultError> {
        let parts: Vec<&str> = text.split(':').collect();
        match parts.as_slice() {
            ["clear", "all"] => Ok(Change::ClearAll),
            ["clear", name] => match DisturbanceKind::named(name) {
                Some(kind) => Ok(Change::EndDisturbance(kind, None)),
                None => Fault::wheel_of(name, robot).map(Change::Clear),
            },
            ["clear", name, place] => {
                let kind = DisturbanceKind::named(name).ok_or_else(|| FaultError::form(text))?;
                let place = kind.spec().place_of(place, robot)?;
                Ok(Change::EndDisturbance(kind, Some(place)))
            }
            [name, ..] if DisturbanceKind::named(name).is_some() => {
                Disturbance::parse(text, robot).map(Change::Disturb)
            }
            _ => Fault::parse(text, robot).map(Change::Inject),
        }
    }
}

/// A change as numbers, for [`vigil_blocks::Control`] and [`vigil_blocks::Event`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WireChange {
    /// True to start, false to end.
    pub injects: bool,
    /// Code of a [`FaultKind`] or [`DisturbanceKind`]; 0 for everything.
    pub kind: u32,
    /// Index of wheel or side; [`EVERYWHERE`] for none or all.
    pub place: u32,
    /// Parameters of a disturbance, else 0.
    pub parameter: [f64; PARAMETERS],
}

/// Stands for no place, or for all.
pub const EVERYWHERE: u32 = u32::MAX;

/// Place in an event's `what` that stands for [`EVERYWHERE`].
const EVERYWHERE_EVENT: u32 = 0xff;

impl WireChange {
    /// `what`, `p` and `value` of this change's event.
    #[must_use]
    pub const fn event(&self) -> (u32, f64, u64) {
        let place = if self.place < EVERYWHERE_EVENT {
            self.place
        } else {
            EVERYWHERE_EVENT
        };
        let [first, second] = self.parameter;
        (place | (self.kind << 8), first, second.to_bits())
    }

    /// The change behind an event; `injects` says which kind of event it is.
    #[must_use]
    pub const fn from_event(injects: bool, event: &Event) -> Self {
        let place = event.what & EVERYWHERE_EVENT;
        Self {
            injects,
            kind: event.what >> 8,
            place: if place == EVERYWHERE_EVENT {
                EVERYWHERE
            } else {
                place
            },
            parameter: [event.p, f64::from_bits(event.value)],
        }
    }
}

impl Change {
    /// The change as numbers.
    #[must_use]
    pub fn to_wire(self) -> WireChange {
        let (injects, kind, place, parameter) = match self {
            Self::Inject(Fault { kind, wheel }) => (true, kind as u32, Some(wheel), None),
            Self::Disturb(this) => (
                true,
                this.kind as u32,
                Some(this.place),
                Some(this.parameter),
            ),
            Self::Clear(wheel) => (false, 0, Some(wheel), None),
            Self::EndDisturbance(kind, place) => (false, kind as u32, place, None),
            Self::ClearAll => (false, 0, None, None),
        };
        WireChange {
            injects,
            kind,
            place: place.map_or(EVERYWHERE, |place| {
                u32::try_from(place).unwrap_or(EVERYWHERE)
            }),
            parameter: parameter.unwrap_or_default(),
        }
    }

    /// The change behind numbers, if this version knows it and its parameters are in range.
    #[must_use]
    pub fn from_wire(wire: &WireChange) -> Option<Self> {
        let place = (wire.place != EVERYWHERE).then_some(wire.place as usize);
        if let Some(kind) = DisturbanceKind::from_wire(wire.kind) {
            if !wire.injects {
                return Some(Self::EndDisturbance(kind, place));
            }
            let this = Disturbance {
                kind,
                place: place?,
                parameter: wire.parameter,
            };
            return this.check().is_ok().then_some(Self::Disturb(this));
        }
        match (wire.injects, wire.kind, place) {
            (true, kind, Some(wheel)) => {
                let kind = FaultKind::from_wire(kind)?;
                Some(Self::Inject(Fault { kind, wheel }))
            }
            (false, 0, Some(wheel)) => Some(Self::Clear(wheel)),
            (false, 0, None) => Some(Self::ClearAll),
            _ => None,
        }
    }

    /// Text form, as [`Injection::parse_change`] takes it.
    #[must_use]
    pub fn text(&self, robot: &Description) -> String {
        let wheel = |i: usize| robot.wheels.get(i).map_or("?", |wheel| wheel.name.as_str());
        match *self {
            Self::Inject(fault) => fault.text(robot),
            Self::Disturb(disturbance) => disturbance.text(robot),
            Self::Clear(i) => format!("clear:{}", wheel(i)),
            Self::EndDisturbance(kind, place) => {
                let spec = kind.spec();
                match place.and_then(|place| spec.place_name(place, robot)) {
                    Some(place) => format!("clear:{}:{place}", spec.name),
                    None => format!("clear:{}", spec.name),
                }
            }
            Self::ClearAll => "clear:all".to_owned(),
        }
    }
}
