//! Probabilities of the modes, in the words of the fault tree.

use vigil_blocks::{FAULT_NODES, FAULT_SETS, FaultBelief, FaultSet, MODE_UNKNOWN};

use crate::modes::Leaves;

/// Probabilities of the nominal mode, every leaf and the unknown. They sum to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Posterior {
    /// By node: nominal and leaves only, abstract nodes are 0.
    pub nodes: [f64; FAULT_NODES],
    /// No modelled fault explains the data.
    pub unknown: f64,
}

/// No probability is reported smaller: what can return must not be impossible.
const FLOOR: f64 = 1e-12;

impl Posterior {
    /// Nothing is wrong.
    #[must_use]
    pub const fn nominal() -> Self {
        let mut nodes = [0.0; FAULT_NODES];
        nodes[0] = 1.0;
        Self {
            nodes,
            unknown: 0.0,
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
        out.unknown = p_fault;
        out
    }

    /// The unknown divided among the leaves and itself by their priors.
    #[must_use]
    pub fn divided(mut self, leaves: &Leaves, prior_unknown: f64) -> Self {
        let fault = self.unknown;
        let each = (1.0 - prior_unknown) / leaves.count.max(1) as f64;
        for node in leaves.stuck.iter().chain(&leaves.encoder).flatten() {
            self.nodes[*node] += fault * each;
        }
        self.unknown = fault * prior_unknown;
        self
    }

    /// After `birth` of the nominal mass went to the faults by their priors and `death` of each
    /// fault's returned.
    #[must_use]
    pub fn predicted(&self, leaves: &Leaves, prior_unknown: f64, birth: f64, death: f64) -> Self {
        let mut out = *self;
        let nominal = self.nodes[0];
        let each = (1.0 - prior_unknown) / leaves.count.max(1) as f64;
        for node in leaves.stuck.iter().chain(&leaves.encoder).flatten() {
            out.nodes[*node] = self.nodes[*node] * (1.0 - death) + nominal * birth * each;
        }
        out.unknown = self.unknown * (1.0 - death) + nominal * birth * prior_unknown;
        out.nodes[0] = nominal * (1.0 - birth) + (1.0 - nominal) * death;
        out
    }

    /// Keeps every mode possible and the sum 1.
    pub fn normalise(&mut self, leaves: &Leaves) {
        let named = leaves.stuck.iter().chain(&leaves.encoder).flatten();
        let mut sum = 0.0;
        for node in named.copied().chain([0]) {
            let p = &mut self.nodes[node];
            *p = if p.is_finite() { p.max(FLOOR) } else { FLOOR };
            sum += *p;
        }
        self.unknown = if self.unknown.is_finite() {
            self.unknown.max(FLOOR)
        } else {
            FLOOR
        };
        sum += self.unknown;
        self.unknown /= sum;
        self.nodes = self.nodes.map(|p| p / sum);
    }

    /// Nodes with the sums of their children.
    #[must_use]
    pub fn tree(&self, leaves: &Leaves) -> [f64; FAULT_NODES] {
        let mut out = self.nodes;
        // Parents come before their children.
        for i in (1..leaves.nodes).rev() {
            if let Some(parent) = leaves.parents[i] {
                out[parent] += out[i];
            }
        }
        out.map(|p| p.min(1.0))
    }

    /// Writes probabilities, sets and entropy.
    pub fn write(&self, leaves: &Leaves, belief: &mut FaultBelief) {
        belief.p = self.tree(leaves);
        belief.p_unknown = self.unknown;
        belief.node_count = leaves.nodes as u32;
        belief.tree_hash = leaves.hash;
        let term = |p: f64| if p > 0.0 { -p * p.ln() } else { 0.0 };
        belief.entropy = self.nodes[..leaves.nodes]
            .iter()
            .map(|&p| term(p))
            .sum::<f64>()
            + term(self.unknown);
        belief.sets = [FaultSet::default(); FAULT_SETS];
        let mut count = 0;
        for node in 0..leaves.nodes {
            let is_set = node == 0
                || leaves
                    .stuck
                    .iter()
                    .chain(&leaves.encoder)
                    .any(|&n| n == Some(node));
            if !is_set {
                continue;
            }
            let set = FaultSet {
                leaves: if node == 0 { 0 } else { 1 << node },
                p: self.nodes[node],
            };
            let place = belief.sets[..count]
                .iter()
                .position(|other| other.p < set.p);
            let place = place.unwrap_or(count);
            if place < FAULT_SETS {
                let end = (count + 1).min(FAULT_SETS);
                belief.sets[place..end].rotate_right(1);
                belief.sets[place] = set;
                count = end;
            }
        }
        belief.set_count = count as u32;
    }

    /// The mode to report and its probability: unknown above one half, else the deepest node of at
    /// least one half, else nominal.
    #[must_use]
    pub fn mode(&self, leaves: &Leaves) -> (u32, f64) {
        if self.unknown > 0.5 {
            return (MODE_UNKNOWN, self.unknown);
        }
        let p = self.tree(leaves);
        let mut best = None;
        for node in (0..leaves.nodes).filter(|&node| p[node] >= 0.5) {
            let better =
                |&other: &usize| (leaves.depths[node], p[node]) > (leaves.depths[other], p[other]);
            if best.as_ref().is_none_or(better) {
                best = Some(node);
            }
        }
        let node = best.unwrap_or(0);
        (node as u32, p[node])
    }
}
