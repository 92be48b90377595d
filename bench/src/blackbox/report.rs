//! Figures of each state, against the rounds' own halves without a black box.

use serde_json::{Value, json};

use super::drive::{Plan, Run};
use super::half::{Half, State};
use crate::interval::bootstrap;
use crate::quantile;

/// Largest ratio of a percentile with a black box to that without one.
const RATIO_MAX: f64 = 1.05;
/// Largest number of further own misses in 100,000 cycles.
const MISSES_MORE_MAX: f64 = 1.0;
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

    /// What a state's halves have more than those of the same rounds without a black box: the
    /// mean over the rounds, and the ends of its interval.
    fn more(&self, state: State, figure: impl Fn(&Half) -> f64) -> [f64; 3] {
        let differences = self.halves_in(state).filter_map(|half| {
            let mut offs = self.halves_in(State::Off);
            let off = offs.find(|off| off.span.round == half.span.round)?;
            Some(figure(half) - figure(off)).filter(|difference| difference.is_finite())
        });
        bootstrap(&differences.collect::<Vec<_>>())
    }

    /// Geometric mean over the rounds of a percentile over that of the same round without a black
    /// box, and the ends of its interval.
    fn ratio(&self, state: State, percentile: usize) -> [f64; 3] {
        let logs = self.more(state, |half| half.latency_us[percentile].ln());
        logs.map(f64::exp)
    }

    /// The same of all cycles, whatever the machine did.
    fn ratio_of_all(&self, state: State, percentile: usize) -> [f64; 3] {
        let logs = self.more(state, |half| half.latency_of_all_us[percentile].ln());
        logs.map(f64::exp)
    }

    /// Share of cycles in which the machine was late, %, more than in the same round without a
    /// black box.
    fn machine_late_more(&self, state: State) -> [f64; 3] {
        self.more(state, Half::machine_late_percent)
    }

    /// Own misses in 100,000 cycles.
    fn misses(&self, state: State) -> [f64; 3] {
        bootstrap(&self.all(state, Half::own_per_100_000))
    }

    /// Own misses in 100,000 cycles more than in the same round without a black box.
    fn misses_more(&self, state: State) -> [f64; 3] {
        self.more(state, Half::own_per_100_000)
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
            "all_p50_over_off": bounded(run.ratio_of_all(state, 0)),
            "all_p99_over_off": bounded(run.ratio_of_all(state, 1)),
            "machine_late_percent": run.median(state, Half::machine_late_percent),
            "machine_late_percent_more": bounded(run.machine_late_more(state)),
            "own_misses_per_100_000": bounded(run.misses(state)),
            "own_misses_per_100_000_more": bounded(run.misses_more(state)),
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
        "states": states, "halves": halves, "verdict": verdict(run),
    })
}

/// For people, a line for each state.
#[must_use]
pub fn table(run: &Run) -> Vec<String> {
    let mut lines = vec![
        "| black box | p50, us | over off | p99, us | over off | own misses in 100,000 \
         | more than off | other misses | machine late, % | more than off | all: p50 over off \
         | p99 over off | memory, MiB | ring, MiB | of a core, % |"
            .to_owned(),
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|".to_owned(),
    ];
    let bounded = |decimals: usize, [mean, low, high]: [f64; 3]| {
        format!("{mean:.decimals$} [{low:.decimals$}, {high:.decimals$}]")
    };
    lines.extend(State::ALL.map(|state| {
        format!(
            "| {} | {:.1} | {} | {:.1} | {} | {} | {} | {} | {:.1} | {} | {} | {} | {:.1} | {:.0} \
             | {} |",
            state.name(),
            run.median(state, |half| half.latency_us[0]),
            bounded(3, run.ratio(state, 0)),
            run.median(state, |half| half.latency_us[1]),
            bounded(3, run.ratio(state, 1)),
            bounded(1, run.misses(state)),
            bounded(1, run.misses_more(state)),
            run.halves_in(state)
                .map(|half| half.other_misses)
                .sum::<u64>(),
            run.median(state, Half::machine_late_percent),
            bounded(1, run.machine_late_more(state)),
            bounded(3, run.ratio_of_all(state, 0)),
            bounded(3, run.ratio_of_all(state, 1)),
            run.median(state, |half| half.span.memory_bytes as f64 / MIB),
            run.median(state, |half| half.span.ring_bytes as f64 / MIB),
            bounded(1, run.cpu_percent(state)),
        )
    }));
    lines.extend([String::new(), verdict(run)]);
    lines
}

/// Whether a black box costs no more than it may, in each state.
fn verdict(run: &Run) -> String {
    let states = [State::On, State::Stopped, State::Killed].map(|state| {
        let [p50, p99] = [0, 1].map(|percentile| judge(run.ratio(state, percentile), RATIO_MAX));
        let misses = judge(run.misses_more(state), MISSES_MORE_MAX);
        format!("{}: {p50}, {p99}, {misses}", state.name())
    });
    format!(
        "p50 and p99 at most {RATIO_MAX} times those without a black box, and at most \
         {MISSES_MORE_MAX} further own miss in 100,000. {}.",
        states.join("; ")
    )
}

/// Whether a figure with this interval is at most `bar`.
fn judge(interval: [f64; 3], bar: f64) -> &'static str {
    let [_, low, high] = interval;
    if high <= bar {
        "met"
    } else if low > bar {
        "missed"
    } else {
        "not decided by so many rounds"
    }
}
