//! A stretch of time in which the black box is in one state.

use serde_json::{Value, json};

use crate::latency::cycles::Cycle;
use crate::quantile;

/// What the black box does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// There is none.
    Off,
    /// It runs.
    On,
    /// It is stopped (SIGSTOP) at the beginning, and goes on at the end.
    Stopped,
    /// It is killed (SIGKILL) at the beginning; another one rescues what it kept, and goes on.
    Killed,
}

impl State {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Off, Self::On, Self::Stopped, Self::Killed];

    /// Its name in results.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::On => "on",
            Self::Stopped => "stopped",
            Self::Killed => "killed",
        }
    }

    /// The order in a round: each round begins with another state, and every second one is turned
    /// round.
    #[must_use]
    pub fn order(round: usize) -> [Self; 4] {
        let mut order = Self::ALL;
        order.rotate_left(round / 2 % Self::ALL.len());
        if round % 2 == 1 {
            order.reverse();
        }
        order
    }
}

/// When it was so, and what the black box took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Of which round.
    pub round: usize,
    /// In which state.
    pub state: State,
    /// From when on, ns.
    pub from_ns: u64,
    /// Until when, ns.
    pub until_ns: u64,
    /// Its memory at the end, bytes.
    pub memory_bytes: u64,
    /// Its ring at the end, bytes.
    pub ring_bytes: u64,
    /// Its computing time, s.
    pub cpu_s: f64,
}

/// What the services did meanwhile.
#[derive(Debug, Clone, PartialEq)]
pub struct Half {
    /// When.
    pub span: Span,
    /// Instants of the schedule.
    pub cycles: u64,
    /// Instants in whose cycle the machine was late, as canaries say.
    pub machine_late: u64,
    /// From the schedule to the action, us, of cycles in which it was on time: p50 and p99.
    pub latency_us: [f64; 2],
    /// The same of all cycles.
    pub latency_of_all_us: [f64; 2],
    /// Instants past the last deadline although their frame was in time, and which are not the
    /// machine's.
    pub own_misses: u64,
    /// Others past the last deadline.
    pub other_misses: u64,
}

/// Deadlines after the schedule, ns.
#[derive(Debug, Clone, Copy)]
pub struct Deadlines {
    /// Of the frame.
    pub frame_ns: u64,
    /// Of the action.
    pub action_ns: u64,
}

/// What is asked of each cycle.
#[derive(Debug, Clone, Copy)]
pub struct Asked<P, L, M> {
    /// When the frame of an instant was published, ns.
    pub was_published: P,
    /// Whether the machine was late in a cycle.
    pub was_late: L,
    /// Whether the miss of an instant is the machine's.
    pub is_of_machine: M,
}

impl Half {
    /// Of the cycles that were due in a span; `cycles` is in order.
    pub fn new<P, L, M>(
        span: Span,
        cycles: &[Cycle],
        deadlines: Deadlines,
        asked: &Asked<P, L, M>,
    ) -> Self
    where
        P: Fn(u64) -> Option<u64>,
        L: Fn(&Cycle) -> bool,
        M: Fn(u64) -> bool,
    {
        let begin = cycles.partition_point(|cycle| cycle.t_schedule_ns < span.from_ns);
        let end = cycles.partition_point(|cycle| cycle.t_schedule_ns < span.until_ns);
        let own = &cycles[begin..end.max(begin)];
        let percentiles_us = |cycles: &[&Cycle]| {
            let took_us = cycles
                .iter()
                .map(|cycle| cycle.end_to_end_ns() as f64 * 1e-3);
            let mut took_us: Vec<f64> = took_us.collect();
            [0.5, 0.99].map(|q| quantile(&mut took_us, q))
        };
        let all: Vec<&Cycle> = own.iter().collect();
        let in_time: Vec<&Cycle> = own
            .iter()
            .filter(|cycle| !(asked.was_late)(cycle))
            .collect();
        let missed = own
            .iter()
            .filter(|cycle| cycle.end_to_end_ns() > deadlines.action_ns);
        let is_own = |cycle: &&Cycle| {
            let published_ns = (asked.was_published)(cycle.t_schedule_ns);
            let is_frame_in_time =
                published_ns.is_some_and(|at_ns| at_ns <= cycle.t_schedule_ns + deadlines.frame_ns);
            is_frame_in_time && !(asked.is_of_machine)(cycle.t_schedule_ns)
        };
        let missed: Vec<&Cycle> = missed.collect();
        let own_misses = missed.iter().copied().filter(is_own).count() as u64;
        Self {
            span,
            cycles: own.len() as u64,
            machine_late: (all.len() - in_time.len()) as u64,
            latency_us: percentiles_us(&in_time),
            latency_of_all_us: percentiles_us(&all),
            own_misses,
            other_misses: missed.len() as u64 - own_misses,
        }
    }

    /// Seconds that it lasted.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.span.until_ns.saturating_sub(self.span.from_ns) as f64 * 1e-9
    }

    /// Share of cycles in which the machine was late, %.
    #[must_use]
    pub fn machine_late_percent(&self) -> f64 {
        100.0 * self.machine_late as f64 / self.cycles.max(1) as f64
    }

    /// Own misses in 100,000 cycles.
    #[must_use]
    pub fn own_per_100_000(&self) -> f64 {
        1e5 * self.own_misses as f64 / self.cycles.max(1) as f64
    }

    /// For programs.
    #[must_use]
    pub fn document(&self) -> Value {
        let [p50_us, p99_us] = self.latency_us;
        let [all_p50_us, all_p99_us] = self.latency_of_all_us;
        json!({
            "round": self.span.round, "state": self.span.state.name(), "cycles": self.cycles,
            "p50_us": p50_us, "p99_us": p99_us, "all_p50_us": all_p50_us,
            "all_p99_us": all_p99_us, "machine_late": self.machine_late,
            "own_misses": self.own_misses,
            "other_misses": self.other_misses, "memory_bytes": self.span.memory_bytes,
            "ring_bytes": self.span.ring_bytes, "cpu_s": self.span.cpu_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_state_comes_at_each_place_of_a_round_equally_often() {
        for place in 0..4 {
            let mut met: Vec<State> = (0..8).map(|round| State::order(round)[place]).collect();
            met.sort();
            let each: Vec<State> = State::ALL.iter().flat_map(|state| [*state; 2]).collect();
            assert_eq!(met, each, "place {place}");
        }
    }

    #[test]
    fn a_late_frame_is_the_publishers_and_only_the_spans_cycles_count() {
        let cycle = |t_schedule_ns, took_ns| Cycle {
            t_schedule_ns,
            t_done_ns: t_schedule_ns + took_ns,
            answer_compute_ns: 0,
            stages: None,
        };
        let cycles = [
            cycle(0, 900),
            cycle(1000, 50),
            cycle(2000, 700),
            cycle(3000, 600),
        ];
        let span = Span {
            round: 0,
            state: State::On,
            from_ns: 1000,
            until_ns: 4000,
            memory_bytes: 0,
            ring_bytes: 0,
            cpu_s: 0.0,
        };
        let deadlines = Deadlines {
            frame_ns: 100,
            action_ns: 500,
        };
        let late = |at_ns| Some(at_ns + if at_ns == 3000 { 400 } else { 10 });
        let asked = Asked {
            was_published: late,
            was_late: |_: &Cycle| false,
            is_of_machine: |_| false,
        };
        let half = Half::new(span, &cycles, deadlines, &asked);
        assert_eq!((half.cycles, half.own_misses, half.other_misses), (3, 1, 1));
        assert_eq!(half.latency_us[0], 0.6);
        assert_eq!(
            (half.latency_of_all_us, half.machine_late),
            (half.latency_us, 0)
        );
        let asked = Asked {
            was_published: late,
            was_late: |cycle: &Cycle| cycle.t_schedule_ns == 2000,
            is_of_machine: |at_ns| at_ns == 2000,
        };
        let half = Half::new(span, &cycles, deadlines, &asked);
        assert_eq!((half.cycles, half.own_misses, half.other_misses), (3, 0, 2));
        assert_eq!(half.machine_late, 1);
        let p99_us = [half.latency_us[1], half.latency_of_all_us[1]];
        assert!((p99_us[0] - 0.6).abs() < 1e-9 && (p99_us[1] - 0.7).abs() < 1e-9);
        let asked = Asked {
            was_published: |_| None,
            was_late: |_: &Cycle| false,
            is_of_machine: |_| false,
        };
        let never = Half::new(span, &cycles, deadlines, &asked);
        assert_eq!((never.own_misses, never.other_misses), (0, 2));
    }
}
