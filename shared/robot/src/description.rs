//! Description of a robot, as read from `config/robots/*.toml`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vigil_blocks::{AnsweredWheels, WHEELS};
use vigil_inference::track::MotionNoise;

use crate::body::Body;
use crate::channel_table::FurtherChannel;
use crate::chassis::{Ground, Motor, RockerBogie};
use crate::context_table::{CONTEXTS_MAX, DeclaredContext};
use crate::fault_prior::FaultPrior;
use crate::fault_table::{DECLARED_MAX, DeclaredFault};
use crate::tolerance::Tolerance;

/// Shortest and longest interval of a model of channels, s. Chosen by hand: a frame of 50 Hz; two
/// observations in half a second.
pub(crate) const INTERVAL_MIN_S: f64 = 0.02;
pub(crate) const INTERVAL_MAX_S: f64 = 0.3;

/// Longest warm-up, s.
const WARM_UP_MAX_S: f64 = 600.0;
/// A limit that nothing reaches, in any unit.
const LIMIT_MAX: f64 = 1e3;
/// Part of an axis's limit up to which a robot without a geometry is not told to move.
const STANDING_PART: f64 = 0.02;

/// Kind of motion that the command vector describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kinematics {
    /// Six wheels on rocker-bogies, corner wheels steered about a common centre; the command is
    /// (signed curvature 1/m, speed m/s).
    Ackermann6,
    /// Two driven wheels, one on each side; the command is (speed m/s, yaw rate rad/s).
    Differential,
    /// Three omnidirectional wheels; the command is (velocity forward m/s, velocity left m/s) and,
    /// if the robot is turned too, yaw rate rad/s.
    Omni3,
    /// No geometry: any axes of a command, or none, and any channels. A car, an aircraft, a boat.
    None,
}

/// One axis of the command vector.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Name: of its column in recorded frames, and in messages.
    pub name: String,
    /// Unit, for messages: `m/s`, `rad/s`, `1/m`.
    pub unit: String,
    /// Largest magnitude commanded, in that unit.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub limit: f64,
}

/// Channels that are measured, besides the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MeasuredChannels {
    /// Pose: columns `x`, `y`, `yaw`.
    pub pose: bool,
    /// Rates of all wheels: columns `enc_<WHEEL>`.
    pub wheel_rates: bool,
    /// Angles of all steered wheels: columns `steer_<WHEEL>`.
    pub steer: bool,
    /// Yaw rate of a gyro: column `yaw_rate`.
    pub yaw_rate: bool,
    /// Motor currents of all wheels: columns `current_<WHEEL>`.
    pub currents: bool,
}

impl Default for MeasuredChannels {
    fn default() -> Self {
        Self {
            pose: true,
            wheel_rates: true,
            steer: true,
            yaw_rate: false,
            currents: false,
        }
    }
}

/// One wheel. Lengths in m from `base_link` (ground projection of the centre; x forward, y left).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wheel {
    /// Name, as used in faults and reports (`LF`).
    pub name: String,
    /// Contact point, forward, m.
    pub x: f64,
    /// Contact point, left, m.
    pub y: f64,
    /// True if the wheel has a steering servo.
    pub steered: bool,
}

/// Standard deviations of the sensors' white noise per sample at `reference_rate_hz`. At another
/// rate they scale so that the information per second is the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorNoise {
    /// Rate for which the deviations hold, Hz.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reference_rate_hz: f64,
    /// Position, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub position_m: f64,
    /// Yaw, rad.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub yaw_rad: f64,
    /// Yaw rate, rad/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub yaw_rate_rad_s: f64,
    /// Wheel rate, rad/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub wheel_rate_rad_s: f64,
    /// Steering angle, rad.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub steer_rad: f64,
    /// Motor current, A.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub current_a: f64,
}

/// Limits beyond which a command or a measurement is impossible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Largest magnitude of commanded curvature, 1/m; only an `ackermann6` has one.
    #[serde(default = "any_curvature_1_m")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub curvature_1_m: f64,
    /// Largest speed, m/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed_m_s: f64,
    /// Largest yaw rate, rad/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub yaw_rate_rad_s: f64,
    /// Largest wheel rate that an encoder can report, rad/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub wheel_rate_rad_s: f64,
}

impl Default for Limits {
    /// Limits that nothing reaches.
    fn default() -> Self {
        Self {
            curvature_1_m: LIMIT_MAX,
            speed_m_s: LIMIT_MAX,
            yaw_rate_rad_s: LIMIT_MAX,
            wheel_rate_rad_s: LIMIT_MAX,
        }
    }
}

/// A robot. Wheel order here is the order of every per-wheel array in the blocks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Name of the robot.
    pub name: String,
    /// Kind of motion.
    pub kinematics: Kinematics,
    /// Radius of the wheels, m; 0 if left out, which only a robot without a geometry may have.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub wheel_radius_m: f64,
    /// Mass, kg; only the simulator needs it, which drives an `ackermann6`.
    #[serde(default = "unknown_mass_kg")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub mass_kg: f64,
    /// Axes of the command, in the order that the kinematics give; left out: those of the rover,
    /// `cmd_curv` and `cmd_speed`.
    #[serde(default = "rover_command")]
    pub command: Vec<Axis>,
    /// Measured channels; left out: those of the rover.
    #[serde(default)]
    pub measured: MeasuredChannels,
    /// Channels beside the standard ones.
    #[serde(default)]
    pub channel: Vec<FurtherChannel>,
    /// Faults beside those of single sensors and drives; only of a robot with a model of channels.
    #[serde(default)]
    #[schemars(length(max = DECLARED_MAX))]
    pub fault: Vec<DeclaredFault>,
    /// Changes that are no fault, as of the ground; only of a robot with a model of channels.
    #[serde(default)]
    #[schemars(length(max = CONTEXTS_MAX))]
    pub context: Vec<DeclaredContext>,
    /// Order of the polynomials of the command in a model of channels.
    #[serde(default = "four")]
    #[schemars(range(min = 1, max = 4))]
    pub polynomial_order: usize,
    /// Interval over which a model of channels averages frames into one observation, s.
    #[serde(default = "tenth")]
    #[schemars(range(min = INTERVAL_MIN_S, max = INTERVAL_MAX_S))]
    pub interval_s: f64,
    /// First seconds of a run that a model of channels neither learns from nor watches, as sensors
    /// settle; left out: none.
    #[serde(default)]
    #[schemars(range(min = 0, max = WARM_UP_MAX_S))]
    pub warm_up_s: f64,
    /// Wheels; a robot without a geometry needs none.
    #[serde(default)]
    #[schemars(length(max = WHEELS))]
    pub wheels: Vec<Wheel>,
    /// Sensor noise; left out, or "estimate": a model of channels learns it from the log.
    #[serde(default, deserialize_with = "given_or_estimated")]
    pub noise: SensorNoise,
    /// Healthy variation beside that of the runs learned from; left out: none.
    #[serde(default)]
    pub tolerance: Option<Tolerance>,
    /// Drive motors; an `ackermann6` needs them, and the two below.
    #[serde(default)]
    pub motor: Option<Motor>,
    /// Linkage that carries the wheels.
    #[serde(default)]
    pub linkage: Option<RockerBogie>,
    /// Ground that its equilibria are solved on.
    #[serde(default)]
    pub ground: Option<Ground>,
    /// How the body follows its command; left out: as that of a small robot.
    #[serde(default)]
    pub body: Body,
    /// Prior rates of faults; left out: the defaults of its keys.
    #[serde(default)]
    pub fault_prior: FaultPrior,
    /// Limits; a robot without a geometry needs none.
    #[serde(default)]
    pub limits: Limits,
}

impl Default for SensorNoise {
    /// Valid values for a robot whose noise is learned: no filter uses them.
    fn default() -> Self {
        Self {
            reference_rate_hz: 20.0,
            position_m: 0.005,
            yaw_rad: 0.005,
            yaw_rate_rad_s: 0.01,
            wheel_rate_rad_s: 0.05,
            steer_rad: 0.003,
            current_a: 0.05,
        }
    }
}

fn unknown_mass_kg() -> f64 {
    10.0
}

fn rover_command() -> Vec<Axis> {
    let axis = |name: &str, unit: &str, limit| Axis {
        name: name.to_owned(),
        unit: unit.to_owned(),
        limit,
    };
    vec![axis("cmd_curv", "1/m", 1.2), axis("cmd_speed", "m/s", 0.5)]
}

fn four() -> usize {
    4
}

fn tenth() -> f64 {
    0.1
}

fn any_curvature_1_m() -> f64 {
    LIMIT_MAX
}

/// Sensor noise as a table, or the word "estimate".
fn given_or_estimated<'de, D: serde::Deserializer<'de>>(from: D) -> Result<SensorNoise, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Setting {
        Table(SensorNoise),
        Word(String),
    }
    match Setting::deserialize(from)? {
        Setting::Table(noise) => Ok(noise),
        Setting::Word(word) if word == "estimate" => Ok(SensorNoise::default()),
        Setting::Word(word) => Err(serde::de::Error::custom(format!(
            "noise is '{word}': allowed are \"estimate\" and a table of standard deviations"
        ))),
    }
}

impl Description {
    /// True if the robot has the rover's models of motion and faults, false if it has a model of
    /// channels.
    #[must_use]
    pub fn has_fault_models(&self) -> bool {
        self.kinematics == Kinematics::Ackermann6
    }

    /// Commanded velocity: forward m/s, left m/s, yaw rate rad/s; zero without a geometry.
    #[must_use]
    pub fn twist(&self, command: &[f64]) -> [f64; 3] {
        let axis = |i: usize| command.get(i).copied().unwrap_or(0.0);
        match self.kinematics {
            Kinematics::Ackermann6 => [axis(1), 0.0, axis(0) * axis(1)],
            Kinematics::Differential => [axis(0), 0.0, axis(1)],
            Kinematics::Omni3 => [axis(0), axis(1), axis(2)],
            Kinematics::None => [0.0; 3],
        }
    }

    /// True if a command asks the robot to move, beyond what it stands with.
    #[must_use]
    pub fn is_told_to_move(&self, command: &[f64]) -> bool {
        self.is_told_beyond(command, self.body.standing_m_s)
    }

    /// True if a command asks for more than this speed. Without a geometry a rate does (an axis in
    /// m/s or rad/s) above 2 % of its limit, and where no axis is a rate any axis; a robot without
    /// a command always moves.
    #[must_use]
    pub fn is_told_beyond(&self, command: &[f64], speed_m_s: f64) -> bool {
        if self.kinematics != Kinematics::None {
            return self.path_speed_m_s(self.twist(command)) > speed_m_s;
        }
        let is_rate = |axis: &Axis| axis.unit.ends_with("/s");
        let any_rate = self.command.iter().any(is_rate);
        let mut axes = self.command.iter().zip(command);
        let moves = axes.any(|(axis, value)| {
            is_rate(axis) == any_rate && value.abs() > STANDING_PART * axis.limit
        });
        moves || self.command.is_empty()
    }

    /// Speed of the fastest point between the outermost wheels for a velocity, m/s.
    #[must_use]
    pub fn path_speed_m_s(&self, twist: [f64; 3]) -> f64 {
        let reach = |wheel: &Wheel| wheel.x.hypot(wheel.y);
        let reach_m = self.wheels.iter().map(reach).fold(0.0, f64::max);
        twist[0].hypot(twist[1]).hypot(reach_m * twist[2])
    }

    /// The noise of a fault's motion, with the drift of the ground's context.
    #[must_use]
    pub fn with_ground_drift(&self, noise: MotionNoise) -> MotionNoise {
        let tolerance = self.tolerance.as_ref();
        tolerance.map_or(noise, |tolerance| tolerance.with_ground_drift(&noise))
    }

    /// Part of a steering angle's residual (rad) beyond the tolerance, if there is one.
    #[must_use]
    pub(crate) fn beyond_steer(&self, residual_rad: f64) -> f64 {
        let tolerance = self.tolerance.as_ref();
        tolerance.map_or(residual_rad, |tolerance| {
            tolerance.beyond_steer(residual_rad)
        })
    }

    /// Index of the wheel called `name`.
    #[must_use]
    pub fn wheel_index(&self, name: &str) -> Option<usize> {
        self.wheels.iter().position(|wheel| wheel.name == name)
    }

    /// An action's name, and the wheels that it is about after a colon: `limp_home:LF+RM`. Where
    /// some are stuck, those of broken encoders are marked: `limp_home:LF_ENC+RM`.
    #[must_use]
    pub fn action_text(&self, action: &str, wheels: AnsweredWheels) -> String {
        let is_mixed = wheels.stuck != 0 && wheels.encoders != 0;
        let name = |wheel: usize| {
            let name = &self.wheels.get(wheel)?.name;
            let is_encoder = wheels.has_encoder(wheel) && !wheels.has_stuck(wheel);
            Some(match is_mixed && is_encoder {
                true => format!("{name}_ENC"),
                false => name.clone(),
            })
        };
        let names: Vec<String> = wheels.wheels().filter_map(name).collect();
        match names.is_empty() {
            true => action.to_owned(),
            false => format!("{action}:{}", names.join("+")),
        }
    }
}
