//! Injections in the order in which they are due.

use vigil_robot::Injection;
use vigil_robot::injection::Change;

/// Pending injections. Times count from the start of the drive.
#[derive(Debug, Clone, Default)]
pub struct Schedule {
    /// Latest first, so that the next one is at the end.
    pending: Vec<Injection>,
}

impl Schedule {
    /// Orders `injections` by time; equal times keep their order.
    #[must_use]
    pub fn new(mut injections: Vec<Injection>) -> Self {
        injections.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        injections.reverse();
        Self {
            pending: injections,
        }
    }

    /// The next change that is due `elapsed_ns` after the start of the drive. Call until `None`:
    /// several may be due at once.
    pub fn due(&mut self, elapsed_ns: u64) -> Option<Change> {
        let next = self.pending.last()?;
        // Seconds to the nearest ns: exact for any duration that a graph runs.
        if (next.at_s * 1e9).round() > elapsed_ns as f64 {
            return None;
        }
        self.pending.pop().map(|injection| injection.change)
    }
}

#[cfg(test)]
mod tests {
    use vigil_robot::{Fault, FaultKind};

    use super::*;

    fn stuck(wheel: usize, at_s: f64) -> Injection {
        let kind = FaultKind::Stuck;
        Injection {
            change: Change::Inject(Fault { kind, wheel }),
            at_s,
        }
    }

    #[test]
    fn changes_come_in_order_and_only_when_due() {
        let clear = Injection {
            change: Change::Clear(4),
            at_s: 3.5,
        };
        let mut schedule = Schedule::new(vec![stuck(4, 3.5), stuck(0, 0.1), clear]);
        assert_eq!(schedule.due(99_999_999), None);
        assert_eq!(schedule.due(100_000_000), Some(stuck(0, 0.1).change));
        assert_eq!(schedule.due(100_000_000), None);
        assert_eq!(schedule.due(9_000_000_000), Some(stuck(4, 3.5).change));
        assert_eq!(schedule.due(9_000_000_000), Some(Change::Clear(4)));
        assert_eq!(schedule.due(u64::MAX), None);
    }
}
