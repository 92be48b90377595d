//! Whose miss is it? The machine's, if a canary was late at that time; else Vigil's own.

use vigil_cycle::canary::Late;

use super::cycles::Cycle;

/// Share of a miss by which a canary must have been late.
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
    /// True if a canary was late by half the overrun or more between schedule and end.
    pub is_machine: bool,
}

/// Late wake-ups of one canary, ready to be asked.
#[derive(Debug, Clone)]
pub struct Record<'a> {
    late: &'a [Late],
    longest_ns: u64,
}

impl<'a> Record<'a> {
    /// Of late wake-ups in the order of their schedule.
    #[must_use]
    pub fn new(late: &'a [Late]) -> Self {
        let longest_ns = late.iter().map(|l| l.late_ns).max().unwrap_or(0);
        Self { late, longest_ns }
    }

    /// True if the core was late by at least `ns` at some time from `from_ns` to `to_ns`.
    #[must_use]
    pub fn was_late(&self, from_ns: u64, to_ns: u64, ns: u64) -> bool {
        let earliest_ns = from_ns.saturating_sub(self.longest_ns);
        let first = self
            .late
            .partition_point(|late| late.t_schedule_ns < earliest_ns);
        let about = self.late[first..].iter();
        about
            .take_while(|late| late.t_schedule_ns <= to_ns)
            .any(|late| late.late_ns >= ns && late.t_schedule_ns + late.late_ns >= from_ns)
    }
}

/// The cycles done more than `deadline_ns` after their schedule, each attributed.
#[must_use]
pub fn misses(cycles: &[Cycle], deadline_ns: u64, canaries: &[Record<'_>]) -> Vec<Miss> {
    let miss = |cycle: &Cycle| {
        let overrun_ns = cycle
            .end_to_end_ns()
            .checked_sub(deadline_ns)
            .filter(|overrun| *overrun > 0)?;
        let half_ns = (SHARE * overrun_ns as f64) as u64;
        let (from_ns, to_ns) = (cycle.t_schedule_ns, cycle.t_done_ns);
        let was_late = |canary: &Record<'_>| canary.was_late(from_ns, to_ns, half_ns);
        Some(Miss {
            t_schedule_ns: from_ns,
            t_done_ns: to_ns,
            overrun_ns,
            is_machine: canaries.iter().any(was_late),
        })
    };
    cycles.iter().filter_map(miss).collect()
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
    fn a_miss_is_the_machines_only_if_a_canary_was_late_enough_in_its_time() {
        let late = |t_schedule_ns, late_ns| Late {
            t_schedule_ns,
            late_ns,
        };
        let first = [late(1_000, 600), late(50_000, 4_000)];
        let second = [late(30_000, 100)];
        let canaries = [Record::new(&first), Record::new(&second)];
        let cycles = [
            cycle(0, 900),        // in time
            cycle(1_500, 2_000),  // 1000 over; the canary was 600 late until 1600
            cycle(10_000, 2_000), // nobody was late
            cycle(29_000, 2_000), // a canary was late, by too little
            cycle(53_000, 3_000), // the end of a long stall
            cycle(55_000, 3_000), // after it
        ];
        let found = misses(&cycles, 1_000, &canaries);
        let told: Vec<_> = found
            .iter()
            .map(|m| (m.t_schedule_ns, m.overrun_ns, m.is_machine))
            .collect();
        let expected = [
            (1_500, 1_000, true),
            (10_000, 1_000, false),
            (29_000, 1_000, false),
            (53_000, 2_000, true),
            (55_000, 2_000, false),
        ];
        assert_eq!(told, expected);
    }
}
