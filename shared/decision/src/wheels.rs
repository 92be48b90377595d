//! Which wheels an action is about, and how their faults are steered against.

use vigil_blocks::RecoveryKind;
use vigil_blocks::{Action, AnsweredWheels, FAULT_NODES, FAULT_SETS, FaultBelief, FaultSet};
use vigil_checkpoint::Checkpoint;
use vigil_pomdp::Pomdp;
use vigil_robot::{Description, FaultTree, counter_steering};

use crate::answerable::AnswerableFaults;
use crate::error::SupervisorError;
use crate::mapping::{self, ActionMeaning, Compensation};
use crate::state_belief::MOVED;
use crate::states::{self, Leaf, LeafKind};

/// A fault is named above this probability: more likely than not.
const NAMED: f64 = 0.5;
/// A set that is this many times as probable as the one that is answered is answered instead,
/// though neither is more likely than not. Chosen by hand.
const FAR_MORE: f64 = 2.0;

/// The faults of wheels as the identifier holds them, and the wheels of the present action.
#[derive(Checkpoint)]
pub(crate) struct Wheels {
    #[checkpoint(fixed)]
    leaves: Vec<Leaf>,
    /// Probability of every node of the tree, and the most probable sets, as of the last decision.
    p: [f64; FAULT_NODES],
    sets: [FaultSet; FAULT_SETS],
    #[checkpoint(fixed)]
    answerable: AnswerableFaults,
    #[checkpoint(fixed)]
    compensation: Vec<Compensation>,
    about: AnsweredWheels,
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
            answerable: AnswerableFaults::new(&leaves, actions, robot, &compensation),
            leaves,
            p: [0.0; FAULT_NODES],
            sets: [FaultSet { leaves: 0, p: 0.0 }; FAULT_SETS],
            compensation,
            about: AnsweredWheels {
                stuck: 0,
                encoders: 0,
            },
        })
    }

    /// Nothing is known of any.
    pub(crate) const fn forget(&mut self) {
        self.p = [0.0; FAULT_NODES];
        self.sets = [FaultSet { leaves: 0, p: 0.0 }; FAULT_SETS];
        self.about = AnsweredWheels {
            stuck: 0,
            encoders: 0,
        };
    }

    /// What the identifier says now is what the next decision is about.
    pub(crate) fn take(&mut self, diagnosis: &FaultBelief) {
        self.p = diagnosis.p;
        self.sets = diagnosis.sets;
        let unused = self.sets.iter_mut().skip(diagnosis.set_count as usize);
        unused.for_each(|set| set.p = 0.0);
    }

    /// The sets that an action can answer as one.
    pub(crate) const fn answerable(&self) -> &AnswerableFaults {
        &self.answerable
    }

    /// Leaves of one state are treated alike, but for the wheel.
    pub(crate) fn have_moved(&self, diagnosis: &FaultBelief) -> bool {
        let of_wheels = self.leaves.iter().filter(|leaf| leaf.wheel.is_some());
        let at = |p: &[f64], node: usize| p.get(node).copied().unwrap_or(0.0);
        of_wheels
            .map(|leaf| (at(&diagnosis.p, leaf.node) - at(&self.p, leaf.node)).abs())
            .any(|moved| moved > MOVED)
    }

    /// The wheels that an action of `kind` is about; `goes_on` if it is the action before. A way
    /// through an opening is driven as well as the robot can.
    pub(crate) fn choose(&mut self, kind: RecoveryKind, goes_on: bool) {
        let about = match kind {
            RecoveryKind::Compensate => self.most_probable(LeafKind::Stuck),
            RecoveryKind::IgnoreEncoder => self.most_probable(LeafKind::Encoder),
            RecoveryKind::LimpHome => self.most_probable_set(),
            RecoveryKind::GoThrough => self
                .most_probable(LeafKind::Stuck)
                .filter(|(_, p)| *p > NAMED),
            _ => None,
        };
        // Other wheels than those of the action that goes on have to be more likely than not, or
        // far more likely than these.
        let held = self.about;
        let is_held = goes_on && !held.is_empty();
        let p_held = match kind {
            RecoveryKind::LimpHome => self.p_of_set(held),
            _ => NAMED,
        };
        let other = about.filter(|(_, p)| !is_held || *p > NAMED || *p > FAR_MORE * p_held);
        self.about = match other {
            Some((wheels, _)) => wheels,
            None if is_held => held,
            None => AnsweredWheels::default(),
        };
    }

    /// The wheels of the present action.
    pub(crate) const fn about(&self) -> AnsweredWheels {
        self.about
    }

    /// Writes how the stuck wheels of an action of `kind` are steered against. The robot then
    /// nearly drives the curvature κ, commanded `gain·κ + offset`.
    pub(crate) fn write(&self, kind: RecoveryKind, action: &mut Action) {
        let steers = matches!(
            kind,
            RecoveryKind::Compensate | RecoveryKind::GoThrough | RecoveryKind::LimpHome
        );
        if !steers {
            return;
        }
        let is_about = |it: &&Compensation| self.about.has_stuck(it.wheel);
        let lines = self.compensation.iter().filter(is_about);
        let lines = lines.map(|it| (it.curvature_gain, it.curvature_offset_1_m));
        (action.curvature_gain, action.curvature_offset) = counter_steering(lines);
    }

    /// The wheel with such a fault, and its probability.
    fn most_probable(&self, kind: LeafKind) -> Option<(AnsweredWheels, f64)> {
        let of_kind = self.leaves.iter().filter(|leaf| leaf.kind == kind);
        let with_wheel = of_kind.filter(|leaf| leaf.wheel.is_some());
        let p = |leaf: &Leaf| self.p.get(leaf.node).copied().unwrap_or(0.0);
        first_largest(with_wheel.map(|leaf| (leaf.answered(), p(leaf))))
    }

    /// The wheels of the most probable set that can be driven home with, and its probability.
    fn most_probable_set(&self) -> Option<(AnsweredWheels, f64)> {
        first_largest(self.drivable_sets())
    }

    /// Probability of the set with these wheels; 0 if it is not among the most probable.
    fn p_of_set(&self, wheels: AnsweredWheels) -> f64 {
        let found = self.drivable_sets().find(|(of, _)| *of == wheels);
        found.map_or(0.0, |(_, p)| p)
    }

    /// What an action is about that answers all leaves of a set.
    fn answered(&self, set: u64) -> AnsweredWheels {
        let held = self.leaves.iter().filter(|leaf| set >> leaf.node & 1 == 1);
        held.map(Leaf::answered)
            .fold(AnsweredWheels::default(), AnsweredWheels::with)
    }

    fn drivable_sets(&self) -> impl Iterator<Item = (AnsweredWheels, f64)> {
        let drivable = |set: &&FaultSet| self.answerable.are_drivable(set.leaves);
        let sets = self.sets.iter().filter(drivable);
        sets.map(|set| (self.answered(set.leaves), set.p))
    }
}

/// The first of the largest probability above 0.
fn first_largest(
    found: impl Iterator<Item = (AnsweredWheels, f64)>,
) -> Option<(AnsweredWheels, f64)> {
    found
        .filter(|(_, p)| *p > 0.0)
        .reduce(|best, it| if it.1 > best.1 { it } else { best })
}
