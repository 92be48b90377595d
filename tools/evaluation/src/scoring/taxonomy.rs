//! Side and type of every node of a fault tree.

use vigil_robot::Description;
use vigil_robot::FaultTree;

use super::UNKNOWN;

/// Side of a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Wheels with y > 0.
    Left,
    /// Wheels with y < 0.
    Right,
}

/// Prior probability of the unknown among all faults, unless another is given.
const PRIOR_UNKNOWN: f64 = 0.01;

/// What the nodes of a fault tree say about a fault.
#[derive(Debug, Clone, PartialEq)]
pub struct Taxonomy {
    nodes: Vec<Node>,
    prior_unknown: f64,
}

#[derive(Debug, Clone, PartialEq)]
struct Node {
    name: String,
    parent: Option<usize>,
    /// Common side of all leaves below.
    side: Option<Side>,
    /// Common type of all leaves below: the first word of the fault, `stuck` or `encoder`; a
    /// declared fault is a type of its own.
    class: Option<String>,
    is_leaf: bool,
}

impl Taxonomy {
    /// Taxonomy of the faults of `tree` in the words of `robot`.
    #[must_use]
    pub fn new(tree: &FaultTree, robot: &Description) -> Self {
        let mut nodes: Vec<Node> = tree
            .nodes()
            .iter()
            .map(|node| {
                let mut words = node.fault.as_deref().unwrap_or("").split(':');
                let class = words.next().filter(|word| !word.is_empty());
                let of = words.next();
                let class = if class == Some("fault") { of } else { class };
                let wheel = of.and_then(|name| robot.wheel_index(name));
                Node {
                    name: node.name.clone(),
                    parent: node.parent,
                    side: wheel.and_then(|wheel| side_of(robot.wheels[wheel].y)),
                    class: class.map(str::to_owned),
                    is_leaf: node.fault.is_some(),
                }
            })
            .collect();
        // Parents come before their children: from the last node on, children are complete.
        for i in (1..nodes.len())
            .rev()
            .filter(|&i| tree.nodes()[i].fault.is_none())
        {
            let mut children = nodes.iter().filter(|node| node.parent == Some(i));
            let Some(first) = children.next() else {
                continue;
            };
            let (mut side, mut class) = (first.side, first.class.clone());
            for child in children {
                side = side.filter(|side| child.side == Some(*side));
                class = class.filter(|class| child.class.as_ref() == Some(class));
            }
            (nodes[i].side, nodes[i].class) = (side, class);
        }
        Self {
            nodes,
            prior_unknown: PRIOR_UNKNOWN,
        }
    }

    /// With this prior probability of the unknown among all faults: `identifier.p_unknown`.
    #[must_use]
    pub fn with_prior_unknown(self, prior_unknown: f64) -> Self {
        Self {
            prior_unknown,
            ..self
        }
    }

    /// Prior share of one leaf among all faults; leaves are alike.
    #[must_use]
    pub fn leaf_share(&self) -> f64 {
        let leaves = self.nodes.iter().filter(|node| node.is_leaf).count();
        match leaves {
            0 => 0.0,
            n => (1.0 - self.prior_unknown) / n as f64,
        }
    }

    fn node(&self, name: &str) -> Option<&Node> {
        self.nodes.iter().find(|node| node.name == name)
    }

    /// True if it knows any fault; false if only the nominal mode is modelled.
    #[must_use]
    pub fn has_faults(&self) -> bool {
        self.nodes.iter().any(|node| node.is_leaf)
    }

    /// Name of node `i`.
    #[must_use]
    pub fn name(&self, i: usize) -> Option<&str> {
        self.nodes.get(i).map(|node| node.name.as_str())
    }

    /// Index of a leaf or of the nominal mode.
    #[must_use]
    pub fn index(&self, mode: &str) -> Option<usize> {
        let position = self.nodes.iter().position(|node| node.name == mode)?;
        (position == 0 || self.nodes[position].is_leaf).then_some(position)
    }

    /// True if `mode` is a node above leaves.
    #[must_use]
    pub fn is_abstract(&self, mode: &str) -> bool {
        let position = self.nodes.iter().position(|node| node.name == mode);
        position.is_some_and(|i| i > 0 && !self.nodes[i].is_leaf)
    }

    /// Side on which a node's leaves lie, if it is one.
    #[must_use]
    pub fn side(&self, mode: &str) -> Option<Side> {
        self.node(mode)?.side
    }

    /// Type of a node's faults (`stuck`, `encoder`), if it is one.
    #[must_use]
    pub fn class(&self, mode: &str) -> Option<&str> {
        self.node(mode)?.class.as_deref()
    }

    /// The same, or `unmodelled` for a fault that the tree lacks.
    #[must_use]
    pub fn class_or_unmodelled(&self, mode: &str) -> &str {
        self.class(mode).unwrap_or("unmodelled")
    }

    /// Names of the nominal mode and of all leaves with their indices, in the tree's order.
    pub fn leaf_names(&self) -> impl Iterator<Item = (usize, &str)> {
        let nodes = self.nodes.iter().enumerate();
        nodes
            .filter(|(i, node)| *i == 0 || node.is_leaf)
            .map(|(i, node)| (i, node.name.as_str()))
    }

    /// True if `mode` is the leaf that should be named when `truth` is true.
    #[must_use]
    pub fn is_leaf_right(&self, mode: &str, truth: &str) -> bool {
        mode == self.expected(truth)
    }

    /// True if `mode` is of the side of `truth`; without a side, if it is the leaf.
    #[must_use]
    pub fn is_side_right(&self, mode: &str, truth: &str) -> bool {
        match self.side(truth) {
            Some(side) => self.side(mode) == Some(side),
            None => self.is_leaf_right(mode, truth),
        }
    }

    /// True if `mode` is of the type of `truth`; without a type, if it is the leaf.
    #[must_use]
    pub fn is_class_right(&self, mode: &str, truth: &str) -> bool {
        match self.class(truth) {
            Some(class) => self.class(mode) == Some(class),
            None => self.is_leaf_right(mode, truth),
        }
    }

    /// Indices of the leaves of a type on a side.
    pub fn leaves(&self, class: &str, side: Side) -> impl Iterator<Item = usize> {
        let has = move |node: &Node| {
            node.is_leaf && node.side == Some(side) && node.class.as_deref() == Some(class)
        };
        (0..self.nodes.len()).filter(move |&i| has(&self.nodes[i]))
    }

    /// The leaf that should be named when `truth` is true.
    #[must_use]
    pub fn expected<'a>(&self, truth: &'a str) -> &'a str {
        self.index(truth).map_or(UNKNOWN, |_| truth)
    }

    /// True if naming `mode` is no lie when `truth` is true: it is the expected leaf, or an
    /// abstract node above it.
    #[must_use]
    pub fn covers(&self, mode: &str, truth: &str) -> bool {
        let mut at = self.nodes.iter().position(|node| node.name == truth);
        if at.is_none() {
            return mode == UNKNOWN;
        }
        while let Some(i) = at {
            if self.nodes[i].name == mode {
                return true;
            }
            at = self.nodes[i].parent;
        }
        false
    }
}

fn side_of(y: f64) -> Option<Side> {
    match y {
        y if y > 0.0 => Some(Side::Left),
        y if y < 0.0 => Some(Side::Right),
        _ => None,
    }
}
