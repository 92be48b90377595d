//! A graph file: the rooms' settings, composed into its sections.
//!
//! A graph file (`config/rover.toml`) holds one [`GraphFile`]; it names the robot, the fault
//! tree, the learned model and the decision model, each a file of its own. Paths are relative to
//! the graph file. Unknown keys are errors. Each room on the robot declares the settings that it
//! obeys; those of the services, which no room here may see, stand in this module.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use vigil_cycle::domain::Queues;
use vigil_cycle::{Domain, PortError, service, watchdog};
use vigil_diagnosis::{detect, identify};

mod blackbox;
mod navigation;
mod sensor;
mod simulator;

pub use blackbox::Blackbox;
pub use navigation::{Navigation, Obstacle, Trouble, TroubleKind};
pub use sensor::{Sensor, Socket, Source};
pub use simulator::{DriveSegment, Simulator};

/// The configuration of a graph. Keys end in their unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GraphFile {
    /// Identity of the graph and its schedule.
    pub graph: GraphSettings,
    /// The models that the graph runs on; paths relative to the graph file.
    pub files: Files,
    /// Placement and deadlines, one table per service.
    pub services: Services,
    /// Sizes of the shared-memory queues; the same for every peer.
    #[serde(default)]
    pub transport: Queues,
    /// Where sensor frames come from.
    #[serde(default)]
    pub sensor: Sensor,
    /// What the simulated rover drives: segments, repeated for ever.
    #[serde(default)]
    pub drive: Vec<DriveSegment>,
    /// The simulated world.
    #[serde(default)]
    pub simulator: Simulator,
    /// A corridor with a planned path, in place of `drive`; for the simulator. Coordinates are
    /// those of the robot's start: it stands at the origin, looking along x; y points to the
    /// left. Times count from the first action that the robot obeys.
    pub navigation: Option<Navigation>,
    /// Monitors of the pose against the planned pose. Without them the detector's symptoms come
    /// from its pose track.
    pub monitors: Option<detect::MonitorSettings>,
    /// The detection filter.
    #[serde(default)]
    pub detector: detect::Settings,
    /// The identification filter.
    #[serde(default)]
    pub identifier: identify::Settings,
    /// The decision system.
    #[serde(default)]
    pub supervisor: vigil_decision::Settings,
    /// The life of faults.
    #[serde(default)]
    pub faults: vigil_decision::FaultLifeSettings,
    /// Control commands at run time.
    #[serde(default)]
    pub control: ControlSettings,
    /// What the launcher does when a service dies.
    #[serde(default)]
    pub restart: Restart,
    /// When the launcher takes a service that lives for failed. It then ends and restarts it,
    /// within the bounds of `[restart]`.
    #[serde(default)]
    pub watchdog: watchdog::Settings,
    /// The black box: how much it keeps, and when it writes a recording.
    #[serde(default)]
    pub blackbox: Blackbox,
}

/// Identity of the graph and its schedule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GraphSettings {
    /// Name; two graphs with one name cannot run on one machine. Letters, digits, `-`, at most 22.
    pub name: String,
    /// Rate of the sensor's schedule. A playback has the recording's own instead.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub rate_hz: f64,
    /// Seed from which every generator starts.
    #[serde(default = "GraphSettings::seed")]
    pub seed: u64,
}

impl GraphFile {
    /// The graph's place on this machine.
    ///
    /// # Errors
    /// [`PortError::Setup`] when no runtime folder can be made.
    pub(crate) fn domain(&self) -> Result<Domain, PortError> {
        Domain::new(&self.graph.name, self.transport)
    }
}

impl GraphSettings {
    /// Default: any number would do.
    const fn seed() -> u64 {
        1
    }

    /// Period of the schedule, ns.
    pub(crate) fn period_ns(&self) -> u64 {
        (1e9 / self.rate_hz).round() as u64
    }
}

/// The models that the graph runs on; paths relative to the graph file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Services {
    /// The sensor source.
    #[serde(rename = "sensor-sim")]
    pub sensor_sim: service::Settings,
    /// The detector.
    pub detector: service::Settings,
    /// The identifier.
    pub identifier: service::Settings,
    /// The supervisor.
    pub supervisor: service::Settings,
}

/// Control commands at run time.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControlSettings {
    /// True to let `vigil inject` and `--inject` break the simulated rover.
    pub allow_injection: bool,
}

/// What the launcher does when a service dies.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Restart {
    /// Restarts of one service within `window_s` before it is given up.
    #[default(3)]
    #[schemars(range(min = 0, max = 100), extend("x-unit" = "restarts"))]
    pub max_restarts: u32,
    /// Window of `max_restarts`.
    #[default(60.0)]
    #[schemars(range(min = 1.0, max = 3600.0))]
    pub window_s: f64,
    /// Delay before the first restart, doubled at each further one.
    #[default(20.0)]
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub delay_ms: f64,
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
