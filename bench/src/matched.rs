//! Filters at one false-alarm rate: thresholds from nominal runs, outcomes of faulty ones, paired
//! differences.

use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::{Value, json};
use vigil_inference::logspace::log_sum_exp;

use crate::quantile;

/// What a filter believed in one run.
#[derive(Debug, Clone)]
pub struct Trace {
    /// Log-odds of any fault after each step.
    pub log_odds: Vec<f64>,
    /// First step with the fault; the number of steps in a nominal run.
    pub onset: usize,
    /// The most probable mode, some time after the onset, is the true one.
    pub leaf_right: bool,
    /// The most probable mode is of the true one's side, or an encoder as it is.
    pub side_right: bool,
}

impl Trace {
    /// Nothing yet, of a run whose fault begins at step `onset`.
    #[must_use]
    pub const fn new(onset: usize) -> Self {
        Self {
            log_odds: Vec::new(),
            onset,
            leaf_right: false,
            side_right: false,
        }
    }
}

/// Log-odds of any fault in a posterior whose mode 0 is nominal.
#[must_use]
pub fn log_odds(posterior: &[f64]) -> f64 {
    let faults: Vec<f64> = posterior.iter().skip(1).map(|p| p.ln()).collect();
    log_sum_exp(&faults) - posterior.first().map_or(0.0, |p| p.ln())
}

/// The log-odds that nominal runs exceed in the share `share` of runs of this length at most. None
/// if they are infinite: the filter has lost the nominal mode too often. Log-odds so low that a
/// single particle exceeds them count as a millionth.
#[must_use]
pub fn threshold(nominal: &[Trace], share: f64) -> Option<f64> {
    let lowest = 1e-6_f64.ln();
    let highest = |trace: &Trace| trace.log_odds.iter().copied().fold(lowest, f64::max);
    let mut highest: Vec<f64> = nominal.iter().map(highest).collect();
    let found = quantile(&mut highest, 1.0 - share);
    found.is_finite().then_some(found)
}

/// `f` of each item, on all cores, in the items' order: nothing here is timed.
pub fn in_parallel<T: Sync, R: Send>(items: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some((i, item)) = {
            let i = next.fetch_add(1, Ordering::Relaxed);
            items.get(i).map(|item| (i, item))
        } {
            done.push((i, f(item)));
        }
        done
    };
    let mut results: Vec<(usize, R)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        let joined = workers.into_iter().map(|worker| match worker.join() {
            Ok(done) => done,
            Err(panic) => std::panic::resume_unwind(panic),
        });
        joined.flatten().collect()
    });
    results.sort_by_key(|(i, _)| *i);
    results.into_iter().map(|(_, result)| result).collect()
}

/// What one filter did in all faulty runs.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Filter.
    pub name: &'static str,
    /// Its particles.
    pub count: Option<usize>,
    /// Threshold of the log-odds; None if no threshold gives so few false alarms.
    pub threshold: Option<f64>,
    /// Runs with an alarm before the fault.
    pub false_alarms: usize,
    /// Runs without an alarm after the onset.
    pub missed: usize,
    /// Of each run: steps from the onset to the first alarm after it; those left if there is none.
    pub delays: Vec<f64>,
    /// Of each run: the right leaf, 1 or 0.
    pub leaves: Vec<f64>,
    /// Of each run: the right side, 1 or 0.
    pub sides: Vec<f64>,
}

impl Outcome {
    /// Judges the traces of faulty runs with a threshold.
    #[must_use]
    pub fn of(
        name: &'static str,
        count: Option<usize>,
        threshold: Option<f64>,
        faulty: &[Trace],
    ) -> Self {
        let mut outcome = Self {
            name,
            count,
            threshold,
            false_alarms: 0,
            missed: 0,
            delays: Vec::new(),
            leaves: Vec::new(),
            sides: Vec::new(),
        };
        for trace in faulty {
            let (before, after) = trace
                .log_odds
                .split_at(trace.onset.min(trace.log_odds.len()));
            let alarms = |odds: &f64| threshold.is_some_and(|threshold| *odds > threshold);
            outcome.false_alarms += usize::from(before.iter().any(alarms));
            let delay = after.iter().position(alarms);
            outcome.missed += usize::from(delay.is_none());
            outcome
                .delays
                .push(delay.map_or(after.len(), |steps| steps + 1) as f64);
            outcome.leaves.push(f64::from(u8::from(trace.leaf_right)));
            outcome.sides.push(f64::from(u8::from(trace.side_right)));
        }
        outcome
    }

    /// Share of runs with the right leaf.
    #[must_use]
    pub fn leaf_share(&self) -> f64 {
        mean(&self.leaves)
    }

    /// Raw data.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "filter": self.name, "particles": self.count, "runs": self.delays.len(),
            "threshold_log_odds": self.threshold,
            "false_alarms": self.false_alarms, "missed": self.missed,
            "delays_steps": self.delays, "leaves": self.leaves, "sides": self.sides,
        })
    }

    /// A row of the table; a step takes `step_s`.
    #[must_use]
    pub fn row(&self, step_s: f64) -> String {
        let runs = self.delays.len().max(1) as f64;
        let percent = |n: usize| 100.0 * n as f64 / runs;
        let count = self.count.map_or_else(|| "-".into(), |n| n.to_string());
        let alarms = match self.threshold {
            None => "no threshold | - | -".to_owned(),
            Some(_) => format!(
                "{:.0} % | {:.0} % | {:.2}",
                percent(self.false_alarms),
                percent(self.missed),
                mean(&self.delays) * step_s,
            ),
        };
        format!(
            "| {} | {count} | {alarms} | {:.0} % | {:.0} % |",
            self.name,
            100.0 * mean(&self.leaves),
            100.0 * mean(&self.sides),
        )
    }
}

/// Head of the table of [`Outcome::row`].
pub const HEAD: [&str; 2] = [
    "| filter | particles | false alarms | missed | mean delay, s | leaf right | side right |",
    "|---|---|---|---|---|---|---|",
];

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Mean of `a - b` over the same runs, and half the width of its 95 % interval.
#[must_use]
pub fn paired(a: &[f64], b: &[f64]) -> (f64, f64) {
    let apart: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    let (n, centre) = (apart.len().max(2) as f64, mean(&apart));
    let squares: f64 = apart.iter().map(|d| (d - centre) * (d - centre)).sum();
    (centre, 1.96 * (squares / (n - 1.0) / n).sqrt())
}

/// `a` against `b` in words: delay, leaf and side, with paired 95 % intervals.
#[must_use]
pub fn compare(a: &Outcome, b: &Outcome, step_s: f64) -> String {
    let (delay, delay_half) = paired(&a.delays, &b.delays);
    let (leaf, leaf_half) = paired(&a.leaves, &b.leaves);
    let (side, side_half) = paired(&a.sides, &b.sides);
    let name = |o: &Outcome| match o.count {
        Some(count) => format!("{} {count}", o.name),
        None => o.name.to_owned(),
    };
    let delay = match a.threshold.and(b.threshold) {
        None => "no threshold for one of them".to_owned(),
        Some(_) => format!(
            "delay {:+.2} ± {:.2} s",
            delay * step_s,
            delay_half * step_s
        ),
    };
    format!(
        "- {} against {}: {delay}, leaf {:+.0} ± {:.0} points, side {:+.0} ± {:.0} points",
        name(a),
        name(b),
        100.0 * leaf,
        100.0 * leaf_half,
        100.0 * side,
        100.0 * side_half,
    )
}

/// The fewest particles with which each filter names as many leaves as `level`, in words.
#[must_use]
pub fn particles_for(found: &[Outcome], level: f64) -> String {
    let mut names: Vec<&str> = found.iter().map(|outcome| outcome.name).collect();
    names.dedup();
    let fewest = |name: &&str| {
        let of = found.iter().filter(|outcome| outcome.name == *name);
        let enough = of.filter(|outcome| mean(&outcome.leaves) >= level);
        match enough.filter_map(|outcome| outcome.count).min() {
            Some(count) => format!("{name} {count}"),
            None if found.iter().any(|o| o.name == *name && o.count.is_none()) => String::new(),
            None => format!("{name} more than tried"),
        }
    };
    let fewest: Vec<String> = names.iter().map(fewest).filter(|s| !s.is_empty()).collect();
    format!(
        "- particles for {:.0} % of the leaves right: {}",
        100.0 * level,
        fewest.join(", ")
    )
}
