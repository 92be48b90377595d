//! Why a block from outside a service was refused.

use strum::{FromRepr, IntoStaticStr, VariantArray};

/// Capacity of the counters of refused blocks, one for each [`Rejection`].
pub const REJECTIONS: usize = 16;

/// Why a block was refused at a service's border. The value is the index of its counter in
/// [`crate::Health::rejected`].
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, FromRepr, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "kebab-case")]
#[repr(u32)]
pub enum Rejection {
    /// Another block, or another version of it.
    Schema = 0,
    /// The writer does not say which start of it this is: epoch 0.
    NoEpoch = 1,
    /// From another writer, or another start of it, while the known one is alive.
    OtherWriter = 2,
    /// Seen before.
    Repeated = 3,
    /// Older than one seen before.
    WrongSequence = 4,
    /// Due in the future by the receiver's clock.
    Ahead = 5,
    /// Due long ago by the receiver's clock.
    Behind = 6,
    /// Sooner after the last one than the schedule allows.
    Early = 7,
    /// A value is not a finite number.
    NotFinite = 8,
    /// A value is beyond all that the robot can do or measure.
    OutOfRange = 9,
    /// The pose is further from the last one than any robot gets in that time.
    Jump = 10,
    /// Good in itself, but too many before it were not.
    Quarantined = 11,
    /// No frame at all: wrong length, mark or version.
    Malformed = 12,
    /// Its checksum does not fit.
    Corrupt = 13,
    /// Its capture time is not after that of the one before it, or leaps.
    Clock = 14,
    /// Its numbers are those of another channel list: another robot, or another description.
    Robot = 15,
}

impl Rejection {
    /// All of them, in the order of their counters.
    pub const ALL: &[Self] = Self::VARIANTS;

    /// Name, as in reports.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        self.into()
    }

    /// True if it speaks against the source: what it sends cannot be trusted. A block that comes
    /// twice or too soon, or from somebody else, does not.
    #[must_use]
    pub const fn is_offence(self) -> bool {
        !matches!(
            self,
            Self::OtherWriter
                | Self::Repeated
                | Self::WrongSequence
                | Self::Early
                | Self::Quarantined
                | Self::Clock
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rejection_has_a_counter_of_its_own() {
        for (i, rejection) in Rejection::ALL.iter().enumerate() {
            assert_eq!(*rejection as usize, i);
            assert!(i < REJECTIONS);
            assert_eq!(Rejection::from_repr(i as u32), Some(*rejection));
        }
        assert_eq!(Rejection::from_repr(Rejection::ALL.len() as u32), None);
    }
}
