//! What detector and identifier believe, with names.

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::{Blindness, DetectionBelief, FaultBelief, FaultSet, Readiness};
use vigil_robot::FaultTree;

use crate::faults::document::Now;

/// What is less probable is not listed.
const P_MIN: f64 = 0.001;

/// The detector's belief.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Detector {
    /// Probability that something is wrong.
    pub p_fault: f64,
    /// True while an alarm stands.
    pub alarm: bool,
    /// Alarms so far.
    pub alarm_count: u32,
    /// `arming`, `armed` or `not-excited`.
    pub readiness: &'static str,
    /// Why it sees nothing; null while it sees.
    pub blind: Option<&'static str>,
    /// Since it said so.
    pub age_s: f64,
    /// True if that is too long for a detector that lives.
    pub is_silent: bool,
}

/// The identifier's belief.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Diagnosis {
    /// The reported mode.
    pub mode: String,
    /// Probability of the present one.
    pub p_mode: f64,
    /// True while it identifies; false while it watches.
    pub identifying: bool,
    /// Name of the nominal mode.
    pub nominal: String,
    /// Probability of the nominal mode: no fault at all.
    pub p_nominal: f64,
    /// Probability that no known fault explains the data.
    pub p_unknown: f64,
    /// The nodes of the tree but the nominal one; the most probable first.
    pub nodes: Vec<NamedNode>,
    /// The most probable sets of faults; the empty one is nominal.
    pub sets: Vec<NamedSet>,
}

/// A node of the fault tree.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct NamedNode {
    /// Its name.
    pub name: String,
    /// Its probability.
    pub p: f64,
    /// True of a leaf.
    pub is_leaf: bool,
    /// Its place in the tree.
    #[serde(skip)]
    pub at: usize,
}

/// A set of faults that are present together.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct NamedSet {
    /// Their names.
    pub faults: Vec<String>,
    /// Its probability.
    pub p: f64,
}

impl Detector {
    /// A block in words.
    pub fn new(block: &DetectionBelief, now: Now, silent_s: f64) -> Self {
        let age_ns = now.monotonic_ns.saturating_sub(block.header.t_publish_ns);
        Self {
            p_fault: block.p_fault,
            alarm: block.alarm != 0,
            alarm_count: block.alarm_count,
            readiness: match Readiness::from_repr(block.readiness) {
                Some(Readiness::Arming) => "arming",
                Some(Readiness::Armed) => "armed",
                Some(Readiness::NotExcited) => "not-excited",
                None => "?",
            },
            blind: Blindness::from_repr(block.blind).map(Blindness::as_str),
            is_silent: age_ns as f64 * 1e-9 > silent_s,
            age_s: (age_ns as f64 * 1e-6).round() * 1e-3,
        }
    }

    /// Whether an alarm stands or could rise, for people.
    pub fn text(&self) -> String {
        let count = self.alarm_count;
        if self.is_silent {
            return format!("SILENT for {:.1} s", self.age_s);
        }
        match (self.blind, self.alarm, self.readiness) {
            (Some(cause), ..) => format!("BLIND: {cause}"),
            (None, true, _) => format!("ALARM, alarms so far {count}"),
            (None, false, "not-excited") => "robot stands: belief held".to_owned(),
            (None, false, readiness) => format!("{readiness}, alarms so far {count}"),
        }
    }
}

impl Diagnosis {
    /// A block with the names that the tree gives.
    pub fn new(block: &FaultBelief, tree: &FaultTree) -> Self {
        let count = (block.node_count as usize).min(block.p.len());
        let nodes = tree.nodes().iter().enumerate().take(count).skip(1);
        let mut nodes: Vec<NamedNode> = nodes
            .map(|(at, node)| NamedNode {
                name: node.name.clone(),
                p: block.p[at],
                is_leaf: node.fault.is_some(),
                at,
            })
            .collect();
        // Stable: equal ones stay in the tree's order.
        nodes.sort_by(|a, b| b.p.total_cmp(&a.p));
        let sets = block.sets.iter().take(block.set_count as usize);
        Self {
            mode: tree.mode_name(block.reported).to_owned(),
            p_mode: block.p_mode,
            identifying: block.identifying != 0,
            nominal: tree.mode_name(0).to_owned(),
            p_nominal: block.p[0],
            p_unknown: block.p_unknown,
            nodes,
            sets: sets
                .filter(|set| set.p >= P_MIN)
                .map(|set| NamedSet::new(set, tree))
                .collect(),
        }
    }

    /// The most probable set of several faults, for people; `None` if none is worth telling.
    pub fn several(&self) -> Option<String> {
        let set = self.sets.iter().find(|set| set.faults.len() > 1)?;
        (set.p >= 0.01).then(|| format!("{} {:.3}", set.faults.join("+"), set.p))
    }
}

impl NamedSet {
    fn new(set: &FaultSet, tree: &FaultTree) -> Self {
        let nodes = tree.nodes().iter().enumerate();
        let present = nodes.filter(|(at, _)| set.leaves >> at & 1 == 1);
        Self {
            faults: present.map(|(_, node)| node.name.clone()).collect(),
            p: set.p,
        }
    }
}
