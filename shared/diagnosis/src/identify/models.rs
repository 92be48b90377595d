//! What an identifier is built from.

use vigil_robot::learned::Model;
use vigil_robot::{Description, FaultTree};

use crate::identify::risk::StateRisks;

/// The models that an identifier is built from.
#[derive(Debug, Clone, Copy)]
pub struct Models<'a> {
    /// How the robot behaves.
    pub model: &'a Model,
    /// The robot.
    pub robot: &'a Description,
    /// Its faults.
    pub tree: &'a FaultTree,
    /// What it costs to lose track of a fault; only the risk-sensitive filter needs it.
    pub risks: Option<&'a StateRisks>,
}
