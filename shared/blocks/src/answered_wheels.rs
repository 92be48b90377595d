//! The wheels that an action is about.

use vigil_checkpoint::CheckpointValue;

use crate::sensor::WHEELS;

/// Wheels whose faults an action answers, as bits in the order of the robot's wheels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, CheckpointValue)]
pub struct AnsweredWheels {
    /// Those that are stuck, against which the robot steers.
    pub stuck: u16,
    /// Those whose encoders are broken, which nobody trusts.
    pub encoders: u16,
}

// The bits of all wheels fit.
const _: () = assert!(WHEELS <= u16::BITS as usize);

impl AnsweredWheels {
    /// One stuck wheel.
    #[must_use]
    pub const fn one_stuck(wheel: usize) -> Self {
        Self {
            stuck: bit(wheel),
            encoders: 0,
        }
    }

    /// One wheel's encoder.
    #[must_use]
    pub const fn one_encoder(wheel: usize) -> Self {
        Self {
            stuck: 0,
            encoders: bit(wheel),
        }
    }

    /// Those of both.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self {
            stuck: self.stuck | other.stuck,
            encoders: self.encoders | other.encoders,
        }
    }

    /// True if it holds no wheel.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.stuck | self.encoders == 0
    }

    /// True if this wheel is stuck.
    #[must_use]
    pub const fn has_stuck(self, wheel: usize) -> bool {
        self.stuck & bit(wheel) != 0
    }

    /// True if this wheel's encoder is broken.
    #[must_use]
    pub const fn has_encoder(self, wheel: usize) -> bool {
        self.encoders & bit(wheel) != 0
    }

    /// Every wheel of either kind, once, in order.
    pub fn wheels(self) -> impl Iterator<Item = usize> {
        (0..WHEELS).filter(move |wheel| self.has_stuck(*wheel) || self.has_encoder(*wheel))
    }

    /// As an event carries it: stuck wheels in the lower 16 bits, encoders above them.
    #[must_use]
    pub const fn to_event(self) -> u64 {
        self.stuck as u64 | (self.encoders as u64) << 16
    }

    /// What an event carries.
    #[must_use]
    pub const fn from_event(value: u64) -> Self {
        Self {
            stuck: value as u16,
            encoders: (value >> 16) as u16,
        }
    }
}

/// No bit for a wheel that there is not.
const fn bit(wheel: usize) -> u16 {
    if wheel < WHEELS { 1 << wheel } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wheels_are_kept_apart_by_what_is_wrong_with_them() {
        let both = AnsweredWheels::one_stuck(4).with(AnsweredWheels::one_encoder(0));
        assert!(both.has_stuck(4) && both.has_encoder(0));
        assert!(!both.has_stuck(0) && !both.has_encoder(4));
        assert_eq!(both.wheels().collect::<Vec<_>>(), [0, 4]);
        assert_eq!(AnsweredWheels::from_event(both.to_event()), both);
        assert_eq!(both.to_event(), 1 << 16 | 1 << 4);
        let same = AnsweredWheels::one_stuck(2).with(AnsweredWheels::one_encoder(2));
        assert_eq!(same.wheels().collect::<Vec<_>>(), [2]);
    }

    #[test]
    fn a_wheel_that_there_is_not_has_no_bit() {
        assert!(AnsweredWheels::one_stuck(WHEELS).is_empty());
        assert!(AnsweredWheels::one_encoder(usize::MAX).is_empty());
        assert!(!AnsweredWheels::from_event(u64::MAX).has_stuck(WHEELS));
    }
}
