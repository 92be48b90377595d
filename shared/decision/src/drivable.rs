//! Sets of faults with which a robot can be driven home.
//!
//! Counter-steering is learned for one stuck wheel each. Two on different sides pull against each
//! other: what is steered against each adds up, nearly. Two on one side turn the robot about them:
//! nothing steers against that. A wheel that is on no side counts as one on the right.

use vigil_robot::Description;

use crate::mapping::Compensation;
use crate::states::{Leaf, LeafKind};

/// Which sets of leaves an action that limps home can answer.
/// None by default.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct DrivableSets {
    /// Leaves of encoders, and of stuck wheels on the right and on the left, as bits.
    encoders: u64,
    stuck: [u64; 2],
}

impl DrivableSets {
    /// Those of a robot's leaves that can be steered against or ignored.
    pub(crate) fn new(leaves: &[Leaf], robot: &Description, compensation: &[Compensation]) -> Self {
        let mut sets = Self::default();
        for leaf in leaves {
            let Some(wheel) = leaf.wheel else {
                continue;
            };
            let bit = 1 << leaf.node;
            match leaf.kind {
                LeafKind::Encoder => sets.encoders |= bit,
                LeafKind::Stuck if compensation.iter().any(|it| it.wheel == wheel) => {
                    let is_left = robot.wheels.get(wheel).is_some_and(|it| it.y > 0.0);
                    sets.stuck[usize::from(is_left)] |= bit;
                }
                LeafKind::Stuck | LeafKind::Other => {}
            }
        }
        sets
    }

    /// True if a robot with two of these faults or more, and no other, can be driven home.
    pub(crate) fn holds(&self, set: u64) -> bool {
        let [right, left] = self.stuck;
        set.count_ones() > 1
            && set & !(self.encoders | right | left) == 0
            && self.stuck.iter().all(|side| (set & side).count_ones() <= 1)
    }
}
