//! The reported fault: the memoryless name, `mode`, with hysteresis.

use vigil_blocks::{MODE_MULTIPLE, MODE_UNKNOWN};
use vigil_checkpoint::CheckpointValue;
use vigil_robot::fused_alarm;

use crate::identify::leaf_map::LeafMap;
use crate::identify::tree_belief::TreeBelief;

/// A held name is given up for another one when its own probability is below this. Chosen by hand:
/// a rival needs half; with 0.2 left to a third, two equal ones do not swap. Smaller holds a wrong
/// name longer, larger lets names alternate.
const HELD_MIN: f64 = 0.3;
/// Slack when the nominal time is compared, s: it is a sum of short intervals, each rounded.
const SLACK_S: f64 = 1e-6;

/// The name that is held: index of a node, [`MODE_UNKNOWN`] or [`MODE_MULTIPLE`].
#[derive(Debug, Clone, Copy, Default, PartialEq, CheckpointValue)]
pub struct ReportedFault {
    held: u32,
    changes: u32,
    nominal_s: f64,
}

impl ReportedFault {
    /// The held name.
    #[must_use]
    pub const fn name(&self) -> u32 {
        self.held
    }

    /// How often it has changed.
    #[must_use]
    pub const fn changes(&self) -> u32 {
        self.changes
    }

    /// A new run: nominal.
    pub const fn begin_run(&mut self) {
        self.set(0);
        self.nominal_s = 0.0;
    }

    /// Takes the memoryless `mode` and its probability, of the belief that holds after `moved_s` of
    /// motion.
    pub fn take(
        &mut self,
        mode: u32,
        p_mode: f64,
        belief: &TreeBelief,
        leaves: &LeafMap,
        moved_s: f64,
    ) {
        // As the alarm falls: the two contradict each other for no longer.
        let is_nominal = mode == 0 && p_mode > fused_alarm::NOMINAL;
        self.nominal_s = if is_nominal {
            self.nominal_s + moved_s
        } else {
            0.0
        };
        let gives_way = if mode == 0 {
            self.nominal_s >= fused_alarm::NOMINAL_S - SLACK_S
        } else {
            // What holds with the held name is no rival of it, but says more.
            let implied = if self.is_implied_by(mode, leaves) {
                p_mode
            } else {
                0.0
            };
            p_mode > 0.5 && self.p_held(belief) - implied < HELD_MIN
        };
        if gives_way {
            self.set(mode);
        }
    }

    const fn set(&mut self, mode: u32) {
        if self.held != mode {
            self.held = mode;
            self.changes = self.changes.saturating_add(1);
        }
    }

    /// True if the held name is a node and `mode` says more: several faults, or a node below it.
    fn is_implied_by(&self, mode: u32, leaves: &LeafMap) -> bool {
        let below = |node: u32| leaves.below.get(node as usize).copied().unwrap_or(0);
        let (held, finer) = (below(self.held), below(mode));
        let is_node = self.held != 0 && held != 0;
        is_node && (mode == MODE_MULTIPLE || finer != 0 && finer & !held == 0)
    }

    /// Probability of what is held.
    fn p_held(&self, belief: &TreeBelief) -> f64 {
        match self.held {
            MODE_UNKNOWN => belief.unknown,
            MODE_MULTIPLE => {
                let sets = belief.sets.iter().take(belief.set_count);
                let several = sets.filter(|set| set.leaves.count_ones() > 1);
                several.map(|set| set.p).sum()
            }
            node => belief.nodes.get(node as usize).copied().unwrap_or(0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::{FAULT_NODES, FaultSet};

    /// Leaves 3 and 4, both below node 2.
    fn leaves() -> LeafMap {
        let mut below = [0; FAULT_NODES];
        (below[3], below[4], below[2]) = (1 << 3, 1 << 4, 1 << 3 | 1 << 4);
        LeafMap {
            count: 2,
            below,
            nodes: 5,
            ..LeafMap::none()
        }
    }

    fn belief(nominal: f64, leaf: f64, unknown: f64) -> TreeBelief {
        let mut belief = TreeBelief::nominal();
        (belief.nodes[0], belief.nodes[3], belief.unknown) = (nominal, leaf, unknown);
        belief
    }

    #[test]
    fn a_name_is_held_until_another_one_is_clear_or_the_robot_is_nominal_for_a_second() {
        let (mut reported, leaves) = (ReportedFault::default(), leaves());
        reported.take(3, 0.69, &belief(0.31, 0.69, 0.0), &leaves, 0.05);
        assert_eq!(reported.name(), 0, "the nominal mode is above .3");
        reported.take(3, 0.8, &belief(0.2, 0.8, 0.0), &leaves, 0.05);
        assert_eq!(reported.name(), 3);
        reported.take(MODE_UNKNOWN, 0.6, &belief(0.0, 0.4, 0.6), &leaves, 0.05);
        assert_eq!(reported.name(), 3, "the leaf is above .3");
        reported.take(MODE_UNKNOWN, 0.8, &belief(0.0, 0.2, 0.8), &leaves, 0.05);
        assert_eq!((reported.name(), reported.changes()), (MODE_UNKNOWN, 2));
        for _ in 0..9 {
            reported.take(0, 0.55, &belief(0.55, 0.0, 0.45), &leaves, 0.1);
        }
        // A moment of doubt begins the second anew; time at rest does not count.
        reported.take(MODE_UNKNOWN, 0.55, &belief(0.45, 0.0, 0.55), &leaves, 0.1);
        for _ in 0..9 {
            reported.take(0, 0.55, &belief(0.55, 0.0, 0.45), &leaves, 0.1);
            reported.take(0, 0.55, &belief(0.55, 0.0, 0.45), &leaves, 0.0);
        }
        assert_eq!(reported.name(), MODE_UNKNOWN);
        reported.take(0, 0.55, &belief(0.55, 0.0, 0.45), &leaves, 0.1);
        assert_eq!((reported.name(), reported.changes()), (0, 3));
    }

    #[test]
    fn what_holds_with_the_held_name_takes_its_place() {
        let (mut reported, leaves) = (ReportedFault::default(), leaves());
        let mut belief = belief(0.0, 0.9, 0.0);
        belief.nodes[2] = 0.99;
        reported.take(2, 0.99, &belief, &leaves, 0.05);
        assert_eq!(reported.name(), 2);
        // A leaf below the held side.
        reported.take(3, 0.9, &belief, &leaves, 0.05);
        assert_eq!(reported.name(), 3);
        // The same leaf and another one.
        belief.sets[0] = FaultSet {
            leaves: 1 << 3 | 1 << 4,
            p: 0.85,
        };
        belief.set_count = 1;
        reported.take(MODE_MULTIPLE, 0.85, &belief, &leaves, 0.05);
        assert_eq!(reported.name(), MODE_MULTIPLE);
    }

    #[test]
    fn a_new_run_is_nominal_and_begins_the_second_anew() {
        let (mut reported, leaves) = (ReportedFault::default(), leaves());
        reported.take(3, 0.8, &belief(0.2, 0.8, 0.0), &leaves, 0.05);
        reported.begin_run();
        assert_eq!((reported.name(), reported.changes()), (0, 2));
        reported.begin_run();
        assert_eq!(reported.changes(), 2);
    }

    #[test]
    fn what_several_faults_hold_is_the_sum_of_their_sets() {
        let (mut reported, leaves) = (ReportedFault::default(), leaves());
        let mut several = belief(0.0, 0.9, 0.0);
        let both = 1 << 3 | 1 << 4;
        several.sets[0] = FaultSet {
            leaves: both,
            p: 0.6,
        };
        several.set_count = 1;
        reported.take(MODE_MULTIPLE, 0.6, &several, &leaves, 0.05);
        assert_eq!(reported.name(), MODE_MULTIPLE);
        // .35 of several faults holds the name against a single one, .25 does not.
        several.sets[0].p = 0.35;
        reported.take(3, 0.6, &several, &leaves, 0.05);
        assert_eq!(reported.name(), MODE_MULTIPLE);
        several.sets[0].p = 0.25;
        reported.take(3, 0.6, &several, &leaves, 0.05);
        assert_eq!(reported.name(), 3);
    }
}
