//! The tree of abstract nodes over the modes.

use vigil_checkpoint::Checkpoint;

use crate::hybrid::{ModelError, Modes};

/// Why a hierarchy was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HierarchyError {
    /// The model is refused.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// An abstract node needs two modes at least, none of them the nominal one.
    #[error("abstract node {0} needs two or more modes other than the nominal one")]
    Node(usize),
    /// A mode does not exist.
    #[error("mode {mode} of abstract node {node} does not exist")]
    Mode {
        /// Index of the abstract node.
        node: usize,
        /// Index of the mode.
        mode: usize,
    },
    /// Two nodes share some modes, and neither lies below the other.
    #[error("abstract nodes {0} and {1} overlap: one must contain the other, or none of its modes")]
    Overlap(usize, usize),
}

/// An abstract node, and whether its particles are moved as one.
#[derive(Debug, Clone, Checkpoint)]
pub(super) struct Node {
    #[checkpoint(fixed)]
    pub(super) leaves: Vec<usize>,
    /// Nodes directly below, and leaves below none of them.
    #[checkpoint(fixed)]
    pub(super) nodes_below: Vec<usize>,
    #[checkpoint(fixed)]
    pub(super) leaves_below: Vec<usize>,
    pub(super) merged: bool,
}

/// Nodes and, for each mode, the nodes above it from the top.
pub(super) fn arrange(
    model: &impl Modes,
    abstract_nodes: &[Vec<usize>],
) -> Result<(Vec<Node>, Vec<Vec<usize>>), HierarchyError> {
    let modes = model.modes();
    let mut above: Vec<Vec<usize>> = vec![Vec::new(); modes];
    for (node, leaves) in abstract_nodes.iter().enumerate() {
        if leaves.len() < 2 || leaves.contains(&0) {
            return Err(HierarchyError::Node(node));
        }
        for &mode in leaves {
            let Some(above) = above.get_mut(mode) else {
                return Err(HierarchyError::Mode { node, mode });
            };
            above.push(node);
        }
        for (other, others) in abstract_nodes[..node].iter().enumerate() {
            let shared = leaves.iter().filter(|mode| others.contains(mode)).count();
            let nested = shared == leaves.len().min(others.len()) && leaves.len() != others.len();
            if shared > 0 && !nested {
                return Err(HierarchyError::Overlap(other, node));
            }
        }
    }
    for nodes in &mut above {
        nodes.sort_by_key(|&node| std::cmp::Reverse(abstract_nodes[node].len()));
    }
    // The node directly above a mode (of size 1), or above a node, which its first mode stands for.
    let next_above = |mode: usize, size: usize| {
        let larger = above[mode].iter().rev();
        larger
            .copied()
            .find(|&node| abstract_nodes[node].len() > size)
    };
    let nodes = abstract_nodes.iter().enumerate().map(|(index, leaves)| {
        let others = abstract_nodes.iter().enumerate();
        let nodes_below = others.filter(|(_, o)| next_above(o[0], o.len()) == Some(index));
        let leaves_below = leaves.iter().copied();
        Node {
            nodes_below: nodes_below.map(|(other, _)| other).collect(),
            leaves_below: leaves_below
                .filter(|&k| next_above(k, 1) == Some(index))
                .collect(),
            leaves: leaves.clone(),
            merged: true,
        }
    });
    let nodes = nodes.collect();
    Ok((nodes, above))
}
