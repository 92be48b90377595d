//! What of a robot is modelled: its channels, the drives behind its command, and the components
//! whose faults are named.

use nalgebra::DMatrix;
use vigil_blocks::CHANNELS;

use super::{AXES, CHANNELS_MAX, DRIVES_MAX};
use crate::channel::{Role, channels};
use crate::context_table::{CONTEXTS_MAX, DeclaredContext};
use crate::description::{Description, Kinematics};
use crate::fault_table::{DECLARED_MAX, DeclaredFault, SHOWN_MAX};
use crate::frame_guard::{BEYOND_LIMITS, CURRENT_MAX_A};
use crate::kinematics::contact_factors;

/// What a channel measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Velocity of the pose along its heading, m/s.
    Forward,
    /// Velocity of the pose to the left of its heading, m/s.
    Lateral,
    /// Rate at which the pose turns, rad/s.
    Turn,
    /// Rate of the body about its vertical axis, rad/s.
    YawRate,
    /// Rate of a wheel, rad/s.
    WheelRate,
    /// Current of a wheel's motor, A.
    Current,
    /// Any other channel of the description, in its unit.
    Other,
}

impl Quantity {
    /// True for what is taken from the pose.
    #[must_use]
    pub const fn is_pose(self) -> bool {
        matches!(self, Self::Forward | Self::Lateral | Self::Turn)
    }
}

/// A measured quantity of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// Name: `forward`, `lateral` and `turn` of the pose, else that of the frame's channel.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// What it is.
    pub quantity: Quantity,
    /// Place of its channel in a frame; [`CHANNELS`] for what is taken from the pose.
    pub place: usize,
    /// Wheel that it belongs to, if any.
    pub wheel: Option<usize>,
    /// Largest magnitude that it can have.
    pub largest: f64,
    /// What it comes back to the same after, if it is an angle.
    pub period: Option<f64>,
    /// Whether its level wanders without a fault.
    pub drifts: bool,
}

/// Words that no fault may be called by.
const RESERVED: [&str; 4] = ["ND", "UNKNOWN", "MULTIPLE", "BLIND"];
/// Name of the component of a pose.
const POSE: &str = "pose";

/// What is modelled of a robot, in order: at most [`CHANNELS_MAX`]. The axes of a pose become the
/// velocities between two of them.
#[must_use]
pub fn targets(robot: &Description) -> Vec<Target> {
    let mut all = predicted(robot);
    all.truncate(CHANNELS_MAX);
    all
}

impl Target {
    /// Name of the component that it belongs to.
    #[must_use]
    pub fn component(&self) -> &str {
        match self.quantity.is_pose() {
            true => POSE,
            false => &self.name,
        }
    }

    /// True if it is the rate of the wheel of this name.
    #[must_use]
    pub fn is_rate_of(&self, robot: &Description, wheel: &str) -> bool {
        let of = self.wheel.and_then(|wheel| robot.wheels.get(wheel));
        self.quantity == Quantity::WheelRate && of.is_some_and(|of| of.name == wheel)
    }
}

fn predicted(robot: &Description) -> Vec<Target> {
    let mut out = Vec::new();
    if robot.measured.pose {
        let pose = [
            ("forward", "m/s", Quantity::Forward),
            ("lateral", "m/s", Quantity::Lateral),
            ("turn", "rad/s", Quantity::Turn),
        ];
        out.extend(pose.map(|(name, unit, quantity)| Target {
            name: name.to_owned(),
            unit: unit.to_owned(),
            quantity,
            place: CHANNELS,
            wheel: None,
            largest: f64::INFINITY,
            period: None,
            drifts: false,
        }));
    }
    let limits = &robot.limits;
    for (place, channel) in channels(robot).into_iter().enumerate() {
        let (quantity, largest) = match channel.role {
            Role::PoseX | Role::PoseY | Role::PoseYaw => continue,
            Role::BodyRate if channel.name == "yaw_rate" => {
                (Quantity::YawRate, BEYOND_LIMITS * limits.yaw_rate_rad_s)
            }
            Role::WheelRate if channel.wheel.is_some() => {
                (Quantity::WheelRate, BEYOND_LIMITS * limits.wheel_rate_rad_s)
            }
            Role::Current if channel.wheel.is_some() => (Quantity::Current, CURRENT_MAX_A),
            _ => (
                Quantity::Other,
                channel
                    .limit
                    .map_or(f64::MAX, |limit| BEYOND_LIMITS * limit),
            ),
        };
        out.push(Target {
            name: channel.name,
            unit: channel.unit,
            quantity,
            place,
            wheel: channel.wheel,
            largest,
            period: channel.period,
            drifts: channel.drifts,
        });
    }
    out
}

/// Why a robot's channels cannot be modelled; none if they can.
#[must_use]
pub fn unfit(robot: &Description) -> Option<String> {
    let all = predicted(robot);
    if all.len() > CHANNELS_MAX {
        let found = all.len();
        return Some(format!(
            "{found} channels: allowed are {CHANNELS_MAX}, a pose counts as three"
        ));
    }
    let is_taken = |i: usize| {
        let name = &all[i].name;
        let own = !all[i].quantity.is_pose();
        own && (name == POSE || all[..i].iter().any(|other| other.name == *name))
    };
    if let Some(twice) = (0..all.len()).find(|&i| is_taken(i)) {
        let name = &all[twice].name;
        return Some(format!(
            "a channel cannot be called '{name}': the name is taken"
        ));
    }
    let both = |one: &&Target| one.drifts && one.period.is_some();
    if let Some(both) = all.iter().find(both) {
        let name = &both.name;
        return Some(format!(
            "channel '{name}' has a period and drifts: allowed is one of both, as the level of an \
             angle has no mean"
        ));
    }
    let found = robot.fault.len();
    if found > DECLARED_MAX {
        return Some(format!("{found} faults: allowed are {DECLARED_MAX}"));
    }
    let components = components(robot);
    let unfit = |fault: &DeclaredFault| unfit_fault(fault, robot, (&all, &components));
    let refused = robot.fault.iter().find_map(unfit);
    refused.or_else(|| unfit_contexts(&robot.context, &components, &all))
}

/// Why declared contexts cannot be watched; none if they can.
fn unfit_contexts(
    contexts: &[DeclaredContext],
    components: &[Component],
    all: &[Target],
) -> Option<String> {
    let found = contexts.len();
    if found > CONTEXTS_MAX {
        return Some(format!("{found} contexts: allowed are {CONTEXTS_MAX}"));
    }
    let is_node = |name: &String| {
        let mut nodes = components.iter();
        nodes.any(|node| node.name == *name || node.group.as_ref() == Some(name))
    };
    let unfit = |(i, DeclaredContext { name, shows }): (usize, &DeclaredContext)| {
        let is_unknown = |shown: &&String| all.iter().all(|target| target.name != **shown);
        let said = match name {
            name if !is_word(name) => format!("'{name}' is no name, which has {LETTERS}"),
            name if RESERVED.contains(&name.as_str()) => {
                format!("'{name}' is a word of Vigil's own")
            }
            name if is_node(name) || contexts[..i].iter().any(|other| other.name == *name) => {
                "its name is taken".to_owned()
            }
            _ => format!(
                "shows in '{}', which is no channel; there are {}",
                shows.iter().find(is_unknown)?,
                names(all)
            ),
        };
        Some(format!("context '{name}': {said}"))
    };
    contexts.iter().enumerate().find_map(unfit)
}

/// What a name has.
const LETTERS: &str = "letters, digits, _ and -";

fn is_word(word: &str) -> bool {
    let is_letter = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    !word.is_empty() && word.chars().all(is_letter)
}

/// Why a declared fault cannot be watched; none if it can.
fn unfit_fault(
    fault: &DeclaredFault,
    robot: &Description,
    (all, components): (&[Target], &[Component]),
) -> Option<String> {
    let name = &fault.name;
    let words = std::iter::once(name).chain(&fault.group);
    if let Some(word) = words.clone().find(|word| !is_word(word)) {
        return Some(format!(
            "fault '{name}': '{word}' is no name, which has {LETTERS}"
        ));
    }
    if let Some(word) = words.clone().find(|word| RESERVED.contains(&word.as_str())) {
        return Some(format!("fault '{name}': '{word}' is a word of Vigil's own"));
    }
    let count = |word: &String| {
        components
            .iter()
            .filter(|other| other.name == *word)
            .count()
    };
    let nodes = components.iter().filter_map(|other| other.group.as_ref());
    let is_node = nodes.clone().any(|group| group == name);
    if count(name) > 1 || is_node || fault.group.as_ref().is_some_and(|group| count(group) > 0) {
        return Some(format!(
            "fault '{name}': its name, or that of its group, is taken"
        ));
    }
    let mut shows = fault.shows.iter().enumerate();
    if let Some((_, twice)) = shows.find(|(i, channel)| fault.shows[..*i].contains(channel)) {
        return Some(format!("fault '{name}' shows in '{twice}' twice"));
    }
    if fault.shows.len() > SHOWN_MAX {
        let found = fault.shows.len();
        return Some(format!(
            "fault '{name}' shows in {found} channels: allowed are {SHOWN_MAX}"
        ));
    }
    if let Some(wheel) = &fault.wheel
        && !all.iter().any(|target| target.is_rate_of(robot, wheel))
    {
        return Some(format!(
            "fault '{name}' comes back with the turns of '{wheel}', which is no wheel whose rate \
             is measured"
        ));
    }
    let is_unknown = |shown: &&String| all.iter().all(|target| target.name != **shown);
    let unknown = fault.shows.iter().find(is_unknown)?;
    Some(format!(
        "fault '{name}' shows in '{unknown}', which is no channel; there are {}",
        names(all)
    ))
}

fn names(all: &[Target]) -> String {
    let names: Vec<&str> = all.iter().map(|target| target.name.as_str()).collect();
    names.join(", ")
}

/// What turns a part of the command into motion: a wheel's motor, or an axis of the command where
/// the description does not say how the wheels share it.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Name: that of its wheel or axis.
    pub name: String,
    /// Wheel, if it is one's.
    pub wheel: Option<usize>,
    /// Commanded speed by the command's axes: its product with the command.
    pub speed: [f64; AXES],
    /// Change of the command that is as good as one unit more of this drive's speed.
    pub effect: [f64; AXES],
}

/// The drives of a robot, at most [`DRIVES_MAX`].
#[must_use]
pub fn drives(robot: &Description) -> Vec<Drive> {
    let axes = robot.command.len().min(AXES);
    // By the axes of the command.
    let row = |wheel: usize| match (robot.kinematics, contact_factors(robot, wheel)) {
        (Kinematics::Differential, Some([forward, _, turn])) => vec![forward, turn],
        (_, factors) => factors.map_or_else(Vec::new, Vec::from),
    };
    let rows: Vec<Vec<f64>> = (0..robot.wheels.len()).map(row).collect();
    let wheels = rows.len().min(DRIVES_MAX);
    let shares = axes > 0 && wheels > 0 && rows.iter().all(|row| row.len() >= axes);
    let inverse = shares.then(|| {
        let matrix = DMatrix::from_fn(wheels, axes, |i, axis| rows[i][axis]);
        matrix.pseudo_inverse(1e-9).ok()
    });
    let Some(inverse) = inverse.flatten() else {
        let unit = |i: usize| std::array::from_fn(|axis| f64::from(u8::from(axis == i)));
        let axis = |(i, axis): (usize, &crate::description::Axis)| Drive {
            name: axis.name.clone(),
            wheel: None,
            speed: unit(i),
            effect: unit(i),
        };
        return robot
            .command
            .iter()
            .enumerate()
            .take(axes)
            .map(axis)
            .collect();
    };
    let of = |i: usize| Drive {
        name: robot.wheels[i].name.clone(),
        wheel: Some(i),
        speed: std::array::from_fn(|axis| {
            rows[i]
                .get(axis)
                .copied()
                .filter(|_| axis < axes)
                .unwrap_or(0.0)
        }),
        effect: std::array::from_fn(|axis| inverse.get((axis, i)).copied().unwrap_or(0.0)),
    };
    (0..wheels).map(of).collect()
}

impl Drive {
    /// Its commanded speed.
    #[must_use]
    pub fn commanded(&self, command: &[f64; AXES]) -> f64 {
        self.speed.iter().zip(command).map(|(a, b)| a * b).sum()
    }

    /// True if a change of its speed does to the robot what the same change of another one's does.
    #[must_use]
    pub fn moves_like(&self, other: &Self) -> bool {
        let near = |a: &[f64; AXES], b: &[f64; AXES]| {
            let mut pairs = a.iter().zip(b);
            pairs.all(|(a, b)| (a - b).abs() <= 1e-9 * (a.abs() + b.abs()))
        };
        near(&self.speed, &other.speed) && near(&self.effect, &other.effect)
    }

    /// The command that the robot gets if this drive stands still.
    #[must_use]
    pub fn without(&self, command: &[f64; AXES]) -> [f64; AXES] {
        let speed = self.commanded(command);
        std::array::from_fn(|axis| command[axis] - speed * self.effect[axis])
    }
}

/// What can be broken, and is named.
#[derive(Debug, Clone, PartialEq)]
pub struct Component {
    /// Name of its leaf: `pose`, a channel's name, or `drive_<WHEEL>`.
    pub name: String,
    /// Its fault in the words of a fault tree: `sensor:<CHANNEL>`, `drive:<WHEEL>` or
    /// `fault:<NAME>`.
    pub fault: String,
    /// Abstract node above it: its wheel's, that of all further sensors, or the one declared.
    pub group: Option<String>,
}

/// Where among the components of a robot its drives and its declared faults begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Places {
    /// Place of the first drive.
    pub drives: usize,
    /// Place of the first declared fault, after the last drive.
    pub declared: usize,
    /// Components.
    pub all: usize,
}

impl Places {
    /// Those of a robot's [`components`].
    #[must_use]
    pub fn new(robot: &Description) -> Self {
        let all = components(robot).len();
        let declared = all - robot.fault.len().min(DECLARED_MAX);
        Self {
            drives: declared - drives(robot).len(),
            declared,
            all,
        }
    }
}

/// The components of a robot: its sensors in the order of [`targets`], those of the pose as one,
/// then its drives, then the faults that its description declares.
#[must_use]
pub fn components(robot: &Description) -> Vec<Component> {
    let group = |wheel: Option<usize>| {
        let wheel = wheel.and_then(|wheel| robot.wheels.get(wheel));
        Some(wheel.map_or("BODY".to_owned(), |wheel| format!("WHEEL_{}", wheel.name)))
    };
    let group_of = |declared: &DeclaredFault| {
        let name = declared.wheel.as_ref()?;
        group(robot.wheel_index(name))
    };
    let mut out: Vec<Component> = Vec::new();
    for target in targets(robot) {
        let name = target.component().to_owned();
        if out.iter().any(|component| component.name == name) {
            continue;
        }
        out.push(Component {
            fault: format!("sensor:{name}"),
            group: group(target.wheel),
            name,
        });
    }
    out.extend(drives(robot).into_iter().map(|drive| Component {
        name: format!("drive_{}", drive.name),
        fault: format!("drive:{}", drive.name),
        group: group(drive.wheel),
    }));
    out.extend(
        robot
            .fault
            .iter()
            .take(DECLARED_MAX)
            .map(|declared| Component {
                name: declared.name.clone(),
                fault: format!("fault:{}", declared.name),
                group: declared.group.clone().or_else(|| group_of(declared)),
            }),
    );
    out
}
