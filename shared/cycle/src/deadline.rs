//! Exact deadline accounting from the schedule.
//!
//! The sensor's schedule is a grid of instants, one period apart. Every instant owes one block,
//! published no later than `deadline` after it. The monitor decides each instant once: by the
//! publication that answers it, or by the clock when its deadline has passed. It counts by the
//! clock, not by time-outs, so a late input cannot mask a miss; and latencies are recorded for
//! every instant, also those that only a later block answered (no coordinated omission).

use crate::latency::Latency;

/// Most schedule instants that one gap may account for, 100 s at 1 kHz; a larger gap re-anchors the
/// grid, so that no block makes a cycle loop for long.
pub(crate) const GAP_INSTANTS_MAX: u64 = 100_000;

/// When a service's cycles are due, and how long they may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Schedule {
    /// Period, ns.
    pub period_ns: u64,
    /// Deadline of a publication after its scheduled instant, ns.
    pub deadline_ns: u64,
    /// Budget of one cycle, from wake-up to publication, ns.
    pub budget_ns: u64,
}

/// Accounts scheduled instants of one service.
#[derive(Debug, Clone)]
pub struct DeadlineMonitor {
    period_ns: u64,
    deadline_ns: u64,
    /// First instant that is neither answered in time nor counted as missed.
    undecided_ns: Option<u64>,
    /// First instant that no publication has answered.
    unanswered_ns: u64,
    /// First and last instant accounted.
    accounted_ns: [u64; 2],
    missed: u64,
}

impl DeadlineMonitor {
    /// A monitor for this schedule.
    #[must_use]
    pub const fn new(schedule: Schedule) -> Self {
        let period_ns = schedule.period_ns;
        Self {
            period_ns: if period_ns == 0 { 1 } else { period_ns },
            deadline_ns: schedule.deadline_ns,
            undecided_ns: None,
            unanswered_ns: 0,
            accounted_ns: [0; 2],
            missed: 0,
        }
    }

    /// Counts the instants whose deadline passed before `now_ns`; returns how many are new.
    pub fn overdue(&mut self, now_ns: u64) -> u64 {
        let Some(undecided) = self.undecided_ns else {
            return 0;
        };
        let Some(late_ns) = now_ns.checked_sub(undecided + self.deadline_ns + 1) else {
            return 0;
        };
        let count = late_ns / self.period_ns + 1;
        self.missed += count;
        let last_ns = undecided + (count - 1) * self.period_ns;
        self.account(last_ns, last_ns + self.period_ns);
        count
    }

    /// Accounts a block for the instant `schedule_ns`, published at `publish_ns`; returns how many
    /// instants it reveals as missed. Records the latency of every instant that it answers.
    pub fn published(&mut self, schedule_ns: u64, publish_ns: u64, latency: &mut Latency) -> u64 {
        let first = match self.undecided_ns {
            None => {
                self.unanswered_ns = schedule_ns;
                self.accounted_ns = [schedule_ns; 2];
                schedule_ns
            }
            Some(undecided) => undecided,
        };
        self.answer(schedule_ns, publish_ns, latency);
        let missed_before = self.missed;
        // A block counts for the nearest instant: an outside schedule drifts against the grid.
        if schedule_ns + self.period_ns / 2 >= first {
            let skipped = (schedule_ns + self.period_ns / 2 - first) / self.period_ns;
            if skipped <= GAP_INSTANTS_MAX {
                for instant in (0..skipped).map(|i| first + i * self.period_ns) {
                    self.missed += u64::from(publish_ns > instant + self.deadline_ns);
                }
            }
            self.missed += u64::from(publish_ns > schedule_ns + self.deadline_ns);
            self.account(schedule_ns, schedule_ns + self.period_ns);
        } else {
            // The clock has counted this instant; but a source that starts anew may have moved its
            // grid. The next instant is the first of the new grid that is nearer to the one after
            // the last accounted than to that itself: none is decided twice, however often the
            // grid moves.
            let last_ns = self.last_accounted_ns();
            let ahead_ns = (last_ns + self.period_ns / 2).saturating_sub(schedule_ns);
            let steps = ahead_ns.div_ceil(self.period_ns).max(1);
            self.account(last_ns, schedule_ns + steps * self.period_ns);
        }
        self.missed - missed_before
    }

    /// Every instant up to `last_ns` is decided; the next is `next_ns`.
    fn account(&mut self, last_ns: u64, next_ns: u64) {
        let [first_ns, before_ns] = self.accounted_ns;
        assert!(
            first_ns <= before_ns && before_ns <= last_ns,
            "accounted instants never go back: {last_ns} after {before_ns} ns"
        );
        assert!(
            next_ns >= last_ns + self.period_ns / 2,
            "an instant is decided once: {next_ns} is to follow {last_ns} ns"
        );
        self.accounted_ns[1] = last_ns;
        self.undecided_ns = Some(next_ns);
    }

    /// Records the latencies of the instants up to `schedule_ns` that nothing answered before.
    fn answer(&mut self, schedule_ns: u64, publish_ns: u64, latency: &mut Latency) {
        if schedule_ns + self.period_ns / 2 < self.unanswered_ns {
            // An instant that a block has answered already.
            return;
        }
        let skipped = (schedule_ns + self.period_ns / 2 - self.unanswered_ns) / self.period_ns;
        if skipped <= GAP_INSTANTS_MAX {
            for instant in (0..skipped).map(|i| self.unanswered_ns + i * self.period_ns) {
                latency.record(publish_ns.saturating_sub(instant));
            }
        }
        latency.record(publish_ns.saturating_sub(schedule_ns));
        self.unanswered_ns = schedule_ns + self.period_ns;
    }

    /// The next deadline, ns; `None` before the first block.
    #[must_use]
    pub fn next_deadline_ns(&self) -> Option<u64> {
        self.undecided_ns.map(|instant| instant + self.deadline_ns)
    }

    /// Schedule instant of the last miss or publication that was accounted.
    #[must_use]
    pub const fn last_accounted_ns(&self) -> u64 {
        self.accounted_ns[1]
    }

    /// First and last instant accounted so far.
    #[must_use]
    pub const fn accounted_ns(&self) -> [u64; 2] {
        self.accounted_ns
    }

    /// Instants missed so far.
    #[must_use]
    pub const fn missed(&self) -> u64 {
        self.missed
    }

    /// Period of the schedule, ns.
    #[must_use]
    pub const fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Deadline after each instant, ns.
    #[must_use]
    pub const fn deadline_ns(&self) -> u64 {
        self.deadline_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const P: u64 = 1000;
    const D: u64 = 400;

    fn monitor() -> (DeadlineMonitor, Latency) {
        let schedule = Schedule {
            period_ns: P,
            deadline_ns: D,
            budget_ns: P,
        };
        (DeadlineMonitor::new(schedule), Latency::new().unwrap())
    }

    #[test]
    fn a_block_exactly_on_its_deadline_is_in_time_and_one_ns_later_is_not() {
        let (mut m, mut l) = monitor();
        assert_eq!(m.published(10 * P, 10 * P + D, &mut l), 0);
        assert_eq!(m.overdue(11 * P + D), 0);
        assert_eq!(m.published(11 * P, 11 * P + D + 1, &mut l), 1);
        assert_eq!(m.missed(), 1);
    }

    #[test]
    fn silence_is_counted_once_per_instant_however_often_one_asks() {
        let (mut m, mut l) = monitor();
        assert_eq!(
            m.overdue(1_000_000),
            0,
            "no deadline before the first block"
        );
        m.published(0, 10, &mut l);
        assert_eq!(m.overdue(P + D), 0);
        assert_eq!(m.overdue(P + D + 1), 1);
        assert_eq!(m.overdue(P + D + 2), 0);
        assert_eq!(m.overdue(5 * P + D + 1), 4);
        assert_eq!(m.missed(), 5);
    }

    #[test]
    fn a_late_block_does_not_count_twice_and_does_not_move_the_grid_back() {
        let (mut m, mut l) = monitor();
        m.published(0, 10, &mut l);
        assert_eq!(m.overdue(2 * P + D + 1), 2);
        assert_eq!(
            m.published(P, 2 * P + 500, &mut l),
            0,
            "instant P was counted by the clock"
        );
        assert_eq!(m.next_deadline_ns(), Some(3 * P + D));
    }

    #[test]
    fn an_instant_that_only_a_later_block_answers_has_the_whole_latency() {
        let (mut m, mut l) = monitor();
        m.published(0, 10, &mut l);
        // The source slept through instants 1000 and 2000.
        assert_eq!(m.published(3 * P, 3 * P + 10, &mut l), 2);
        let p = l.percentiles();
        assert_eq!((p.n, p.max_ns), (4, 2 * P + 10));
    }

    #[test]
    fn whatever_the_phase_after_a_restart_nothing_more_is_missed() {
        for deadline_ns in [100, 200, 400, 500, 700, 950] {
            for phase_ns in (0..P).step_by(10) {
                let (mut m, mut l) = (
                    DeadlineMonitor::new(Schedule {
                        period_ns: P,
                        deadline_ns,
                        budget_ns: P,
                    }),
                    Latency::new().unwrap(),
                );
                m.published(0, 10, &mut l);
                // The monitor looks at each deadline, and when a block comes.
                let mut missed_ns = 0;
                for now_ns in (10..60 * P).step_by(10) {
                    let schedule_ns = now_ns - 10;
                    let is_due = now_ns > 3 * P && schedule_ns % P == phase_ns;
                    let mut missed = m.overdue(now_ns);
                    if is_due {
                        missed += m.published(schedule_ns, now_ns, &mut l);
                    }
                    if missed > 0 {
                        missed_ns = now_ns;
                    }
                }
                assert!(
                    missed_ns < 5 * P,
                    "{deadline_ns} {phase_ns}: at {missed_ns}"
                );
            }
        }
    }

    #[test]
    fn a_schedule_with_another_phase_after_a_restart_is_followed() {
        let (mut m, mut l) = monitor();
        m.published(0, 10, &mut l);
        assert_eq!(m.overdue(3 * P + D + 1), 3);
        // The restarted source is due at 3700: nearer to instant 4000 than to 3000.
        assert_eq!(m.published(3 * P + 700, 3 * P + 710, &mut l), 0);
        assert_eq!(m.next_deadline_ns(), Some(4 * P + 700 + D));
    }

    #[test]
    fn a_grid_that_moves_again_and_again_decides_no_instant_twice() {
        let (mut m, mut l) = monitor();
        m.published(0, 10, &mut l);
        assert_eq!(m.overdue(40 * P + D + 1), 40);
        // Late blocks, each half a period off the grid of the one before.
        for half in 1..70 {
            m.published(half * P / 2, 40 * P + D + 2, &mut l);
        }
        assert_eq!(m.overdue(40 * P + D + 3), 0);
        assert_eq!((m.missed(), m.last_accounted_ns()), (40, 40 * P));
    }

    #[test]
    #[should_panic(expected = "accounted instants never go back")]
    fn an_account_that_goes_back_is_found() {
        let (mut m, mut l) = monitor();
        m.published(0, 10, &mut l);
        m.accounted_ns[1] = 9 * P;
        m.published(P, P + 10, &mut l);
    }

    #[test]
    #[should_panic(expected = "an instant is decided once")]
    fn an_instant_that_would_be_decided_twice_is_found() {
        let (mut m, mut l) = monitor();
        m.published(0, 10, &mut l);
        m.account(5 * P, 5 * P);
    }
}
