//! The fault tree: nominal mode, abstract nodes, leaves.

use vigil_blocks::{FAULT_NODES, fnv1a, mode_word};

/// One node of a [`FaultTree`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node {
    /// Name, as reported (`RM_STUCK`, `RSS`).
    pub name: String,
    /// Index of the parent; `None` for the nominal mode and for children of the root.
    pub parent: Option<usize>,
    /// For a leaf: the fault that it stands for, in the words of the robot's model
    /// (`stuck:RM`, `encoder:RM`). `None` for nominal and abstract nodes.
    pub fault: Option<String>,
}

/// A fault tree. Node 0 is the nominal mode; every other node is an abstract node or a leaf;
/// parents come before their children.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FaultTree {
    nodes: Vec<Node>,
    hash: u64,
}

/// Why a fault tree was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TreeError {
    /// More nodes than a block can carry, or none.
    #[error("a fault tree has 1 to {FAULT_NODES} nodes, not {0}")]
    Size(usize),
    /// Two nodes have one name.
    #[error("node '{0}' appears twice")]
    Duplicate(String),
    /// The first node must be the nominal mode: no parent, no fault.
    #[error("the first node must be the nominal mode, without parent and fault")]
    Nominal,
    /// A parent does not come before its child, or is a leaf or the nominal mode.
    #[error("the parent of '{0}' must be an abstract node listed before it")]
    Parent(String),
    /// A node has neither a fault nor children.
    #[error("node '{0}' has neither a fault nor children")]
    Empty(String),
}

impl FaultTree {
    /// Checks and builds a tree.
    ///
    /// # Errors
    /// [`TreeError`] naming the node.
    pub fn new(nodes: Vec<Node>) -> Result<Self, TreeError> {
        if nodes.is_empty() || nodes.len() > FAULT_NODES {
            return Err(TreeError::Size(nodes.len()));
        }
        if nodes[0].parent.is_some() || nodes[0].fault.is_some() {
            return Err(TreeError::Nominal);
        }
        for (i, node) in nodes.iter().enumerate() {
            if nodes[..i].iter().any(|other| other.name == node.name) {
                return Err(TreeError::Duplicate(node.name.clone()));
            }
            if let Some(parent) = node.parent
                && (parent == 0 || parent >= i || nodes[parent].fault.is_some())
            {
                return Err(TreeError::Parent(node.name.clone()));
            }
            let childless = !nodes.iter().any(|other| other.parent == Some(i));
            if i > 0 && node.fault.is_none() && childless {
                return Err(TreeError::Empty(node.name.clone()));
            }
        }
        let mut hash = fnv1a::BASIS;
        for node in &nodes {
            hash = fnv1a::hash(hash, node.name.as_bytes());
            hash = fnv1a::hash_u64(hash, node.parent.map_or(u64::MAX, |p| p as u64));
            hash = fnv1a::hash(hash, node.fault.as_deref().unwrap_or("").as_bytes());
        }
        Ok(Self { nodes, hash })
    }

    /// All nodes; index 0 is nominal.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Hash over names, parents and faults.
    #[must_use]
    pub const fn hash(&self) -> u64 {
        self.hash
    }

    /// The name of a mode of the diagnosis: a node's, or the word for one that is no node; `?` for
    /// what this tree does not have.
    #[must_use]
    pub fn mode_name(&self, mode: u32) -> &str {
        let node = self.nodes.get(mode as usize);
        let name = node.map(|node| node.name.as_str());
        mode_word(mode).or(name).unwrap_or("?")
    }

    /// Indices of the leaves, in order; all below [`FAULT_NODES`], so that a block holds each.
    pub fn leaves(&self) -> impl Iterator<Item = usize> + '_ {
        assert!(
            self.nodes.len() <= FAULT_NODES,
            "a fault tree has no more nodes than a block"
        );
        (0..self.nodes.len()).filter(|&i| self.nodes[i].fault.is_some())
    }

    /// Index of the node called `name`.
    #[must_use]
    pub fn index(&self, name: &str) -> Option<usize> {
        self.nodes.iter().position(|node| node.name == name)
    }

    /// Names of the states of a decision model that a leaf may belong to; the first that the model
    /// has counts: the leaf's own, those of the nodes above it, its kind in capitals (`STUCK` for
    /// `stuck:LF`), `FAULT`.
    pub fn state_names(&self, leaf: usize) -> impl Iterator<Item = String> {
        let node = |at: usize| self.nodes.get(at);
        let above = std::iter::successors(node(leaf), move |child| child.parent.and_then(node));
        let fault = node(leaf).and_then(|leaf| leaf.fault.as_deref());
        let kind = fault.and_then(|fault| fault.split(':').next());
        let kind = kind.unwrap_or_default().to_uppercase();
        above
            .map(|node| node.name.clone())
            .chain([kind, "FAULT".to_owned()])
    }

    /// Number of ancestors of node `i`.
    #[must_use]
    pub fn depth(&self, i: usize) -> usize {
        let parent = |child: usize| {
            let parent = self.nodes[child].parent;
            assert!(
                parent.is_none_or(|parent| parent < child),
                "a parent comes before its children in a fault tree"
            );
            parent
        };
        std::iter::successors(parent(i), |&node| parent(node)).count()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn node(name: &str, parent: Option<usize>, fault: Option<&str>) -> Node {
        Node {
            name: name.to_owned(),
            parent,
            fault: fault.map(str::to_owned),
        }
    }

    #[test]
    #[should_panic(expected = "a parent comes before its children")]
    fn a_parent_behind_its_child_would_end_the_process() {
        let nodes = vec![node("ND", None, None), node("A", Some(1), Some("stuck:LF"))];
        let _ = FaultTree { nodes, hash: 0 }.depth(1);
    }

    #[test]
    #[should_panic(expected = "no more nodes than a block")]
    fn a_tree_larger_than_a_block_would_end_the_process() {
        let nodes = vec![node("ND", None, None); FAULT_NODES + 1];
        let _ = FaultTree { nodes, hash: 0 }.leaves().count();
    }

    proptest! {
        #[test]
        fn a_tree_that_is_accepted_has_an_order_and_fits_a_block(
            nodes in prop::collection::vec(
                (0_u8..40, prop::option::of(0_usize..12), any::<bool>()), 0..FAULT_NODES + 3),
        ) {
            let nodes: Vec<Node> = nodes
                .into_iter()
                .map(|(name, parent, is_leaf)| {
                    node(&name.to_string(), parent, is_leaf.then_some("stuck:LF"))
                })
                .collect();
            let Ok(tree) = FaultTree::new(nodes) else { return Ok(()) };
            for leaf in tree.leaves() {
                prop_assert!(leaf < FAULT_NODES && tree.depth(leaf) < tree.nodes().len());
            }
        }
    }
}
