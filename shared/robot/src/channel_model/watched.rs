//! The components of a robot at work, and the most probable fault of each.

use vigil_blocks::WHEELS;
use vigil_checkpoint::Checkpoint;

use super::bank::{ChannelPlace, KINDS_MAX, Weighed};
use super::belief::{ComponentBelief, NO_BELIEF};
use super::component::{Places, Quantity, Target};
use super::declared_faults::DeclaredFaults;
use super::fault_kind::{DECLARED_KINDS, DRIVE_KINDS, FaultKind, SENSOR_KINDS};
use crate::slot::Slot;

/// What a component is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// A sensor of this quantity.
    Sensor(Quantity),
    /// A drive.
    Drive,
    /// A declared fault of the robot.
    Robot,
}

impl Part {
    /// Kind behind a place of its faults.
    pub fn kind(self, place: usize) -> Option<FaultKind> {
        let kinds: &[FaultKind] = match self {
            Self::Sensor(_) => &SENSOR_KINDS,
            Self::Drive => &DRIVE_KINDS,
            Self::Robot => &DECLARED_KINDS,
        };
        kinds.get(place).copied()
    }

    /// What it measures, if it is a sensor.
    #[must_use]
    pub const fn quantity(self) -> Option<Quantity> {
        match self {
            Self::Sensor(quantity) => Some(quantity),
            Self::Drive | Self::Robot => None,
        }
    }
}

/// A component at work.
#[derive(Debug, Clone, Copy, Checkpoint)]
pub struct Watch {
    /// Whether the channels in use show it.
    pub is_seen: bool,
    /// What it is.
    #[checkpoint(fixed)]
    pub part: Part,
    /// Slot of its evidence.
    pub slot: usize,
}

/// The components, by what shows them.
pub fn watched(at: Places, sensed: &[ChannelPlace], declared: &DeclaredFaults) -> Vec<Watch> {
    let watch = |i: usize| {
        let sensor = sensed.iter().find(|sensed| sensed.component == i);
        let part = match sensor {
            Some(sensed) => Part::Sensor(sensed.target.quantity),
            None if i >= at.declared => Part::Robot,
            None => Part::Drive,
        };
        let is_seen = match part {
            Part::Sensor(_) => true,
            Part::Drive => i >= at.drives,
            Part::Robot => declared.is_seen(i - at.declared),
        };
        Watch {
            is_seen,
            part,
            slot: sensor.map_or(Slot::ANY, |sensed| slot(&sensed.target)),
        }
    };
    (0..at.all).map(watch).collect()
}

/// The most probable kind of a component's fault.
pub fn likeliest(weighed: &[Weighed; KINDS_MAX], part: Part) -> ComponentBelief {
    let mut best = 0;
    for k in 1..KINDS_MAX {
        if weighed[k].log_ratio > weighed[best].log_ratio {
            best = k;
        }
    }
    let Some(kind) = part.kind(best) else {
        return NO_BELIEF;
    };
    ComponentBelief {
        p: 0.0,
        kind,
        size_kind: kind.size_kind(part.quantity()),
        size: weighed[best].size,
        size_sd: weighed[best].size_sd,
        age_s: weighed[best].age_s,
    }
}

/// Slot of a channel's evidence.
fn slot(target: &Target) -> usize {
    let wheel = target.wheel.unwrap_or(0).min(WHEELS - 1);
    match target.quantity {
        Quantity::Forward | Quantity::Lateral | Quantity::Turn => Slot::POSE,
        Quantity::YawRate => Slot::YAW_RATE,
        Quantity::WheelRate => Slot::wheel_rate(wheel),
        Quantity::Current => Slot::current(wheel),
        Quantity::Other => Slot::further(target.place),
    }
}
