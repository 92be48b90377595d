//! What an identifier is built from.

use vigil_pomdp::Pomdp;
use vigil_robot::learned::Model;
use vigil_robot::{Description, FaultTree};

/// The models that an identifier is built from.
#[derive(Debug, Clone, Copy)]
pub struct Models<'a> {
    /// How the robot behaves.
    pub model: &'a Model,
    /// The robot.
    pub robot: &'a Description,
    /// Its faults.
    pub tree: &'a FaultTree,
    /// What faults cost; only the risk-sensitive filter needs it.
    pub decision: Option<&'a Pomdp>,
}
