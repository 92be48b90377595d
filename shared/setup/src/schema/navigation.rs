//! `[navigation]`: the corridor of the simulator; `[monitors]`: what is watched in any corridor.

use serde::Deserialize;

/// A corridor, a robot that follows a path in it, and what goes wrong. Coordinates are those of the
/// robot's start: it stands at the origin, looking along x; m, y to the left. Times count from the
/// first action that the robot obeys.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Navigation {
    /// Points of the planned path, x and y in m; the first is the origin, the last the goal.
    pub path: Vec<[f64; 2]>,
    /// Points of the path that the planner finds when the first is blocked, its last being the
    /// goal; it is joined where the robot is. Default: there is none.
    #[serde(default)]
    pub alternative: Vec<[f64; 2]>,
    /// Walls: x and y of both ends, m.
    #[serde(default)]
    pub walls: Vec<[f64; 4]>,
    /// What stands in the way, or comes and goes: obstacles and people.
    #[serde(default)]
    pub obstacle: Vec<Obstacle>,
    /// What happens to the robot.
    #[serde(default)]
    pub trouble: Vec<Trouble>,
    /// Speed along the path, m/s, above 0 to the robot's limit.
    #[serde(default = "speed_m_s")]
    pub speed_m_s: f64,
    /// Radius of the disc that holds the robot, m, 0.05 to 2.
    #[serde(default = "body_radius_m")]
    pub body_radius_m: f64,
    /// Free way ahead at which the robot stands, m, 0.1 to 10.
    #[serde(default = "stop_m")]
    pub stop_m: f64,
    /// Free way ahead below which it slows down, m, above `stop_m` to 20.
    #[serde(default = "slow_m")]
    pub slow_m: f64,
    /// How long the robot looks for an opening before it says that there is none, s, 0.1 to 60.
    #[serde(default = "look_s")]
    pub look_s: f64,
    /// How long planning and finding the own place take, s, 0.1 to 60.
    #[serde(default = "think_s")]
    pub think_s: f64,
    /// How long help takes to come and to mend everything, s, 0.1 to 600.
    #[serde(default = "help_s")]
    pub help_s: f64,
    /// How far the robot backs when it is to move away, m, 0.1 to 5.
    #[serde(default = "away_m")]
    pub away_m: f64,
}

impl Navigation {
    /// A robot that has not come through an opening after this long, s, has not found one.
    pub const PASS_MAX_S: f64 = 12.0;
    /// A robot that moves away stands after this long, s, however far it came.
    pub const AWAY_MAX_S: f64 = 8.0;

    /// The longest that an action but waiting for help may run, s.
    #[must_use]
    pub const fn longest_action_s(&self) -> f64 {
        let through_s = self.look_s + Self::PASS_MAX_S;
        through_s.max(self.think_s).max(Self::AWAY_MAX_S)
    }
}

/// A disc in the way.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Obstacle {
    /// Centre, m.
    pub x_m: f64,
    /// Centre, m.
    pub y_m: f64,
    /// Radius, m, 0.01 to 20.
    pub radius_m: f64,
    /// When it comes, s, from 0; default: it is there.
    #[serde(default)]
    pub from_s: f64,
    /// When it leaves, s, above `from_s`; default: never. People leave.
    pub until_s: Option<f64>,
}

/// Something that happens to the robot.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trouble {
    /// What happens.
    pub kind: TroubleKind,
    /// When, s, from 0.
    #[serde(default)]
    pub at_s: f64,
    /// `mislocalised`: jump of the believed place along x, m; `phantom`: place of the phantom.
    #[serde(default)]
    pub x_m: f64,
    /// The same along y, m.
    #[serde(default)]
    pub y_m: f64,
    /// `mislocalised`: jump of the believed heading; `wrong-heading`: turn of the direction that
    /// the robot takes; rad, -pi to pi.
    #[serde(default)]
    pub yaw_rad: f64,
}

/// What may happen to the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TroubleKind {
    /// The believed pose jumps away from the true one, until the robot re-localises.
    Mislocalised,
    /// The robot takes another direction than the path's, until it re-localises or plans anew.
    WrongHeading,
    /// The range sensor sees nothing any more; what is touched stops the robot. Until help comes.
    Blind,
    /// The range sensor sees an obstacle of 0.5 m radius where there is none; a close look tells.
    Phantom,
}

const fn speed_m_s() -> f64 {
    0.25
}

const fn body_radius_m() -> f64 {
    0.45
}

const fn stop_m() -> f64 {
    0.8
}

const fn slow_m() -> f64 {
    2.0
}

const fn look_s() -> f64 {
    6.0
}

const fn think_s() -> f64 {
    1.0
}

const fn help_s() -> f64 {
    8.0
}

const fn away_m() -> f64 {
    0.6
}
