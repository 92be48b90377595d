//! Why a block from outside a service was refused.

/// Capacity of the counters of refused blocks, one for each [`Rejection`].
pub const REJECTIONS: usize = 16;

/// Why a block was refused at a service's border. The value is the index of its counter in
/// [`crate::Health::rejected`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
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
}

impl Rejection {
    /// All of them, in the order of their counters.
    pub const ALL: [Self; 15] = [
        Self::Schema,
        Self::NoEpoch,
        Self::OtherWriter,
        Self::Repeated,
        Self::WrongSequence,
        Self::Ahead,
        Self::Behind,
        Self::Early,
        Self::NotFinite,
        Self::OutOfRange,
        Self::Jump,
        Self::Quarantined,
        Self::Malformed,
        Self::Corrupt,
        Self::Clock,
    ];

    /// Name, as in reports.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Schema => "schema",
            Self::NoEpoch => "no-epoch",
            Self::OtherWriter => "other-writer",
            Self::Repeated => "repeated",
            Self::WrongSequence => "wrong-sequence",
            Self::Ahead => "ahead",
            Self::Behind => "behind",
            Self::Early => "early",
            Self::NotFinite => "not-finite",
            Self::OutOfRange => "out-of-range",
            Self::Jump => "jump",
            Self::Quarantined => "quarantined",
            Self::Malformed => "malformed",
            Self::Corrupt => "corrupt",
            Self::Clock => "clock",
        }
    }

    /// The rejection behind an event's code, if this version knows it.
    #[must_use]
    pub fn from_wire(value: u32) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
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
        for (i, rejection) in Rejection::ALL.into_iter().enumerate() {
            assert_eq!(rejection as usize, i);
            assert!(i < REJECTIONS);
            assert_eq!(Rejection::from_wire(i as u32), Some(rejection));
        }
        assert_eq!(Rejection::from_wire(Rejection::ALL.len() as u32), None);
    }
}
