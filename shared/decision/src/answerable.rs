//! Faults that an action can answer: single ones, and sets with which a robot can be driven home.
//!
//! An action that counter-steers, or ignores an encoder, is about one wheel. Counter-steering is
//! learned for one stuck wheel each. Two on different sides pull against each other: what is
//! steered against each adds up, nearly. Two on one side turn the robot about them: nothing steers
//! against that. A wheel that is on no side counts as one on the right.

use vigil_blocks::RecoveryKind;
use vigil_robot::Description;

use crate::mapping::{ActionMeaning, Compensation};
use crate::states::{Leaf, LeafKind};

/// Which faults an action can answer.
/// None by default.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct AnswerableFaults {
    /// Leaves that an action answers one at a time, as bits.
    singles: u64,
    /// Leaves of encoders, and of stuck wheels on the right and on the left, as bits.
    encoders: u64,
    stuck: [u64; 2],
}

impl AnswerableFaults {
    /// Those of a robot's leaves that can be steered against or ignored.
    pub(crate) fn new(
        leaves: &[Leaf],
        actions: &[ActionMeaning],
        robot: &Description,
        compensation: &[Compensation],
    ) -> Self {
        let has = |kind| actions.iter().any(|action| action.kind == kind);
        let mut faults = Self::default();
        for leaf in leaves {
            let Some(wheel) = leaf.wheel else {
                continue;
            };
            let bit = 1 << leaf.node;
            let is_single = match leaf.kind {
                LeafKind::Encoder => {
                    faults.encoders |= bit;
                    has(RecoveryKind::IgnoreEncoder)
                }
                LeafKind::Stuck if compensation.iter().any(|it| it.wheel == wheel) => {
                    let is_left = robot.wheels.get(wheel).is_some_and(|it| it.y > 0.0);
                    faults.stuck[usize::from(is_left)] |= bit;
                    has(RecoveryKind::Compensate)
                }
                LeafKind::Stuck | LeafKind::Other => false,
            };
            if is_single {
                faults.singles |= bit;
            }
        }
        faults
    }

    /// Such that an action answers any of these leaves (bits), one at a time.
    #[cfg(test)]
    pub(crate) fn singles(singles: u64) -> Self {
        Self {
            singles,
            ..Self::default()
        }
    }

    /// Such that an action answers any of these leaves (bits), and one all of them.
    #[cfg(test)]
    pub(crate) fn drivable(encoders: u64) -> Self {
        Self {
            encoders,
            ..Self::singles(encoders)
        }
    }

    /// The same, but for faults that are answered one at a time.
    pub(crate) const fn sets(&self) -> Self {
        Self {
            singles: 0,
            ..*self
        }
    }

    /// True if an action answers any of these faults, but one at a time.
    pub(crate) const fn are_singles(&self, leaves: u64) -> bool {
        leaves != 0 && leaves & !self.singles == 0
    }

    /// True if a robot with two of these faults or more, and no other, can be driven home.
    pub(crate) fn are_drivable(&self, set: u64) -> bool {
        let [right, left] = self.stuck;
        set.count_ones() > 1
            && set & !(self.encoders | right | left) == 0
            && self.stuck.iter().all(|side| (set & side).count_ones() <= 1)
    }
}
