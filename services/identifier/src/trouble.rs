//! What is believed while sensors are silent, or the robot moves though it should stand: no filter
//! weighs that.

use vigil_blocks::{FaultSet, SizeKind};
use vigil_robot::learned::Troubles;

use crate::modes::Leaves;
use crate::node_sizes::NodeSizes;
use crate::posterior::Posterior;

/// Probability that something is wrong.
const TROUBLE: f64 = 1.0 - 1e-6;

/// Belief, and in which way what is named is broken. The pose is named if it alone is to blame: it
/// is silent or frozen, or it walks while the wheels that are read stand.
pub fn believed(troubles: &Troubles, use_wheels: bool, leaves: &Leaves) -> (Posterior, NodeSizes) {
    let walks_alone = troubles.pose_moves && use_wheels && !troubles.wheels_turn;
    let moves = troubles.pose_moves || use_wheels && troubles.wheels_turn;
    let wheels_silent = use_wheels && troubles.wheels_silent != 0;
    let is_poses = !wheels_silent && (walks_alone || !moves);
    let mut sizes = NodeSizes::default();
    let Some(pose) = leaves.pose.filter(|_| is_poses) else {
        return (Posterior::watching(TROUBLE), sizes);
    };
    if troubles.pose_frozen {
        sizes.tell(pose, SizeKind::Frozen);
    }
    let mut posterior = Posterior::nominal();
    posterior.clear();
    for (set, p) in [(1 << pose, TROUBLE), (0, 1.0 - TROUBLE)] {
        posterior.add(FaultSet { leaves: set, p }, leaves);
    }
    (posterior, sizes)
}
