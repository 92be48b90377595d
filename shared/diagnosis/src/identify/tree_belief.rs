//! What is believed about the faults, in the words of the fault tree.

use vigil_blocks::{FAULT_NODES, FAULT_SETS, FaultBelief, FaultSet, MODE_MULTIPLE, MODE_UNKNOWN};
use vigil_checkpoint::CheckpointValue;

use crate::identify::leaf_map::LeafMap;

/// Of a less probable fault no size is reported: at 1 %, the odds of an encoder that a stuck wheel
/// masks (`an_hour` tests them), a size is noise.
pub const SIZE_P_MIN: f64 = 0.01;

/// Probabilities of nodes, sets of leaves and the unknown.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct TreeBelief {
    /// Of the nominal mode, of each leaf's fault (alone or with others), and of any fault below
    /// each abstract node.
    pub nodes: [f64; FAULT_NODES],
    /// No modelled fault explains the data.
    pub unknown: f64,
    /// The most probable sets of leaves, in falling order; the empty set is the nominal mode.
    pub sets: [FaultSet; FAULT_SETS],
    /// Sets in use.
    pub set_count: usize,
    /// Entropy over sets and unknown, nat.
    pub entropy: f64,
}

impl TreeBelief {
    /// Nothing is wrong.
    #[must_use]
    pub fn nominal() -> Self {
        let mut out = Self {
            nodes: [0.0; FAULT_NODES],
            unknown: 0.0,
            sets: [FaultSet::default(); FAULT_SETS],
            set_count: 1,
            entropy: 0.0,
        };
        out.nodes[0] = 1.0;
        out.sets[0].p = 1.0;
        out
    }

    /// Nothing is believed: sets are to be added.
    pub fn clear(&mut self) {
        *self = Self::nominal();
        self.nodes[0] = 0.0;
        self.sets[0].p = 0.0;
        self.set_count = 0;
    }

    /// Adds a set of leaves and its probability.
    pub fn add(&mut self, set: FaultSet, leaves: &LeafMap) {
        self.entropy += entropy(set.p);
        rank(&mut self.sets, &mut self.set_count, set);
        if set.leaves == 0 {
            self.nodes[0] += set.p;
            return;
        }
        for node in 1..leaves.nodes {
            if leaves.below[node] & set.leaves != 0 {
                self.nodes[node] = (self.nodes[node] + set.p).min(1.0);
            }
        }
    }

    /// Before an identification: what is not nominal is unknown.
    #[must_use]
    pub fn watching(p_fault: f64) -> Self {
        let p_fault = if p_fault.is_nan() {
            0.0
        } else {
            p_fault.clamp(0.0, 1.0)
        };
        let mut out = Self::nominal();
        out.nodes[0] = 1.0 - p_fault;
        out.sets[0].p = out.nodes[0];
        out.unknown = p_fault;
        out.entropy = entropy(out.nodes[0]) + entropy(p_fault);
        out
    }

    /// The unknown divided among the leaves and itself by their priors.
    #[must_use]
    pub fn divided(mut self, leaves: &LeafMap, prior_unknown: f64) -> Self {
        let fault = self.unknown;
        for node in 1..leaves.nodes {
            self.nodes[node] += fault * leaves.share(node, prior_unknown);
        }
        self.unknown = fault * prior_unknown;
        self
    }

    /// Nodes and unknown after `birth` of the mass without a fault went to it by its prior, and
    /// `death` of each fault's mass lost it.
    #[must_use]
    pub fn predicted(&self, leaves: &LeafMap, prior_unknown: f64, birth: f64, death: f64) -> Self {
        let mut out = *self;
        let nominal = self.nodes[0];
        for node in 1..leaves.nodes {
            let p = self.nodes[node];
            let without = (1.0 - p - self.unknown).max(0.0);
            let born = without * birth * leaves.share(node, prior_unknown);
            out.nodes[node] = p * (1.0 - death) + born;
        }
        out.unknown = self.unknown * (1.0 - death) + nominal * birth * prior_unknown;
        out.nodes[0] = nominal * (1.0 - birth) + (1.0 - nominal) * death;
        out
    }

    /// Writes probabilities, sets and entropy.
    pub fn write(&self, leaves: &LeafMap, belief: &mut FaultBelief) {
        belief.p = self.nodes;
        belief.p_unknown = self.unknown;
        belief.node_count = leaves.nodes as u32;
        belief.tree_hash = leaves.hash;
        belief.entropy = self.entropy;
        belief.sets = self.sets;
        belief.set_count = self.set_count as u32;
    }

    /// The mode and its probability: unknown above one half, else several faults if a set of them
    /// has one half, else the deepest node of at least one half, else unknown if some fault is more
    /// probable than none, else nominal.
    #[must_use]
    pub fn mode(&self, leaves: &LeafMap) -> (u32, f64) {
        if self.unknown > 0.5 {
            return (MODE_UNKNOWN, self.unknown);
        }
        let best = &self.sets[0];
        if best.leaves.count_ones() >= 2 && best.p >= 0.5 {
            return (MODE_MULTIPLE, best.p);
        }
        let p = &self.nodes;
        let mut best = None;
        for node in (0..leaves.nodes).filter(|&node| p[node] >= 0.5) {
            let better =
                |&other: &usize| (leaves.depths[node], p[node]) > (leaves.depths[other], p[other]);
            if best.as_ref().is_none_or(better) {
                best = Some(node);
            }
        }
        match best {
            Some(node) => (node as u32, p[node]),
            None if p[0] < 0.5 => (MODE_UNKNOWN, 1.0 - p[0]),
            None => (0, p[0]),
        }
    }
}

/// `-p ln p`; 0 for 0.
pub fn entropy(p: f64) -> f64 {
    if p > 0.0 { -p * p.ln() } else { 0.0 }
}

/// Puts a set among the most probable ones.
fn rank(sets: &mut [FaultSet; FAULT_SETS], count: &mut usize, set: FaultSet) {
    let place = sets[..*count].iter().position(|other| other.p < set.p);
    let place = place.unwrap_or(*count);
    if place < FAULT_SETS {
        *count = (*count + 1).min(FAULT_SETS);
        sets[place..*count].rotate_right(1);
        sets[place] = set;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Leaves 2 and 3, both below the abstract node 1.
    fn leaves() -> LeafMap {
        let mut leaves = LeafMap::none();
        (leaves.nodes, leaves.count) = (4, 2);
        leaves.below[1] = 0b1100;
        (leaves.below[2], leaves.below[3]) = (0b100, 0b1000);
        (leaves.depths[1], leaves.depths[2], leaves.depths[3]) = (1, 2, 2);
        (leaves.stuck[0], leaves.stuck[1]) = (Some(2), Some(3));
        leaves
    }

    fn is(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
    }

    fn belief(sets: &[(u64, f64)], unknown: f64) -> TreeBelief {
        let mut out = TreeBelief::nominal();
        out.clear();
        for &(set, p) in sets {
            out.add(FaultSet { leaves: set, p }, &leaves());
        }
        out.unknown = unknown;
        out
    }

    #[test]
    fn a_set_counts_in_each_node_above_its_leaves_once() {
        let out = belief(&[(0, 0.4), (0b100, 0.3), (0b1100, 0.2)], 0.1);
        for (node, p) in [0.4, 0.5, 0.5, 0.2].into_iter().enumerate() {
            is(out.nodes[node], p);
        }
        let expected = -[0.4_f64, 0.3, 0.2].map(|p| p * p.ln()).iter().sum::<f64>();
        is(out.entropy, expected);
        let sets: Vec<u64> = out.sets[..out.set_count].iter().map(|s| s.leaves).collect();
        assert_eq!(sets, [0, 0b100, 0b1100]);
    }

    #[test]
    fn before_an_identification_a_fault_is_unknown() {
        let out = TreeBelief::watching(0.25);
        assert_eq!(
            (out.nodes[0], out.unknown, out.sets[0].p),
            (0.75, 0.25, 0.75)
        );
        is(out.entropy, -0.75 * 0.75_f64.ln() - 0.25 * 0.25_f64.ln());
        for (p_fault, unknown) in [(f64::NAN, 0.0), (-1.0, 0.0), (7.0, 1.0)] {
            assert_eq!(TreeBelief::watching(p_fault).unknown, unknown);
        }
    }

    #[test]
    fn the_unknown_is_divided_by_the_priors() {
        let out = TreeBelief::watching(0.5).divided(&leaves(), 0.2);
        for (node, p) in [0.5, 0.4, 0.2, 0.2].into_iter().enumerate() {
            is(out.nodes[node], p);
        }
        is(out.unknown, 0.1);
    }

    #[test]
    fn faults_are_born_and_mend_by_their_priors() {
        let before = belief(&[(0, 0.6), (0b100, 0.3)], 0.1);
        let after = before.predicted(&leaves(), 0.2, 0.1, 0.05);
        // Each leaf has a share of 0.4 of the births, of what is neither its nor unknown.
        is(after.nodes[2], 0.3 * 0.95 + (1.0 - 0.3 - 0.1) * 0.1 * 0.4);
        is(after.nodes[3], (1.0 - 0.1) * 0.1 * 0.4);
        is(after.nodes[1], 0.3 * 0.95 + (1.0 - 0.3 - 0.1) * 0.1 * 0.8);
        is(after.unknown, 0.1 * 0.95 + 0.6 * 0.1 * 0.2);
        is(after.nodes[0], 0.6 * 0.9 + 0.4 * 0.05);
    }

    #[test]
    fn the_mode_is_the_deepest_node_of_one_half() {
        let cases = [
            (belief(&[(0, 1.0)], 0.0), (0, 1.0)),
            (belief(&[(0, 0.49)], 0.51), (MODE_UNKNOWN, 0.51)),
            (belief(&[(0, 0.5)], 0.5), (0, 0.5)),
            (belief(&[(0b100, 0.5), (0, 0.5)], 0.0), (2, 0.5)),
            (
                belief(&[(0b1100, 0.5), (0b100, 0.5)], 0.0),
                (MODE_MULTIPLE, 0.5),
            ),
            (
                belief(&[(0b100, 0.4), (0b1000, 0.3), (0, 0.3)], 0.0),
                (1, 0.7),
            ),
            (
                belief(&[(0b1100, 0.4), (0b100, 0.3), (0, 0.3)], 0.0),
                (2, 0.7),
            ),
            (belief(&[(0, 0.4), (0b100, 0.3)], 0.3), (MODE_UNKNOWN, 0.6)),
        ];
        for (belief, (mode, p)) in cases {
            let found = belief.mode(&leaves());
            assert_eq!(found.0, mode, "{:?}", belief.sets);
            is(found.1, p);
        }
    }

    #[test]
    fn the_block_holds_the_belief() {
        let (before, mut block) = (
            belief(&[(0b100, 0.7), (0, 0.2)], 0.1),
            FaultBelief::default(),
        );
        let leaves = LeafMap {
            hash: 77,
            ..leaves()
        };
        before.write(&leaves, &mut block);
        assert_eq!((block.p, block.p_unknown), (before.nodes, 0.1));
        assert_eq!((block.sets, block.set_count), (before.sets, 2));
        assert_eq!((block.node_count, block.tree_hash), (4, 77));
        assert_eq!(block.entropy, before.entropy);
    }

    #[test]
    fn the_most_probable_sets_are_ranked_and_the_others_go() {
        let mut sets = [FaultSet::default(); FAULT_SETS];
        let mut count = 0;
        for leaves in 1..=FAULT_SETS as u64 + 2 {
            let p = if leaves % 2 == 0 { 1.0 } else { 0.5 } / leaves as f64;
            rank(&mut sets, &mut count, FaultSet { leaves, p });
            assert_eq!(count, FAULT_SETS.min(leaves as usize));
        }
        assert!(sets.is_sorted_by(|a, b| a.p >= b.p), "{sets:?}");
        // 1/2, 1/2 of 1, 1/4, 1/6 of 3 and 6, 1/8, 1/10 of 5 and 10: of equals the first first.
        let order: Vec<u64> = sets.iter().map(|set| set.leaves).collect();
        assert_eq!(order, [1, 2, 4, 3, 6, 8, 5, 10]);
    }

    #[test]
    fn entropy_is_that_of_one_alternative() {
        assert_eq!((entropy(0.0), entropy(1.0), entropy(-1.0)), (0.0, 0.0, 0.0));
        assert!((entropy(0.5) - 0.5 * std::f64::consts::LN_2).abs() < 1e-15);
    }
}
