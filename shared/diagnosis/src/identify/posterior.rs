//! What is believed about the faults, in the words of the fault tree.

use vigil_blocks::{FAULT_NODES, FAULT_SETS, FaultBelief, FaultSet, MODE_MULTIPLE, MODE_UNKNOWN};

use crate::identify::modes::Leaves;
use crate::identify::sets::{entropy, rank};

/// Probabilities of nodes, sets of leaves and the unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Posterior {
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

impl Posterior {
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
    pub fn add(&mut self, set: FaultSet, leaves: &Leaves) {
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
    pub fn divided(mut self, leaves: &Leaves, prior_unknown: f64) -> Self {
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
    pub fn predicted(&self, leaves: &Leaves, prior_unknown: f64, birth: f64, death: f64) -> Self {
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
    pub fn write(&self, leaves: &Leaves, belief: &mut FaultBelief) {
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
    pub fn mode(&self, leaves: &Leaves) -> (u32, f64) {
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
