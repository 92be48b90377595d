//! Findings of the publisher check, as events and in words.

use std::f64::consts::{PI, TAU};

use vigil_checkpoint::CheckpointValue;

use crate::description::{Description, Kinematics};

/// Channels that each wheel has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WheelChannel {
    Rate,
    Steer,
}

/// Kind of a finding. The value is its code in events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, CheckpointValue)]
#[repr(u32)]
pub enum FindingKind {
    /// The pose moves so many times the commanded travel.
    Travel = 1,
    /// The pose moves at this angle to its yaw, rad, where 0 is commanded.
    Heading = 2,
    /// The yaw turns so many times the commanded angle.
    Turn = 3,
    /// The gyro turns so many times the commanded angle.
    Gyro = 4,
    /// The wheels turn so many times as fast as the command makes them roll.
    Rates = 5,
    /// This wheel's rate has the other sign.
    RateSign = 6,
    /// This wheel's channel and that of the wheel `value` read each other's rate.
    Sides = 7,
    /// This wheel's steering angle has the other sign.
    SteerSign = 8,
    /// Frames come, and most come after their deadlines: the share that does.
    Late = 9,
    /// Frames come so many times as often as the graph's rate says.
    Rate = 10,
    /// This wheel's channel reads the rate of the wheel `value`.
    RateOrder = 11,
    /// The steering angles of this wheel and of the wheel `value` are exchanged.
    SteerSides = 12,
    /// This wheel's channel reads the steering angle of the wheel `value`.
    SteerOrder = 13,
}

impl FindingKind {
    const ALL: [Self; 13] = [
        Self::Travel,
        Self::Heading,
        Self::Turn,
        Self::Gyro,
        Self::Rates,
        Self::RateSign,
        Self::Sides,
        Self::SteerSign,
        Self::Late,
        Self::Rate,
        Self::RateOrder,
        Self::SteerSides,
        Self::SteerOrder,
    ];

    /// True if it hides faults: the whole channel has another meaning. A single wheel does not: it
    /// shows as a departure.
    #[must_use]
    pub const fn is_blinding(self) -> bool {
        matches!(
            self,
            Self::Travel | Self::Heading | Self::Turn | Self::Gyro | Self::Rates
        )
    }

    /// Of channels that read other wheels: two that are exchanged, or one of several.
    pub(super) const fn order(channel: WheelChannel, is_exchange: bool) -> Self {
        match (channel, is_exchange) {
            (WheelChannel::Rate, true) => Self::Sides,
            (WheelChannel::Rate, false) => Self::RateOrder,
            (WheelChannel::Steer, true) => Self::SteerSides,
            (WheelChannel::Steer, false) => Self::SteerOrder,
        }
    }
}

/// A disagreement between frames and description.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Finding {
    /// What disagrees.
    pub kind: FindingKind,
    /// Of which wheel, where it is of one.
    pub wheel: Option<usize>,
    /// How far off; see [`FindingKind`].
    pub value: f64,
}

/// In an event: no wheel.
const NO_WHEEL: u32 = 255;

impl Finding {
    /// As an event's `what`.
    #[must_use]
    pub fn to_wire(&self) -> u32 {
        let wheel = self.wheel.and_then(|wheel| u32::try_from(wheel).ok());
        self.kind as u32 + 256 * wheel.map_or(NO_WHEEL, |wheel| wheel.min(NO_WHEEL))
    }

    /// From an event's `what` and `p`, if this version knows it.
    #[must_use]
    pub fn from_wire(what: u32, value: f64) -> Option<Self> {
        let kind = FindingKind::ALL
            .into_iter()
            .find(|k| *k as u32 == what & 255)?;
        let wheel = (what >> 8 != NO_WHEEL).then_some((what >> 8) as usize);
        Some(Self { kind, wheel, value })
    }

    /// In words, for the author of the publisher.
    #[must_use]
    pub fn text(&self, robot: &Description) -> String {
        let name = |place: usize| robot.wheels.get(place).map_or("?", |wheel| &wheel.name);
        // An order's value is a wheel's place.
        let places = [
            self.wheel.unwrap_or(usize::MAX),
            self.value.max(0.0) as usize,
        ];
        let [wheel, other] = places.map(name);
        let turn = turning(robot);
        let v = self.value;
        let are_they = |units| unit(v, "are they", units);
        let is_it = |units| unit(v, "is it", units);
        match self.kind {
            FindingKind::Travel => format!(
                "units: x and y move {v:.3} times the commanded travel{}",
                are_they(&TRAVEL)
            ),
            FindingKind::Heading => format!(
                "axes: x and y move at {v:.2} rad to yaw, 0 is commanded: is yaw 0 along x, y to \
                 the left, and yaw in rad?"
            ),
            FindingKind::Turn if v < 0.0 => format!(
                "signs: yaw turns {v:.2} times the commanded angle: is yaw or {turn} positive to \
                 the right?"
            ),
            FindingKind::Turn => format!(
                "units: yaw turns {v:.2} times the commanded angle{}",
                is_it(&TURN)
            ),
            FindingKind::Gyro if v < 0.0 => format!(
                "signs: yaw_rate is {v:.2} times the commanded one: is it or {turn} positive to \
                 the right?"
            ),
            FindingKind::Gyro => format!(
                "units: yaw_rate is {v:.2} times the commanded one{}",
                is_it(&YAW_RATE_UNITS)
            ),
            FindingKind::Rates => format!(
                "units: the wheels turn {v:.3} times as fast as the command makes them roll{}",
                are_they(&RATES)
            ),
            FindingKind::RateSign => format!("signs: enc_{wheel} has the other sign"),
            FindingKind::Sides => format!(
                "order: enc_{wheel} and enc_{other} fit when exchanged{}",
                or_turned(robot, turn, places)
            ),
            FindingKind::RateOrder => format!("order: enc_{wheel} fits as enc_{other}"),
            FindingKind::SteerSides => {
                format!("order: steer_{wheel} and steer_{other} fit when exchanged")
            }
            FindingKind::SteerOrder => format!("order: steer_{wheel} fits as steer_{other}"),
            FindingKind::SteerSign => {
                format!("signs: steer_{wheel} has the other sign, or is another wheel's")
            }
            FindingKind::Late => format!(
                "late: {:.0} % of the frames come after their deadlines: in bursts, or without the \
                 event that wakes the graph",
                100.0 * v
            ),
            FindingKind::Rate => format!("rate: frames come at {v:.2} times the graph's rate"),
        }
    }
}

/// Sides are exchanged alike by a command that turns the other way.
fn or_turned(robot: &Description, turn: &str, wheels: [usize; 2]) -> String {
    let [y, other_y] = wheels.map(|wheel| robot.wheels.get(wheel).map_or(0.0, |wheel| wheel.y));
    match robot.kinematics {
        Kinematics::Ackermann6 | Kinematics::Differential if y * other_y < 0.0 => {
            format!("; or is {turn} positive to the right?")
        }
        _ => String::new(),
    }
}

/// The command's axis that asks for turns.
fn turning(robot: &Description) -> &str {
    let axis = match robot.kinematics {
        Kinematics::Ackermann6 => 0,
        Kinematics::Differential => 1,
        Kinematics::Omni3 => 2,
        Kinematics::None => return "the command",
    };
    let axis = robot.command.get(axis);
    axis.map_or("the command", |axis| axis.name.as_str())
}

/// Factors that units make.
const TRAVEL: [(f64, &str); 4] = [
    (1000.0, "mm"),
    (100.0, "cm"),
    (39.37, "inches"),
    (3.281, "feet"),
];
const TURN: [(f64, &str); 2] = [(180.0 / PI, "degrees"), (1000.0, "thousandths of a rad")];
/// Units that a yaw rate may be in instead of rad/s, and how much larger it then reads.
pub const YAW_RATE_UNITS: [(f64, &str); 2] = [(180.0 / PI, "deg/s"), (1000.0, "mrad/s")];
const RATES: [(f64, &str); 3] = [
    (180.0 / PI, "deg/s"),
    (60.0 / TAU, "rpm"),
    (1.0 / TAU, "revolutions per second"),
];

/// The question for the unit whose factor is within a fifth of the ratio. `asked`: its beginning.
fn unit(ratio: f64, asked: &str, units: &[(f64, &str)]) -> String {
    let near = |factor: f64| (0.8..1.25).contains(&(ratio / factor));
    let found = units.iter().find(|(factor, _)| near(*factor));
    found.map_or_else(String::new, |(_, name)| format!(": {asked} in {name}?"))
}

/// True if the ratio is what the rates' units make of 1.
pub(super) fn is_rate_unit(ratio: f64) -> bool {
    let near = |factor: f64| (0.8..1.25).contains(&(ratio / factor));
    RATES.iter().any(|(factor, _)| near(*factor))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_asks_for_the_unit_of_its_own_channel() {
        let text = include_str!("../../../../config/robots/rover.toml");
        let robot: Description = toml::from_str(text).unwrap_or_else(|error| panic!("{error}"));
        let text = |kind: FindingKind, value: f64| {
            let wheel = None;
            Finding { kind, wheel, value }.text(&robot)
        };
        for (kind, value, wanted) in [
            (
                FindingKind::Gyro,
                57.3,
                "units: yaw_rate is 57.30 times the commanded one: is it in deg/s?",
            ),
            (
                FindingKind::Gyro,
                1010.0,
                "units: yaw_rate is 1010.00 times the commanded one: is it in mrad/s?",
            ),
            (
                FindingKind::Gyro,
                20.0,
                "units: yaw_rate is 20.00 times the commanded one",
            ),
            (
                FindingKind::Turn,
                57.3,
                "units: yaw turns 57.30 times the commanded angle: is it in degrees?",
            ),
            (
                FindingKind::Travel,
                990.0,
                "units: x and y move 990.000 times the commanded travel: are they in mm?",
            ),
            (
                FindingKind::Rates,
                57.3,
                "units: the wheels turn 57.300 times as fast as the command makes them roll: are \
                 they in deg/s?",
            ),
        ] {
            assert_eq!(text(kind, value), wanted);
        }
    }

    #[test]
    fn findings_survive_the_wire() {
        for kind in FindingKind::ALL {
            for wheel in [None, Some(0), Some(5)] {
                let finding = Finding {
                    kind,
                    wheel,
                    value: 2.5,
                };
                assert_eq!(Finding::from_wire(finding.to_wire(), 2.5), Some(finding));
            }
        }
        assert_eq!(Finding::from_wire(99, 0.0), None);
    }
}
