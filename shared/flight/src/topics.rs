//! The topics on which messages of ROS 2 stand: in recordings and, by the same names, live.

use crate::definitions::{
    DIAGNOSTIC_ARRAY, Definition, JOINT_STATE, LOG, ODOMETRY, STRING, TF_MESSAGE,
};

/// A topic with messages of one type.
#[derive(Debug, PartialEq, Eq)]
pub struct RosTopic {
    /// Its name: `/vigil/belief`.
    pub name: &'static str,
    /// What it tells about.
    pub subject: Subject,
    /// True if it has a message for each cycle of the graph.
    pub is_of_each_cycle: bool,
    pub(crate) definition: &'static Definition,
}

/// What a topic tells about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// What the graph believes, decides and knows.
    Verdict,
    /// What the robot measures and is told, which it often publishes itself; and the truth of a
    /// simulated one.
    Robot,
}

impl RosTopic {
    /// Every topic.
    pub const ALL: [&'static Self; 14] = [
        &DIAGNOSTICS,
        &FAULTS,
        &HEALTH,
        &EVENTS,
        &BELIEF,
        &DETECTION,
        &DECISION,
        &ACTION,
        &JOINT_STATES,
        &ODOM,
        &TF,
        &CHANNELS,
        &COMMAND,
        &TRUTH,
    ];

    /// The type of its messages, with its package: `sensor_msgs/msg/JointState`.
    #[must_use]
    pub const fn type_name(&self) -> &'static str {
        self.definition.name
    }
}

const fn verdict(name: &'static str, definition: &'static Definition) -> RosTopic {
    RosTopic {
        name,
        subject: Subject::Verdict,
        is_of_each_cycle: false,
        definition,
    }
}

const fn of_each_cycle(topic: RosTopic) -> RosTopic {
    RosTopic {
        is_of_each_cycle: true,
        ..topic
    }
}

const fn of_the_robot(name: &'static str, definition: &'static Definition) -> RosTopic {
    RosTopic {
        subject: Subject::Robot,
        ..of_each_cycle(verdict(name, definition))
    }
}

pub(crate) static DIAGNOSTICS: RosTopic = verdict("/diagnostics", &DIAGNOSTIC_ARRAY);
pub(crate) static FAULTS: RosTopic = verdict("/vigil/faults", &DIAGNOSTIC_ARRAY);
pub(crate) static HEALTH: RosTopic = verdict("/vigil/health", &DIAGNOSTIC_ARRAY);
pub(crate) static EVENTS: RosTopic = verdict("/vigil/events", &LOG);
pub(crate) static ACTION: RosTopic = verdict("/vigil/action", &STRING);
pub(crate) static BELIEF: RosTopic = of_each_cycle(verdict("/vigil/belief", &JOINT_STATE));
pub(crate) static DETECTION: RosTopic = of_each_cycle(verdict("/vigil/detection", &JOINT_STATE));
pub(crate) static DECISION: RosTopic = of_each_cycle(verdict("/vigil/decision", &JOINT_STATE));
pub(crate) static JOINT_STATES: RosTopic = of_the_robot("/joint_states", &JOINT_STATE);
pub(crate) static ODOM: RosTopic = of_the_robot("/odom", &ODOMETRY);
pub(crate) static TF: RosTopic = of_the_robot("/tf", &TF_MESSAGE);
pub(crate) static CHANNELS: RosTopic = of_the_robot("/vigil/channels", &JOINT_STATE);
pub(crate) static COMMAND: RosTopic = of_the_robot("/vigil/command", &JOINT_STATE);
pub(crate) static TRUTH: RosTopic = of_the_robot("/vigil/truth", &ODOMETRY);
