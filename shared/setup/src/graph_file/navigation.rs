//! `[navigation]`: the corridor of the simulator.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

/// Coordinates beyond this are no corridor, m.
const COORDINATE_MAX_M: f64 = 1e3;
/// Points of a path, walls, obstacles: what a cycle may have to look at. Chosen by hand: far
/// more than a corridor has.
const COUNT_MAX: usize = 256;
/// Half a turn, rounded up so that a written 3.1416 is allowed, rad.
const YAW_MAX_RAD: f64 = 3.15;
/// A year is never, s.
const TIME_MAX_S: f64 = 3e7;

/// A corridor, a robot that follows a path in it, and what goes wrong.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Navigation {
    /// Points of the planned path, x and y in m; the first is the origin, the last the goal.
    #[schemars(
        length(min = 2, max = COUNT_MAX),
        inner(inner(range(min = -COORDINATE_MAX_M, max = COORDINATE_MAX_M))),
        extend("x-unit" = "m")
    )]
    pub path: Vec<[f64; 2]>,
    /// Points of the path that the planner finds when the first is blocked, its last being the
    /// goal; it is joined where the robot is. Without any there is no other path.
    #[schemars(
        length(max = COUNT_MAX),
        inner(inner(range(min = -COORDINATE_MAX_M, max = COORDINATE_MAX_M))),
        extend("x-unit" = "m")
    )]
    pub alternative: Vec<[f64; 2]>,
    /// Walls: x and y of both ends.
    #[schemars(
        length(max = COUNT_MAX),
        inner(inner(range(min = -COORDINATE_MAX_M, max = COORDINATE_MAX_M))),
        extend("x-unit" = "m")
    )]
    pub walls: Vec<[f64; 4]>,
    /// What stands in the way, or comes and goes: obstacles and people.
    #[schemars(length(max = COUNT_MAX))]
    pub obstacle: Vec<Obstacle>,
    /// What happens to the robot.
    #[schemars(length(max = COUNT_MAX))]
    pub trouble: Vec<Trouble>,
    /// Speed along the path, up to the robot's limit.
    #[default(0.25)]
    #[schemars(range(min = 0.01))]
    pub speed_m_s: f64,
    /// Radius of the disc that holds the robot.
    #[default(0.45)]
    #[schemars(range(min = 0.05, max = 2.0))]
    pub body_radius_m: f64,
    /// Free way ahead at which the robot stands.
    #[default(0.8)]
    #[schemars(range(min = 0.1, max = 10.0))]
    pub stop_m: f64,
    /// Free way ahead below which it slows down, at least 0.1 above `stop_m`.
    #[default(2.0)]
    #[schemars(range(min = 0.2, max = 20.0))]
    pub slow_m: f64,
    /// How long the robot looks for an opening before it says that there is none.
    #[default(6.0)]
    #[schemars(range(min = 0.1, max = 60.0))]
    pub look_s: f64,
    /// How long planning and finding the own place take.
    #[default(1.0)]
    #[schemars(range(min = 0.1, max = 60.0))]
    pub think_s: f64,
    /// How long help takes to come and to mend everything.
    #[default(8.0)]
    #[schemars(range(min = 0.1, max = 600.0))]
    pub help_s: f64,
    /// How far the robot backs when it is to move away.
    #[default(0.6)]
    #[schemars(range(min = 0.1, max = 5.0))]
    pub away_m: f64,
}

impl Navigation {
    /// A robot that has not come through an opening after this long, s, has not found one.
    pub const PASS_MAX_S: f64 = 12.0;
    /// A robot that moves away stands after this long, s, however far it came.
    pub const AWAY_MAX_S: f64 = 8.0;

    /// The longest that an action but waiting for help may run, s.
    #[must_use]
    pub(crate) const fn longest_action_s(&self) -> f64 {
        let through_s = self.look_s + Self::PASS_MAX_S;
        through_s.max(self.think_s).max(Self::AWAY_MAX_S)
    }
}

/// A disc in the way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Obstacle {
    /// Centre, ahead of the start.
    #[schemars(range(min = -COORDINATE_MAX_M, max = COORDINATE_MAX_M))]
    pub x_m: f64,
    /// Centre, left of the start.
    #[schemars(range(min = -COORDINATE_MAX_M, max = COORDINATE_MAX_M))]
    pub y_m: f64,
    /// Radius.
    #[schemars(range(min = 0.01, max = 20.0))]
    pub radius_m: f64,
    /// When it comes; at 0 it is there.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = TIME_MAX_S))]
    pub from_s: f64,
    /// When it leaves, after `from_s`; never unless given. People leave.
    #[schemars(range(min = 0.0, max = TIME_MAX_S))]
    pub until_s: Option<f64>,
}

/// Something that happens to the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Trouble {
    /// What happens.
    pub kind: TroubleKind,
    /// When.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = TIME_MAX_S))]
    pub at_s: f64,
    /// `mislocalised`: jump of the believed place along x; `phantom`: place of the phantom.
    #[serde(default)]
    #[schemars(range(min = -COORDINATE_MAX_M, max = COORDINATE_MAX_M))]
    pub x_m: f64,
    /// The same along y.
    #[serde(default)]
    #[schemars(range(min = -COORDINATE_MAX_M, max = COORDINATE_MAX_M))]
    pub y_m: f64,
    /// `mislocalised`: jump of the believed heading; `wrong-heading`: turn of the direction that
    /// the robot takes.
    #[serde(default)]
    #[schemars(range(min = -YAW_MAX_RAD, max = YAW_MAX_RAD))]
    pub yaw_rad: f64,
}

/// What may happen to the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
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
