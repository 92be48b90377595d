//! From the fault tree's leaves to the decision model's states.
//!
//! Which state a leaf belongs to says [`FaultTree::state_names`].

use vigil_blocks::AnsweredWheels;
use vigil_robot::{Description, FaultTree};

use crate::error::SupervisorError;
use crate::state_names::{DONE, FAULT, NEW, SEVERAL, SEVERAL_DRIVABLE, UNKNOWN};

/// What a state of the decision model stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Subject {
    /// Nothing is wrong.
    Nominal,
    /// One of some leaves of the fault tree.
    Fault,
    /// Two leaves or more.
    Several,
    /// Two leaves or more, with which a robot can be driven home.
    Drivable,
    /// What no modelled fault explains.
    Unknown,
    /// The task is done.
    Done,
}

/// What a state stands for, and which leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct StateMeaning {
    /// What it stands for.
    pub subject: Subject,
    /// Its leaves, as bits.
    pub leaves: u64,
    /// The state that stands for the same once no more evidence comes, if this one is new.
    pub settles_to: Option<usize>,
}

/// What an action may do about a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LeafKind {
    /// A stuck wheel can be counter-steered for.
    Stuck,
    /// A broken encoder can be ignored.
    Encoder,
    /// Anything else.
    Other,
}

/// A leaf of the fault tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Leaf {
    /// Index of its node.
    pub node: usize,
    /// What may be done about it.
    pub kind: LeafKind,
    /// Its wheel.
    pub wheel: Option<usize>,
}

impl Leaf {
    /// What an action is about that answers it.
    pub(crate) fn answered(&self) -> AnsweredWheels {
        match (self.wheel, self.kind) {
            (Some(wheel), LeafKind::Stuck) => AnsweredWheels::one_stuck(wheel),
            (Some(wheel), LeafKind::Encoder) => AnsweredWheels::one_encoder(wheel),
            _ => AnsweredWheels::default(),
        }
    }
}

/// The leaves of a tree, in order.
pub(crate) fn leaves(tree: &FaultTree, robot: &Description) -> Vec<Leaf> {
    let leaf = |node: usize| {
        let fault = tree.nodes()[node].fault.as_deref().unwrap_or_default();
        let (kind, part) = fault.split_once(':').unwrap_or((fault, ""));
        Leaf {
            node,
            kind: match kind {
                "stuck" => LeafKind::Stuck,
                "encoder" => LeafKind::Encoder,
                _ => LeafKind::Other,
            },
            wheel: robot.wheel_index(part),
        }
    };
    tree.leaves().map(leaf).collect()
}

/// True if a state may have this name because of what it says about the hardware.
pub(crate) fn is_of_hardware(name: &str, tree: &FaultTree) -> bool {
    let settled = name.strip_suffix(NEW).unwrap_or(name);
    matches!(settled, UNKNOWN | FAULT | SEVERAL | SEVERAL_DRIVABLE)
        || tree
            .nodes()
            .first()
            .is_some_and(|nominal| nominal.name == settled)
        || is_of_leaves(name, tree)
        || is_of_leaves(settled, tree)
}

/// True if a state of some leaves may have this name.
fn is_of_leaves(name: &str, tree: &FaultTree) -> bool {
    let names = |leaf| tree.state_names(leaf).any(|of_leaf| of_leaf == name);
    tree.leaves().any(names)
}

/// Meaning of every state, by its name.
///
/// # Errors
/// [`SupervisorError`] if a leaf, nominal or unknown has no state, or a state of faults no leaf.
pub(crate) fn states(
    names: &[String],
    tree: &FaultTree,
) -> Result<Vec<StateMeaning>, SupervisorError> {
    let nominal = tree.nodes()[0].name.as_str();
    let at = |name: &str| names.iter().position(|state| state == name);
    let meaning = |name: &String| StateMeaning {
        settles_to: name.strip_suffix(NEW).and_then(at),
        subject: match name.strip_suffix(NEW).unwrap_or(name) {
            UNKNOWN => Subject::Unknown,
            SEVERAL => Subject::Several,
            SEVERAL_DRIVABLE => Subject::Drivable,
            DONE => Subject::Done,
            name if name == nominal => Subject::Nominal,
            _ => Subject::Fault,
        },
        leaves: 0,
    };
    let mut meanings: Vec<StateMeaning> = names.iter().map(meaning).collect();
    let is_there = |name: &&str| names.iter().any(|state| state == name);
    let settled = names.iter().filter(|name| !is_of_leaves(name, tree));
    let settled = settled.filter_map(|name| name.strip_suffix(NEW));
    let mut needed = [nominal, UNKNOWN].into_iter().chain(settled);
    if let Some(missing) = needed.find(|name| !is_there(name)) {
        return Err(SupervisorError::NoState(missing.to_owned()));
    }
    for leaf in tree.leaves() {
        let holds = |name: &str| {
            let same = |(state, meaning): (&String, &StateMeaning)| {
                state == name && meaning.subject == Subject::Fault && meaning.settles_to.is_none()
            };
            names.iter().zip(&meanings).position(same)
        };
        let found = tree.state_names(leaf).find_map(|name| holds(&name));
        let state =
            found.ok_or_else(|| SupervisorError::NoState(tree.nodes()[leaf].name.clone()))?;
        meanings[state].leaves |= 1 << leaf;
    }
    for state in 0..meanings.len() {
        if let Some(settled) = meanings[state].settles_to {
            meanings[state].leaves = meanings[settled].leaves;
        }
    }
    let is_empty = |(name, meaning): &(&String, &StateMeaning)| {
        let may_be_empty = *name == FAULT || meaning.settles_to.is_some();
        meaning.subject == Subject::Fault && meaning.leaves == 0 && !may_be_empty
    };
    match names.iter().zip(&meanings).find(is_empty) {
        Some((name, _)) => Err(SupervisorError::NoLeaf(name.clone())),
        None => Ok(meanings),
    }
}

#[cfg(test)]
mod tests {
    use vigil_robot::tree::Node;

    use super::*;

    fn tree() -> FaultTree {
        let node = |name: &str, parent, fault: Option<&str>| Node {
            name: name.to_owned(),
            parent,
            fault: fault.map(str::to_owned),
        };
        FaultTree::new(vec![
            node("ND", None, None),
            node("LEFT", None, None),
            node("L1", Some(1), Some("stuck:L1")),
            node("L2", Some(1), Some("stuck:L2")),
            node("R1", None, Some("stuck:R1")),
            node("GYRO", None, Some("gyro")),
        ])
        .unwrap()
    }

    /// Leaves of the states with these names.
    fn held(names: &str) -> Result<Vec<u64>, SupervisorError> {
        let names: Vec<String> = names.split(' ').map(str::to_owned).collect();
        let meanings = states(&names, &tree())?;
        Ok(meanings.iter().map(|meaning| meaning.leaves).collect())
    }

    #[test]
    fn a_leaf_belongs_to_the_nearest_state_of_its_own() {
        for (names, wanted) in [
            ("ND UNKNOWN L1 L2 R1 GYRO", &[0, 0, 4, 8, 16, 32][..]),
            ("ND UNKNOWN LEFT R1 GYRO", &[0, 0, 12, 16, 32]),
            ("ND UNKNOWN LEFT STUCK GYRO", &[0, 0, 12, 16, 32]),
            ("STUCK UNKNOWN ND L2 FAULT", &[20, 0, 0, 8, 32]),
            (
                "ND UNKNOWN FAULT SEVERAL SEVERAL_DRIVABLE DONE",
                &[0, 0, 60, 0, 0, 0],
            ),
            (
                "ND UNKNOWN UNKNOWN_NEW STUCK STUCK_NEW GYRO FAULT",
                &[0, 0, 0, 28, 28, 32, 0],
            ),
        ] {
            assert_eq!(held(names).unwrap(), wanted, "{names}");
        }
    }

    #[test]
    fn leaves_without_a_state_and_states_without_a_leaf_are_named() {
        let missing = |names: &str| held(names).unwrap_err();
        let no_state = |name: &str| SupervisorError::NoState(name.to_owned());
        let no_leaf = |name: &str| SupervisorError::NoLeaf(name.to_owned());
        assert_eq!(missing("UNKNOWN FAULT"), no_state("ND"));
        assert_eq!(missing("ND FAULT"), no_state("UNKNOWN"));
        assert_eq!(missing("ND UNKNOWN LEFT R1"), no_state("GYRO"));
        assert_eq!(missing("ND UNKNOWN STUCK_NEW FAULT"), no_state("STUCK"));
        assert_eq!(missing("ND UNKNOWN SERVO FAULT"), no_leaf("SERVO"));
        // Every stuck wheel has a nearer one.
        assert_eq!(missing("ND UNKNOWN LEFT R1 STUCK GYRO"), no_leaf("STUCK"));
    }
}
