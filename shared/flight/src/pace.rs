//! How often something is written at most.

/// Lets through one message in each slot of time, and what is new at once.
///
/// Slots lie on a grid, so that messages which come a little early do not halve the rate.
#[derive(Debug, Clone)]
pub(crate) struct Pace {
    slot_ns: u64,
    last_slot: Option<u64>,
    last_mark: Option<u64>,
}

impl Pace {
    /// One message in `slot_ns`.
    pub(crate) const fn every_ns(slot_ns: u64) -> Self {
        Self {
            slot_ns,
            last_slot: None,
            last_mark: None,
        }
    }

    /// True if a message of this instant is to be written: the first one of its slot, or one whose
    /// `mark` is not that of the one before.
    pub(crate) fn is_due(&mut self, now_ns: u64, mark: u64) -> bool {
        let slot = Some(now_ns / self.slot_ns);
        let is_due = slot != self.last_slot || Some(mark) != self.last_mark;
        (self.last_slot, self.last_mark) = (slot, Some(mark));
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_a_slot_is_let_through_and_changes_at_once() {
        let mut pace = Pace::every_ns(100);
        assert!(pace.is_due(10, 1));
        assert!(!pace.is_due(99, 1));
        assert!(pace.is_due(100, 1), "another slot, though only 90 later");
        assert!(pace.is_due(101, 2));
        assert!(!pace.is_due(102, 2));
        assert!(pace.is_due(20, 2), "a clock that was set back");
    }
}
