//! Which wheel an action is about, and how its fault is steered against.

use vigil_blocks::{Action, FAULT_NODES, FaultBelief, RecoveryKind};
use vigil_pomdp::Pomdp;
use vigil_robot::{Description, FaultTree};

use crate::error::SupervisorError;
use crate::mapping::{self, ActionMeaning, Compensation};
use crate::states::{self, Leaf, LeafKind};

/// A fault is named above this probability: more likely than not.
const NAMED: f64 = 0.5;
/// A probability that has moved by more than this opens another decision. Chosen by hand, as for
/// the belief over states.
const MOVED: f64 = 0.05;

/// The faults of wheels as the identifier holds them, and the wheel of the present action.
pub(crate) struct Wheels {
    leaves: Vec<Leaf>,
    /// Probability of every node of the tree, as of the last decision.
    p: [f64; FAULT_NODES],
    compensation: Vec<Compensation>,
    about: Option<usize>,
}

impl Wheels {
    /// # Errors
    /// [`SupervisorError`] if an action compensates and a wheel that may be stuck cannot be.
    pub(crate) fn new(
        model: &Pomdp,
        actions: &[ActionMeaning],
        tree: &FaultTree,
        robot: &Description,
        compensation: Vec<Compensation>,
    ) -> Result<Self, SupervisorError> {
        let leaves = states::leaves(tree, robot);
        mapping::check_compensation(model, &leaves, actions, &compensation)?;
        Ok(Self {
            leaves,
            p: [0.0; FAULT_NODES],
            compensation,
            about: None,
        })
    }

    /// Nothing is known of any.
    pub(crate) const fn forget(&mut self) {
        self.p = [0.0; FAULT_NODES];
        self.about = None;
    }

    /// What the identifier says now is what the next decision is about.
    pub(crate) const fn take(&mut self, diagnosis: &FaultBelief) {
        self.p = diagnosis.p;
    }

    /// Leaves of one state are treated alike, but for the wheel.
    pub(crate) fn have_moved(&self, diagnosis: &FaultBelief) -> bool {
        let of_wheels = self.leaves.iter().filter(|leaf| leaf.wheel.is_some());
        let at = |p: &[f64], node: usize| p.get(node).copied().unwrap_or(0.0);
        of_wheels
            .map(|leaf| (at(&diagnosis.p, leaf.node) - at(&self.p, leaf.node)).abs())
            .any(|moved| moved > MOVED)
    }

    /// The wheel that an action of `kind` is about; `goes_on` if it is the action before. A way
    /// through an opening is driven as well as the robot can.
    pub(crate) fn choose(&mut self, kind: RecoveryKind, goes_on: bool) {
        let about = match kind {
            RecoveryKind::Compensate => self.most_probable(LeafKind::Stuck),
            RecoveryKind::IgnoreEncoder => self.most_probable(LeafKind::Encoder),
            RecoveryKind::GoThrough => self
                .most_probable(LeafKind::Stuck)
                .filter(|(_, p)| *p > NAMED),
            _ => None,
        };
        // Another wheel than that of the action that goes on has to be more likely than not.
        let held = self.about.filter(|_| goes_on);
        let other = about.filter(|(_, p)| held.is_none() || *p > NAMED);
        self.about = other.map(|(wheel, _)| wheel).or(held);
    }

    /// The wheel of the present action.
    pub(crate) const fn about(&self) -> Option<usize> {
        self.about
    }

    /// Writes how the wheel of an action of `kind` is steered against.
    pub(crate) fn write(&self, kind: RecoveryKind, action: &mut Action) {
        let steers = matches!(kind, RecoveryKind::Compensate | RecoveryKind::GoThrough);
        let wheel = self.about.filter(|_| steers);
        let counter = wheel.and_then(|wheel| self.compensation.iter().find(|c| c.wheel == wheel));
        if let Some(counter) = counter {
            action.curvature_gain = counter.curvature_gain;
            action.curvature_offset = counter.curvature_offset_1_m;
        }
    }

    /// The wheel with such a fault, and its probability.
    fn most_probable(&self, kind: LeafKind) -> Option<(usize, f64)> {
        let mut best: Option<(usize, f64)> = None;
        for leaf in self.leaves.iter().filter(|leaf| leaf.kind == kind) {
            let p = self.p.get(leaf.node).copied().unwrap_or(0.0);
            let is_more = p > best.map_or(0.0, |(_, most)| most);
            best = leaf
                .wheel
                .filter(|_| is_more)
                .map(|wheel| (wheel, p))
                .or(best);
        }
        best
    }
}
