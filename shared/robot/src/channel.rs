//! The channel list of a robot: what each number of its frames means.
//!
//! A frame carries a command and channels by place. The list, made from the robot's description,
//! gives every place its name, role and unit; its hash travels in the frame. The order is: pose
//! (`x`, `y`, `yaw`), wheel rates (`enc_<WHEEL>`), steering angles (`steer_<WHEEL>`), yaw rate
//! (`yaw_rate`), currents (`current_<WHEEL>`), and the description's `[[channel]]` tables.

use vigil_blocks::{CHANNELS, COMMANDS, Evidence, WHEELS, fnv1a};

use crate::channel_table::FurtherChannel;
pub use crate::channel_table::Role;
use crate::description::Description;

/// One channel of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Name.
    pub name: String,
    /// What it measures.
    pub role: Role,
    /// Index of its wheel, if it is one's.
    pub wheel: Option<usize>,
    /// Unit; empty if it has none.
    pub unit: String,
    /// True if recorded frames may lack it.
    pub is_optional: bool,
    /// Largest magnitude that it can measure, in its unit; none: any finite number.
    pub limit: Option<f64>,
    /// What it comes back to the same after, in its unit, if it is an angle.
    pub period: Option<f64>,
    /// Standard deviation of its noise per sample, if it is declared.
    pub noise: Option<f64>,
    /// Tolerance, if it is declared.
    pub tolerance: Option<f64>,
    /// Whether its level wanders without a fault.
    pub drifts: bool,
}

impl Channel {
    fn new(name: String, role: Role, unit: &str) -> Self {
        Self {
            name,
            role,
            wheel: None,
            unit: unit.to_owned(),
            is_optional: false,
            limit: None,
            period: None,
            noise: None,
            tolerance: None,
            drifts: false,
        }
    }

    fn further(further: &FurtherChannel) -> Self {
        Self {
            limit: further.limit,
            period: further.period,
            noise: further.noise,
            tolerance: further.tolerance,
            drifts: further.drifts.unwrap_or(further.role == Role::Voltage),
            ..Self::new(further.name.clone(), further.role, &further.unit)
        }
    }
}

/// The channels of `robot`, in the order of a frame; at most [`CHANNELS`].
#[must_use]
pub fn channels(robot: &Description) -> Vec<Channel> {
    let measured = &robot.measured;
    // Of a robot with fault models, gyro and currents are read where they are there.
    let reads_further = robot.has_fault_models();
    let mut all = Vec::new();
    if measured.pose {
        let names = [
            ("x", Role::PoseX, "m"),
            ("y", Role::PoseY, "m"),
            ("yaw", Role::PoseYaw, "rad"),
        ];
        all.extend(names.map(|(name, role, unit)| Channel::new(name.to_owned(), role, unit)));
    }
    let wheels = || robot.wheels.iter().enumerate().take(WHEELS);
    let of_wheel = |(i, wheel): (usize, &crate::description::Wheel), prefix, role, unit| Channel {
        wheel: Some(i),
        ..Channel::new(format!("{prefix}_{}", wheel.name), role, unit)
    };
    if measured.wheel_rates {
        all.extend(wheels().map(|wheel| of_wheel(wheel, "enc", Role::WheelRate, "rad/s")));
    }
    if measured.steer {
        let steered = wheels().filter(|(_, wheel)| wheel.steered);
        all.extend(steered.map(|wheel| of_wheel(wheel, "steer", Role::SteeringAngle, "rad")));
    }
    if measured.yaw_rate || reads_further {
        all.push(Channel {
            is_optional: !measured.yaw_rate,
            ..Channel::new("yaw_rate".to_owned(), Role::BodyRate, "rad/s")
        });
    }
    if measured.currents || reads_further {
        all.extend(wheels().map(|wheel| Channel {
            is_optional: !measured.currents,
            ..of_wheel(wheel, "current", Role::Current, "A")
        }));
    }
    all.extend(robot.channel.iter().map(Channel::further));
    all.truncate(CHANNELS);
    all
}

/// Hash over what gives a frame's numbers their meaning: names and units of command and channels,
/// in order. Never 0, which a frame that says nothing carries.
#[must_use]
pub fn hash(robot: &Description) -> u64 {
    let text = |hash, text: &str| fnv1a::hash(fnv1a::hash(hash, text.as_bytes()), b"\n");
    let axes = robot.command.iter().take(COMMANDS);
    let hash = axes.fold(fnv1a::BASIS, |hash, axis| {
        text(text(hash, &axis.name), &axis.unit)
    });
    let all = channels(robot);
    let hash = all.iter().fold(text(hash, "channels"), |hash, channel| {
        text(text(hash, &channel.name), &channel.unit)
    });
    hash.max(1)
}

/// The command and channels of `robot` as text for publishers: a line `robot <hash> <name>`, then
/// one for each axis and channel, `command <place> <name> <unit>` and `channel <place> <name>
/// <unit>`; a unit of `-` is none.
#[must_use]
pub fn channel_list_text(robot: &Description) -> String {
    let unit = |unit: &str| if unit.is_empty() { "-" } else { unit }.to_owned();
    let mut text = format!("robot {:016x} {}\n", hash(robot), robot.name);
    for (place, axis) in robot.command.iter().enumerate().take(COMMANDS) {
        text += &format!("command {place} {} {}\n", axis.name, unit(&axis.unit));
    }
    for (place, channel) in channels(robot).iter().enumerate() {
        text += &format!("channel {place} {} {}\n", channel.name, unit(&channel.unit));
    }
    text
}

/// What a place of the evidence by channel is called: a channel, or several at once.
#[must_use]
pub fn evidence_name(robot: &Description, place: usize) -> String {
    match place {
        Evidence::POSE => return "pose".into(),
        Evidence::ANY => return "all channels".into(),
        _ => {}
    }
    let channels = channels(robot);
    let Some(channel) = channels.get(place) else {
        return "?".into();
    };
    let wheel = channel.wheel.and_then(|i| robot.wheels.get(i));
    match (channel.role, wheel) {
        (Role::WheelRate, Some(wheel)) => format!("wheel rate {}", wheel.name),
        (Role::SteeringAngle, Some(wheel)) => format!("steering {}", wheel.name),
        _ => channel.name.clone(),
    }
}
