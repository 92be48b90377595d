//! Figures of each state, against the rounds' own halves without a black box.

use serde_json::{Value, json};

use super::drive::{Plan, Run};
use super::half::{Half, State};
use crate::interval::bootstrap;
use crate::quantile;

/// Bytes of a MiB.
const MIB: f64 = (1 << 20) as f64;

impl Run {
    /// The halves of a state, a round each.
    fn halves_in(&self, state: State) -> impl Iterator<Item = &Half> {
        let all = self.halves.iter();
        all.filter(move |half| half.span.state == state)
    }

    fn all(&self, state: State, figure: impl Fn(&Half) -> f64) -> Vec<f64> {
        self.halves_in(state).map(figure).collect()
    }

    fn median(&self, state: State, figure: impl Fn(&Half) -> f64) -> f64 {
        quantile(&mut self.all(state, figure), 0.5)
    }

    /// Geometric mean over the rounds of a percentile over that of the same round without a black
    /// box, and the ends of its interval.
    fn ratio(&self, state: State, percentile: usize) -> [f64; 3] {
        let mut logs = Vec::new();
        for half in self.halves_in(state) {
            let off = self
                .halves_in(State::Off)
                .find(|off| off.span.round == half.span.round);
            let off =
                off.map(|off| (half.latency_us[percentile] / off.latency_us[percentile]).ln());
            logs.extend(off.filter(|log| log.is_finite()));
        }
        bootstrap(&logs).map(f64::exp)
    }

    /// Own misses in 100,000 cycles.
    fn misses(&self, state: State) -> [f64; 3] {
        bootstrap(&self.all(state, Half::own_per_100_000))
    }

    /// Share of a core that the black box takes, %.
    fn cpu_percent(&self, state: State) -> [f64; 3] {
        bootstrap(&self.all(state, |half| 100.0 * half.span.cpu_s / half.seconds()))
    }
}

/// For programs.
#[must_use]
pub fn document(plan: &Plan, run: &Run) -> Value {
    let bounded = |[mean, low, high]: [f64; 3]| json!({"mean": mean, "low": low, "high": high});
    let state = |state: State| {
        let value = json!({
            "p50_us": run.median(state, |half| half.latency_us[0]),
            "p99_us": run.median(state, |half| half.latency_us[1]),
            "p50_over_off": bounded(run.ratio(state, 0)),
            "p99_over_off": bounded(run.ratio(state, 1)),
            "own_misses_per_100_000": bounded(run.misses(state)),
            "cycles": run.halves_in(state).map(|half| half.cycles).sum::<u64>(),
            "own_misses": run.halves_in(state).map(|half| half.own_misses).sum::<u64>(),
            "other_misses": run.halves_in(state).map(|half| half.other_misses).sum::<u64>(),
            "memory_bytes": run.median(state, |half| half.span.memory_bytes as f64),
            "ring_bytes": run.median(state, |half| half.span.ring_bytes as f64),
            "cpu_percent": bounded(run.cpu_percent(state)),
        });
        (state.name().to_owned(), value)
    };
    let states: serde_json::Map<String, Value> = State::ALL.map(state).into_iter().collect();
    let halves: Vec<Value> = run.halves.iter().map(Half::document).collect();
    json!({
        "rate_hz": plan.rate_hz, "seconds": plan.seconds, "rounds": plan.rounds,
        "states": states, "halves": halves,
    })
}

/// For people, a line for each state.
#[must_use]
pub fn table(run: &Run) -> Vec<String> {
    let mut lines = vec![
        "| black box | p50, us | over off | p99, us | over off | own misses in 100,000 | of others \
         | memory, MiB | ring, MiB | of a core, % |"
            .to_owned(),
        "|---|---|---|---|---|---|---|---|---|---|".to_owned(),
    ];
    let bounded = |decimals: usize, [mean, low, high]: [f64; 3]| {
        format!("{mean:.decimals$} [{low:.decimals$}, {high:.decimals$}]")
    };
    lines.extend(State::ALL.map(|state| {
        format!(
            "| {} | {:.1} | {} | {:.1} | {} | {} | {} | {:.1} | {:.0} | {} |",
            state.name(),
            run.median(state, |half| half.latency_us[0]),
            bounded(3, run.ratio(state, 0)),
            run.median(state, |half| half.latency_us[1]),
            bounded(3, run.ratio(state, 1)),
            bounded(1, run.misses(state)),
            run.halves_in(state)
                .map(|half| half.other_misses)
                .sum::<u64>(),
            run.median(state, |half| half.span.memory_bytes as f64 / MIB),
            run.median(state, |half| half.span.ring_bytes as f64 / MIB),
            bounded(1, run.cpu_percent(state)),
        )
    }));
    lines
}
