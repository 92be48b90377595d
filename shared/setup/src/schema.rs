//! The configuration's schema: every key, its unit, range and default.
//!
//! A graph file (`config/rover.toml`) holds one [`GraphFile`]; it names the robot, the fault
//! tree, the learned model and the decision model, each a file of its own. Paths are relative to
//! the graph file. Keys end in their unit. Unknown keys are errors.

use serde::Deserialize;
use vigil_cycle::OnMiss;

mod navigation;
mod sensor;

pub use navigation::{Navigation, Obstacle, Trouble, TroubleKind};
pub use sensor::{Sensor, Socket, Source};
pub use vigil_decision::settings::{Evidence, Gate, Recovery, RecoveryAction, Supervisor};
pub use vigil_diagnosis::settings::{
    Detector, Form, Identifier, IdentifierFilter, Monitors, PARTICLES, Sensors,
};

/// A whole graph file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraphFile {
    /// Identity of the graph and its schedule.
    pub graph: Graph,
    /// The models that the graph runs on.
    pub files: Files,
    /// Placement and deadlines, one table per service.
    pub services: Services,
    /// Sizes of the shared-memory queues.
    #[serde(default)]
    pub transport: Transport,
    /// Where sensor frames come from.
    #[serde(default)]
    pub sensor: Sensor,
    /// What the simulated rover drives: segments, repeated for ever.
    #[serde(default)]
    pub drive: Vec<DriveSegment>,
    /// The simulated world.
    #[serde(default)]
    pub simulator: Simulator,
    /// A corridor with a planned path, in place of `drive`; for the simulator. Default: none.
    pub navigation: Option<Navigation>,
    /// Monitors of the pose against the planned pose. Default: none; symptoms of the detector's own
    /// are then those of its pose track.
    pub monitors: Option<Monitors>,
    /// The detection filter.
    #[serde(default)]
    pub detector: Detector,
    /// The identification filter.
    #[serde(default)]
    pub identifier: Identifier,
    /// The decision system.
    #[serde(default)]
    pub supervisor: Supervisor,
    /// Control commands at run time.
    #[serde(default)]
    pub control: Control,
    /// What the launcher does when a service dies.
    #[serde(default)]
    pub restart: Restart,
    /// When the launcher takes a service that lives for failed.
    #[serde(default)]
    pub watchdog: Watchdog,
}

/// Identity of the graph and its schedule.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Graph {
    /// Name; two graphs with one name cannot run on one machine. Letters, digits, `-`, at most 24.
    pub name: String,
    /// Rate of the sensor's schedule, Hz, 1 to 10000. A playback has the recording's own instead.
    pub rate_hz: f64,
    /// Seed from which every generator starts.
    #[serde(default = "one")]
    pub seed: u64,
}

/// The models that the graph runs on; paths relative to the graph file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Files {
    /// Description of the robot (TOML).
    pub robot: String,
    /// Fault tree (TOML).
    pub tree: String,
    /// Learned transition models (TOML, written by `vigil learn`).
    pub model: String,
    /// Decision model (`.pomdp`).
    pub decision: String,
}

/// Placement and deadlines, one table per service.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Services {
    /// The sensor source.
    #[serde(rename = "sensor-sim")]
    pub sensor_sim: Service,
    /// The detector.
    pub detector: Service,
    /// The identifier.
    pub identifier: Service,
    /// The supervisor.
    pub supervisor: Service,
}

/// Placement and deadline of one service.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Service {
    /// Core to pin to. Several services may name one core; every report says so.
    pub core: usize,
    /// `SCHED_FIFO` priority, 1 to 90, used where permitted; 0 for `SCHED_OTHER`.
    #[serde(default = "fifty")]
    pub priority: u8,
    /// Deadline after the scheduled instant, as a percentage of the period, 1 to 100. Stagger
    /// consecutive stages: each must leave time to the next.
    pub deadline_percent: f64,
    /// Compute budget of one cycle, as a percentage of the period, 1 to 100, default 80; no more
    /// than the deadline, if that is shorter. An identifier that nears it works with fewer
    /// hypotheses or particles until there is room again.
    #[serde(default = "eighty")]
    pub budget_percent: f64,
    /// What follows a missed deadline, which is always counted: `count` nothing; `predict` (the
    /// default) publishes the prediction at once; `degrade` that, and the service calls itself
    /// degraded until 100 cycles in a row are in time; `stop` ends the graph, and so the robot.
    #[serde(default)]
    pub on_miss: OnMiss,
    /// How long the service looks for its input without sleeping, about when it is due, us, 0 to a
    /// fifth of the period; default 0. Only for a service alone on its core.
    #[serde(default)]
    pub spin_us: f64,
}

/// Sizes of the shared-memory queues; the same for every peer.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Transport {
    /// Blocks a reader may fall behind before the oldest is overwritten, 2 to 256; of sensor frames
    /// eight times as many.
    pub buffer: usize,
    /// Blocks kept for a reader that connects late, 0 to 8.
    pub history: usize,
    /// Readers of one topic, observers included, 4 to 32.
    pub max_subscribers: usize,
}

impl Default for Transport {
    fn default() -> Self {
        Self {
            buffer: 16,
            history: 1,
            max_subscribers: 8,
        }
    }
}

/// One piece of the simulated drive.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveSegment {
    /// Duration, s, above 0.
    pub duration_s: f64,
    /// Signed curvature, 1/m (left positive), within the robot's limits.
    pub curvature_1_m: f64,
    /// Speed, m/s, within the robot's limits.
    pub speed_m_s: f64,
}

/// The simulated world.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Simulator {
    /// Friction coefficient of the soil, 0.1 to 2.
    pub friction: f64,
    /// Janosi shear modulus of the soil (relative slip), 0.02 to 2.
    pub shear_modulus: f64,
    /// Relative standard deviation of friction along the path, 0 to 0.5.
    pub friction_scatter: f64,
    /// Correlation length of that scatter, m, 0.01 to 10.
    pub scatter_length_m: f64,
    /// Time constant of the body's velocity, s, 0 to 1.
    pub lag_s: f64,
    /// Factor on the sensor noise of the robot's description, 0 to 10.
    pub noise_scale: f64,
}

impl Default for Simulator {
    fn default() -> Self {
        Self {
            friction: 0.65,
            shear_modulus: 0.20,
            friction_scatter: 0.08,
            scatter_length_m: 0.2,
            lag_s: 0.1,
            noise_scale: 1.0,
        }
    }
}

/// Control commands at run time.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Control {
    /// True to let `vigil inject` and `--inject` break the simulated rover. Default false.
    pub allow_injection: bool,
}

/// What the launcher does when a service dies.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Restart {
    /// Restarts of one service within `window_s` before it is given up, 0 to 100.
    pub max_restarts: u32,
    /// See `max_restarts`; s, 1 to 3600.
    pub window_s: f64,
    /// Delay before the first restart, ms, doubled at each further one, 0 to 10000.
    pub delay_ms: f64,
}

impl Default for Restart {
    fn default() -> Self {
        Self {
            max_restarts: 3,
            window_s: 60.0,
            delay_ms: 20.0,
        }
    }
}

/// When the launcher takes a service that lives for failed. It then ends and restarts it, within
/// the bounds of `[restart]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Watchdog {
    /// Time that all services may take until the first action comes back, and a restarted one until
    /// it cycles, s, 0.1 to 600.
    pub startup_s: f64,
    /// Longest silence of a service that cycles (a healthy one reports 20 times a second), s, 0.3
    /// to 60; 0 switches this supervision off.
    pub alive_s: f64,
    /// Longest time for which a service may publish without following its input, while that moves
    /// on, s, 0.2 to 60; 0 switches this supervision off.
    pub logical_s: f64,
    /// Share of the deadlines of one second whose miss is reported as failed, %, 1 to 100; nothing
    /// is restarted for it, as that would cost more deadlines. 0 switches this supervision off.
    pub deadline_percent: f64,
}

impl Default for Watchdog {
    fn default() -> Self {
        Self {
            startup_s: 20.0,
            alive_s: 2.0,
            logical_s: 2.0,
            deadline_percent: 50.0,
        }
    }
}

/// A fault tree file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TreeFile {
    /// Nodes; the first is the nominal mode, parents come before their children.
    pub node: Vec<TreeNode>,
}

/// One node of a fault tree file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TreeNode {
    /// Name, as reported.
    pub name: String,
    /// Name of the parent; none for children of the root.
    pub parent: Option<String>,
    /// For a leaf: `stuck:WHEEL`, `encoder:WHEEL`, `steer:WHEEL`, `torque:WHEEL`, `current:WHEEL`,
    /// `gyro` or `pose`.
    pub fault: Option<String>,
}

const fn one() -> u64 {
    1
}

const fn fifty() -> u8 {
    50
}

const fn eighty() -> f64 {
    80.0
}
