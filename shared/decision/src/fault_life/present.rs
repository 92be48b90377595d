//! What is present in a cycle.

use vigil_blocks::{
    FAULT_NODES, FaultBelief, FaultSource, MODE_BLIND, MODE_MULTIPLE, MODE_UNKNOWN,
};
use vigil_checkpoint::Checkpoint;
use vigil_robot::FaultTree;

use super::LifeInput;
use super::rules::SERVICES;

/// Something that is present.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Present {
    pub source: FaultSource,
    /// As [`vigil_blocks::FaultRecord::what`] says it.
    pub what: u32,
}

impl Present {
    /// What tells faults apart. All that can be wrong with the input is one fault.
    pub(super) const fn key(self) -> (u32, u32) {
        match self.source {
            FaultSource::Input => (FaultSource::Input as u32, 0),
            source => (source as u32, self.what),
        }
    }
}

/// What is present in a cycle.
#[derive(Debug, Clone, Checkpoint)]
pub(super) struct PresentFaults {
    /// Leaves below each node; of a leaf, itself.
    #[checkpoint(fixed)]
    below: [u64; FAULT_NODES],
    /// Nodes that are no leaves.
    #[checkpoint(fixed)]
    abstract_nodes: u64,
    /// Nodes that are reported.
    nodes: u64,
    unknown: bool,
    silent_services: u32,
    blind: u32,
}

impl PresentFaults {
    pub(super) fn new(tree: &FaultTree) -> Self {
        let mut below = [0_u64; FAULT_NODES];
        for leaf in tree.leaves() {
            let mut at = Some(leaf);
            while let Some(node) = at {
                below[node] |= 1 << leaf;
                at = tree.nodes()[node].parent;
            }
        }
        let leaves = tree.leaves().fold(0_u64, |set, leaf| set | 1 << leaf);
        let nodes = (1..tree.nodes().len()).fold(0_u64, |set, node| set | 1 << node);
        Self {
            below,
            abstract_nodes: nodes & !leaves,
            nodes: 0,
            unknown: false,
            silent_services: 0,
            blind: 0,
        }
    }

    /// True of a leaf of the fault tree.
    pub(super) const fn is_leaf(&self, node: u32) -> bool {
        node != 0 && (node as usize) < FAULT_NODES && self.below[node as usize] == 1 << node
    }

    /// Takes a cycle. What was diagnosed stays while nothing is seen.
    pub(super) fn take(&mut self, input: LifeInput<'_>) {
        (self.silent_services, self.blind) = (input.silent_services, input.decided.blind);
        let Some(diagnosis) = input.observed.filter(|it| it.reported != MODE_BLIND) else {
            return;
        };
        let nodes = match diagnosis.reported {
            MODE_UNKNOWN => 0,
            // What is reported is held for a while, and the sets may say another thing by then.
            MODE_MULTIPLE => several(diagnosis).unwrap_or(self.nodes),
            node => 1_u64.checked_shl(node).unwrap_or(0) & !1,
        };
        (self.nodes, self.unknown) = (nodes, diagnosis.reported == MODE_UNKNOWN);
    }

    /// All that is present.
    pub(super) fn list(&self) -> impl Iterator<Item = Present> + '_ {
        let of = |source, what| Present { source, what };
        let nodes = (1..FAULT_NODES as u32).filter(|node| self.nodes >> node & 1 == 1);
        let unknown = self.unknown.then_some(MODE_UNKNOWN);
        let silent =
            (0..SERVICES.len() as u32).filter(|service| self.silent_services >> service & 1 == 1);
        let blind = (self.blind != 0).then_some(self.blind);
        nodes
            .chain(unknown)
            .map(move |what| of(FaultSource::Robot, what))
            .chain(silent.map(move |service| of(FaultSource::Service, service)))
            .chain(blind.map(move |cause| of(FaultSource::Input, cause)))
    }

    /// What is reported of the robot that is no leaf; `None` if there is none.
    pub(super) const fn coarse(&self) -> Option<u32> {
        if self.unknown {
            return Some(MODE_UNKNOWN);
        }
        match self.nodes & self.abstract_nodes {
            0 => None,
            set => Some(set.trailing_zeros()),
        }
    }

    /// The leaves that a coarse name may stand for.
    pub(super) fn covered_by(&self, coarse: u32) -> u64 {
        let node = self.below.get(coarse as usize).copied();
        node.unwrap_or(!1)
    }

    /// Names stand for a coarse one.
    pub(super) fn replace(&mut self, coarse: u32, names: u64) {
        if coarse == MODE_UNKNOWN {
            self.unknown = false;
        } else {
            self.nodes &= !1_u64.checked_shl(coarse).unwrap_or(0);
        }
        self.nodes |= names;
    }

    /// True if `what` says less than `name`, and nothing that contradicts it.
    pub(super) fn is_coarser(&self, what: u32, name: u32) -> bool {
        let covers = |node: u32| self.below.get(node as usize).copied().unwrap_or(0);
        match (what, name) {
            (MODE_UNKNOWN, MODE_UNKNOWN) => false,
            (MODE_UNKNOWN, _) => true,
            (_, MODE_UNKNOWN) => false,
            (node, name) => node != name && covers(node) & covers(name) == covers(name),
        }
    }
}

/// The most probable set of two faults or more.
fn several(diagnosis: &FaultBelief) -> Option<u64> {
    let sets = diagnosis.sets.iter().map(|set| set.leaves & !1);
    sets.take(diagnosis.set_count as usize)
        .find(|leaves| leaves.count_ones() > 1)
}
