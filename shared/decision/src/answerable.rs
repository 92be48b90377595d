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

#[cfg(test)]
mod tests {
    use super::*;

    const LF: u64 = 1 << 1;
    const LM: u64 = 1 << 2;
    const RF: u64 = 1 << 3;
    const LF_ENCODER: u64 = 1 << 4;
    const SERVO: u64 = 1 << 5;

    /// Of the rover, whose wheels 0 and 1 are on the left and 3 on the right. Node 6 is a stuck
    /// wheel that no counter-steering is known for.
    fn answerable(kinds: &[RecoveryKind]) -> AnswerableFaults {
        let leaf = |node, kind, wheel| Leaf { node, kind, wheel };
        let leaves = [
            leaf(1, LeafKind::Stuck, Some(0)),
            leaf(2, LeafKind::Stuck, Some(1)),
            leaf(3, LeafKind::Stuck, Some(3)),
            leaf(4, LeafKind::Encoder, Some(0)),
            leaf(5, LeafKind::Other, Some(0)),
            leaf(6, LeafKind::Stuck, Some(4)),
        ];
        let action = |kind: &RecoveryKind| ActionMeaning {
            kind: *kind,
            speed_scale: 1.0,
            has_end: false,
            epoch_ns: None,
        };
        let actions: Vec<ActionMeaning> = kinds.iter().map(action).collect();
        let compensation = [0, 1, 3].map(|wheel| Compensation {
            wheel,
            curvature_gain: 1.0,
            curvature_offset_1_m: 0.0,
        });
        let text = include_str!("../../../config/robots/rover.toml");
        let robot: Description = toml::from_str(text).unwrap();
        AnswerableFaults::new(&leaves, &actions, &robot, &compensation)
    }

    #[test]
    fn what_is_answered_alone_needs_its_action_and_a_known_counter_steering() {
        let both = answerable(&[RecoveryKind::Compensate, RecoveryKind::IgnoreEncoder]);
        assert!(both.are_singles(LF | LM | RF) && both.are_singles(LF_ENCODER));
        assert!(!both.are_singles(LF | SERVO) && !both.are_singles(1 << 6));
        assert!(!both.are_singles(0));
        let one = answerable(&[RecoveryKind::IgnoreEncoder]);
        assert!(one.are_singles(LF_ENCODER) && !one.are_singles(LF));
        assert!(!both.sets().are_singles(LF_ENCODER));
    }

    #[test]
    fn a_robot_is_driven_home_with_one_stuck_wheel_a_side() {
        let home = answerable(&[]).sets();
        for (set, is_drivable) in [
            (LF | RF, true),
            (LF | RF | LF_ENCODER, true),
            (LF | LF_ENCODER, true),
            (LF | LM, false),
            (LF | SERVO, false),
            (LF | 1 << 6, false),
            (LF, false),
            (0, false),
        ] {
            assert_eq!(home.are_drivable(set), is_drivable, "{set:b}");
        }
    }
}
