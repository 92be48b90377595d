//! What is believed while sensors are silent, or the robot moves though it should stand: no filter
//! weighs that.

use vigil_blocks::{FaultSet, SizeKind};
use vigil_robot::learned::Troubles;

use crate::identify::leaf_map::LeafMap;
use crate::identify::node_sizes::NodeSizes;
use crate::identify::tree_belief::{TreeBelief, entropy};

/// Probability that something is wrong: what is seen needs no filter, and nothing is certain.
/// Chosen: above every threshold that acts, and finite as log-odds.
const TROUBLE: f64 = 1.0 - 1e-6;
/// Share of that which is the pose's where it walks while the wheels stand: a robot that slides or
/// is pushed reads alike, and is rarer. Chosen: below a half the pose would have no name; near one
/// nothing else would be considered.
const WALKS: f64 = 0.7;

/// Belief, and in which way what is named is broken. The pose is named if it is silent or frozen,
/// and doubted if it walks while the wheels that are read stand.
pub fn believed(
    troubles: &Troubles,
    use_wheels: bool,
    leaves: &LeafMap,
) -> (TreeBelief, NodeSizes) {
    let is_wheels = use_wheels && (troubles.wheels_silent != 0 || troubles.wheels_turn);
    let share = match troubles.pose_moves {
        _ if is_wheels => 0.0,
        true if use_wheels && troubles.wheels_stand => WALKS,
        true => 0.0,
        false => 1.0,
    };
    let mut sizes = NodeSizes::default();
    let Some(pose) = leaves.pose.filter(|_| share > 0.0) else {
        return (TreeBelief::watching(TROUBLE), sizes);
    };
    if troubles.pose_frozen {
        sizes.set_kind(pose, SizeKind::Frozen);
    }
    let mut posterior = TreeBelief::nominal();
    posterior.clear();
    for (set, p) in [(1 << pose, share * TROUBLE), (0, 1.0 - TROUBLE)] {
        posterior.add(FaultSet { leaves: set, p }, leaves);
    }
    posterior.unknown = (1.0 - share) * TROUBLE;
    posterior.entropy += entropy(posterior.unknown);
    (posterior, sizes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Leaf 1, the pose.
    fn leaves() -> LeafMap {
        let mut leaves = LeafMap::none();
        (leaves.pose, leaves.nodes, leaves.below[1]) = (Some(1), 2, 1 << 1);
        leaves
    }

    #[test]
    fn the_pose_is_named_where_it_alone_is_to_blame() {
        let silent = Troubles {
            pose_silent: true,
            ..Troubles::default()
        };
        let walks = Troubles {
            pose_moves: true,
            wheels_stand: true,
            ..Troubles::default()
        };
        let unread = Troubles {
            wheels_stand: false,
            ..walks
        };
        let turns = Troubles {
            wheels_turn: true,
            ..unread
        };
        let both = Troubles {
            wheels_silent: 1,
            ..silent
        };
        for (troubles, use_wheels, pose) in [
            (silent, true, TROUBLE),
            (silent, false, TROUBLE),
            (both, true, 0.0),
            (walks, true, WALKS * TROUBLE),
            (walks, false, 0.0),
            (unread, true, 0.0),
            (turns, true, 0.0),
        ] {
            let (posterior, _) = believed(&troubles, use_wheels, &leaves());
            assert_eq!(posterior.nodes[1], pose, "{troubles:?}");
            let sum = posterior.nodes[0] + posterior.nodes[1] + posterior.unknown;
            assert!((sum - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_frozen_pose_is_told_as_such() {
        let frozen = Troubles {
            pose_frozen: true,
            ..Troubles::default()
        };
        let (_, sizes) = believed(&frozen, true, &leaves());
        let mut belief = vigil_blocks::FaultBelief::default();
        sizes.write(&mut belief);
        assert_eq!(belief.size_kind[1], SizeKind::Frozen as u32);
    }
}
