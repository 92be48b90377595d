//! Injections in the order in which they are due.

use vigil_robot::injection::{Change, Injection};

/// Pending injections. Times count from the start of the drive.
#[derive(Debug, Clone, Default)]
pub struct InjectionSchedule {
    /// Latest first, so that the next one is at the end.
    pending: Vec<Injection>,
    /// Time of the last change that was handed out, ns.
    last_ns: Option<f64>,
}

impl InjectionSchedule {
    /// Orders `injections` by time; equal times keep their order.
    #[must_use]
    pub fn new(mut injections: Vec<Injection>) -> Self {
        injections.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        injections.reverse();
        Self {
            pending: injections,
            last_ns: None,
        }
    }

    /// The next change that is due `elapsed_ns` after the start of the drive. Call until `None`:
    /// several may be due at once.
    pub fn due(&mut self, elapsed_ns: u64) -> Option<Change> {
        // Seconds to the nearest ns: exact for any duration that a graph runs.
        let due_ns = (self.pending.last()?.at_s * 1e9).round();
        if due_ns > elapsed_ns as f64 {
            return None;
        }
        assert!(
            self.last_ns
                .is_none_or(|last_ns| due_ns.total_cmp(&last_ns).is_ge()),
            "injections are due in the order of their times"
        );
        self.last_ns = Some(due_ns);
        self.pending.pop().map(|injection| injection.change)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
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
        let mut schedule = InjectionSchedule::new(vec![stuck(4, 3.5), stuck(0, 0.1), clear]);
        assert_eq!(schedule.due(99_999_999), None);
        assert_eq!(schedule.due(100_000_000), Some(stuck(0, 0.1).change));
        assert_eq!(schedule.due(100_000_000), None);
        assert_eq!(schedule.due(9_000_000_000), Some(stuck(4, 3.5).change));
        assert_eq!(schedule.due(9_000_000_000), Some(Change::Clear(4)));
        assert_eq!(schedule.due(u64::MAX), None);
    }

    #[test]
    #[should_panic(expected = "injections are due in the order of their times")]
    fn a_change_before_the_last_one_would_end_the_process() {
        let mut schedule = InjectionSchedule::new(vec![stuck(0, 2.0), stuck(1, 1.0)]);
        schedule.pending.reverse();
        while schedule.due(u64::MAX).is_some() {}
    }

    proptest! {
        #[test]
        fn any_injections_come_in_order(
            times_s in proptest::collection::vec(0.0..1e300_f64, 0..20),
            mut now_ns in proptest::collection::vec(any::<u64>(), 1..20),
        ) {
            let all = times_s.iter().enumerate().map(|(wheel, &at_s)| stuck(wheel, at_s));
            let mut schedule = InjectionSchedule::new(all.collect());
            // Also if the clock goes back.
            now_ns.push(0);
            let mut last_s = 0.0;
            for now_ns in now_ns {
                while let Some(Change::Inject(fault)) = schedule.due(now_ns) {
                    let at_s = times_s[fault.wheel];
                    prop_assert!(at_s >= last_s && at_s <= now_ns as f64 * 1e-9 + 1e-9);
                    last_s = at_s;
                }
            }
        }
    }
}
