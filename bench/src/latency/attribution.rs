//! Whose miss is it? The machine's, if canaries were overdue for long enough at that time; else
//! Vigil's own.
//!
//! A stall of the machine can come in one piece or in many, now on one core, now on the other: on a
//! virtual machine whose host takes processors away again and again, every wake-up of a canary is
//! late for tens of milliseconds. The chain passes over all its cores, one after the other, so the
//! time counts in which a canary of any of them was overdue, beyond what nine of ten of its
//! wake-ups keep to; time in which two were counts once. Whether one wake-up alone was late by
//! as much stands beside it. Instants that one answer has ended share its verdict: the first of
//! them says how long it was due.

use super::canary::{CanaryRecord, LateWakeUp};

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
    /// True if canaries were overdue for half the overrun or more between schedule and end.
    pub is_machine: bool,
    /// True if one wake-up of a canary that was overdue in that time was late by as much, all in
    /// all.
    pub is_one_stall: bool,
}

/// Late wake-ups of one canary, ready to be asked.
#[derive(Debug, Clone)]
pub struct Record<'a> {
    late: &'a [LateWakeUp],
    longest_ns: u64,
    /// Lateness that is usual for this canary, ns.
    usual_ns: u64,
}

impl<'a> Record<'a> {
    /// Of what a canary recorded.
    #[must_use]
    pub fn from_canary(canary: &'a CanaryRecord) -> Self {
        Self::new(&canary.late, canary.lateness.percentiles().p90_ns)
    }

    /// Of late wake-ups in the order of their schedule.
    fn new(late: &'a [LateWakeUp], usual_ns: u64) -> Self {
        let longest_ns = late.iter().map(|l| l.late_ns).max().unwrap_or(0);
        Self {
            late,
            longest_ns,
            usual_ns,
        }
    }

    /// Wake-ups that were overdue at some time from `from_ns` to `to_ns`.
    fn about(&self, from_ns: u64, to_ns: u64) -> impl Iterator<Item = &LateWakeUp> {
        let earliest_ns = from_ns.saturating_sub(self.longest_ns);
        let first = self
            .late
            .partition_point(|late| late.t_schedule_ns < earliest_ns);
        let about = self.late[first..].iter();
        about
            .take_while(move |late| late.t_schedule_ns <= to_ns)
            .filter(move |late| late.t_schedule_ns + late.late_ns >= from_ns)
    }

    /// For each wake-up about that time, when of it the canary was overdue beyond what is usual:
    /// from, to, ns.
    fn overdue(&self, from_ns: u64, to_ns: u64) -> impl Iterator<Item = [u64; 2]> {
        self.about(from_ns, to_ns).filter_map(move |late| {
            let begin_ns = (late.t_schedule_ns + self.usual_ns).max(from_ns);
            let end_ns = (late.t_schedule_ns + late.late_ns).min(to_ns);
            (begin_ns < end_ns).then_some([begin_ns, end_ns])
        })
    }
}

/// How long at least one of these stretches of time lasted, ns.
fn covered_ns(mut stretches: Vec<[u64; 2]>) -> u64 {
    stretches.sort_unstable();
    let (mut covered_ns, mut until_ns) = (0, 0);
    for [from_ns, to_ns] in stretches {
        covered_ns += to_ns.saturating_sub(from_ns.max(until_ns));
        until_ns = until_ns.max(to_ns);
    }
    covered_ns
}

/// True if canaries were overdue for longer than `longest_ns` in the time from a cycle's schedule
/// until `window_ns` later. That window is the same for a fast cycle and a slow one: neither is
/// likelier to be left out.
#[must_use]
pub fn was_machine_late(
    cycle: &Cycle,
    window_ns: u64,
    longest_ns: u64,
    canaries: &[Record<'_>],
) -> bool {
    let (from_ns, to_ns) = (cycle.t_schedule_ns, cycle.t_schedule_ns + window_ns);
    let overdue = canaries.iter().flat_map(|c| c.overdue(from_ns, to_ns));
    covered_ns(overdue.collect()) > longest_ns
}

/// The cycles done more than `deadline_ns` after their schedule, each attributed.
#[must_use]
pub fn misses(cycles: &[Cycle], deadline_ns: u64, canaries: &[Record<'_>]) -> Vec<Miss> {
    let overrun_ns = |cycle: &Cycle| cycle.end_to_end_ns().saturating_sub(deadline_ns);
    let mut found = Vec::new();
    for answered in cycles.chunk_by(|a, b| a.t_done_ns == b.t_done_ns) {
        let (first, half_ns) = (answered[0], SHARE * overrun_ns(&answered[0]) as f64);
        let (from_ns, to_ns) = (first.t_schedule_ns, first.t_done_ns);
        let overdue = canaries.iter().flat_map(|c| c.overdue(from_ns, to_ns));
        let overdue: Vec<[u64; 2]> = overdue.collect();
        let mut about = canaries.iter().flat_map(|c| c.about(from_ns, to_ns));
        let is_one_stall = about.any(|late| late.late_ns as f64 >= half_ns);
        let is_machine = covered_ns(overdue) as f64 >= half_ns;
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
            answer_compute_ns: 0,
            stages: None,
        }
    }

    #[test]
    fn a_miss_is_the_machines_only_if_a_canary_was_overdue_long_enough_in_its_time() {
        let late = |t_schedule_ns, late_ns| LateWakeUp {
            t_schedule_ns,
            late_ns,
        };
        let first = [
            late(1_400, 700),
            late(50_000, 4_000),
            late(70_000, 700),
            late(71_000, 700),
            late(72_000, 700),
            late(95_000, 350),
            late(96_000, 350),
        ];
        let second = [
            late(30_000, 150),
            late(70_300, 600),
            late(80_000, 540),
            late(92_000, 650),
            late(95_200, 350),
        ];
        let canaries = [Record::new(&first, 50), Record::new(&second, 50)];
        let cycles = [
            cycle(0, 900),        // in time
            cycle(1_400, 2_000),  // 1000 over; the canary was overdue until 2100
            cycle(10_000, 2_000), // nobody was late
            cycle(29_000, 2_000), // a canary was late, by too little
            cycle(52_000, 3_000), // the end of a long stall
            cycle(55_000, 3_000), // after it
            cycle(69_500, 4_000), // 3000 over, in pieces
            cycle(80_000, 2_000), // enough but for what is usual
            cycle(90_000, 3_500),
            cycle(91_000, 2_500),
            cycle(92_000, 1_500),
            cycle(94_800, 2_701), // 1701 over: 300 + 300 + 300, 100 of them twice
            cycle(94_900, 2_600), // the same of 1600
        ];
        let found = misses(&cycles, 1_000, &canaries);
        let summary: Vec<_> = found
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
            (80_000, 1_000, false, true),
            // One answer for three: 600 are not half of 2_500, though more than half of the last.
            (90_000, 2_500, false, false),
            (91_000, 1_500, false, false),
            (92_000, 500, false, false),
            (94_800, 1_701, false, false),
            (94_900, 1_600, true, false),
        ];
        assert_eq!(summary, expected);
    }
}
