//! Whose miss is it? The machine's, if a canary was overdue for long enough at that time; else
//! Vigil's own.
//!
//! A stall of the machine can come in one piece or in many: on a virtual machine whose host takes
//! the processor away again and again, every wake-up of a canary is a millisecond late for tens of
//! milliseconds. So the time counts in which a canary was overdue, beyond what nine of ten of its
//! wake-ups keep to; that one wake-up alone was overdue for as long is told beside it. Instants
//! that one answer has ended share its verdict: the first of them says how long it was due.

use vigil_cycle::canary::{Late, Seen};

use super::cycles::Cycle;

/// Share of a miss for which a canary must have been overdue.
const SHARE: f64 = 0.5;

/// A missed cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Miss {
    /// When it was due, ns.
    pub t_schedule_ns: u64,
    /// When it was done, ns.
    pub t_done_ns: u64,
    /// How far past its deadline, ns.
    pub overrun_ns: u64,
    /// True if a canary was overdue for half the overrun or more between schedule and end.
    pub is_machine: bool,
    /// True if one wake-up of a canary in that time was late by as much.
    pub is_one_stall: bool,
}

/// Late wake-ups of one canary, ready to be asked.
#[derive(Debug, Clone)]
pub struct Record<'a> {
    late: &'a [Late],
    longest_ns: u64,
    /// Lateness that is usual for this canary, ns.
    usual_ns: u64,
}

impl<'a> Record<'a> {
    /// Of what a canary has seen.
    #[must_use]
    pub fn of(seen: &'a Seen) -> Self {
        Self::new(&seen.late, seen.lateness.percentiles().p90_ns)
    }

    /// Of late wake-ups in the order of their schedule.
    fn new(late: &'a [Late], usual_ns: u64) -> Self {
        let longest_ns = late.iter().map(|l| l.late_ns).max().unwrap_or(0);
        Self {
            late,
            longest_ns,
            usual_ns,
        }
    }

    /// Wake-ups that were overdue at some time from `from_ns` to `to_ns`.
    fn about(&self, from_ns: u64, to_ns: u64) -> impl Iterator<Item = &Late> {
        let earliest_ns = from_ns.saturating_sub(self.longest_ns);
        let first = self
            .late
            .partition_point(|late| late.t_schedule_ns < earliest_ns);
        let about = self.late[first..].iter();
        about
            .take_while(move |late| late.t_schedule_ns <= to_ns)
            .filter(move |late| late.t_schedule_ns + late.late_ns >= from_ns)
    }

    /// For each wake-up about that time, how long of it the canary was overdue beyond what is
    /// usual, ns.
    fn overdue_ns(&self, from_ns: u64, to_ns: u64) -> impl Iterator<Item = u64> {
        self.about(from_ns, to_ns).map(move |late| {
            let begin_ns = (late.t_schedule_ns + self.usual_ns).max(from_ns);
            let end_ns = (late.t_schedule_ns + late.late_ns).min(to_ns);
            end_ns.saturating_sub(begin_ns)
        })
    }
}

/// The cycles done more than `deadline_ns` after their schedule, each attributed.
#[must_use]
pub fn misses(cycles: &[Cycle], deadline_ns: u64, canaries: &[Record<'_>]) -> Vec<Miss> {
    let overrun_ns = |cycle: &Cycle| cycle.end_to_end_ns().saturating_sub(deadline_ns);
    let mut found = Vec::new();
    for answered in cycles.chunk_by(|a, b| a.t_done_ns == b.t_done_ns) {
        let (first, half_ns) = (answered[0], SHARE * overrun_ns(&answered[0]) as f64);
        let (from_ns, to_ns) = (first.t_schedule_ns, first.t_done_ns);
        let overdue = |canary: &Record<'_>| canary.overdue_ns(from_ns, to_ns).sum::<u64>();
        let longest = |canary: &Record<'_>| canary.overdue_ns(from_ns, to_ns).max().unwrap_or(0);
        let is_machine = canaries.iter().any(|c| overdue(c) as f64 >= half_ns);
        let is_one_stall = canaries.iter().any(|c| longest(c) as f64 >= half_ns);
        let late = answered.iter().filter(|cycle| overrun_ns(cycle) > 0);
        found.extend(late.map(|cycle| Miss {
            t_schedule_ns: cycle.t_schedule_ns,
            t_done_ns: cycle.t_done_ns,
            overrun_ns: overrun_ns(cycle),
            is_machine,
            is_one_stall,
        }));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycle(t_schedule_ns: u64, took_ns: u64) -> Cycle {
        Cycle {
            t_schedule_ns,
            t_done_ns: t_schedule_ns + took_ns,
            stages: None,
        }
    }

    #[test]
    fn a_miss_is_the_machines_only_if_a_canary_was_overdue_long_enough_in_its_time() {
        let late = |t_schedule_ns, late_ns| Late {
            t_schedule_ns,
            late_ns,
        };
        let first = [
            late(1_400, 700),
            late(50_000, 4_000),
            late(70_000, 700),
            late(71_000, 700),
            late(72_000, 700),
        ];
        let second = [late(30_000, 150), late(80_000, 540), late(92_000, 650)];
        let canaries = [Record::new(&first, 50), Record::new(&second, 50)];
        let cycles = [
            cycle(0, 900),        // in time
            cycle(1_400, 2_000),  // 1000 over; the canary was overdue until 2100
            cycle(10_000, 2_000), // nobody was late
            cycle(29_000, 2_000), // a canary was late, by too little
            cycle(52_000, 3_000), // the end of a long stall
            cycle(55_000, 3_000), // after it
            cycle(69_500, 4_000), // 3000 over, in three pieces
            cycle(80_000, 2_000), // enough but for what is usual
            cycle(90_000, 3_500),
            cycle(91_000, 2_500),
            cycle(92_000, 1_500),
        ];
        let found = misses(&cycles, 1_000, &canaries);
        let told: Vec<_> = found
            .iter()
            .map(|m| (m.t_schedule_ns, m.overrun_ns, m.is_machine, m.is_one_stall))
            .collect();
        let expected = [
            (1_400, 1_000, true, true),
            (10_000, 1_000, false, false),
            (29_000, 1_000, false, false),
            (52_000, 2_000, true, true),
            (55_000, 2_000, false, false),
            (69_500, 3_000, true, false),
            (80_000, 1_000, false, false),
            // One answer for three: 600 are not half of 2_500, though more than half of the last.
            (90_000, 2_500, false, false),
            (91_000, 1_500, false, false),
            (92_000, 500, false, false),
        ];
        assert_eq!(told, expected);
    }
}
