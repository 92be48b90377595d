//! Which part of a cycle limits the rate?

use serde_json::{Value, json};
use vigil_cycle::Latency;

use super::cell::Cell;
use super::cycles::{Cycle, STAGE_NAMES, STAGES, Stage};

/// A part of a cycle: what one stage waits for, or computes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// The stage.
    pub stage: &'static str,
    /// `hand-over` or `compute`.
    pub what: &'static str,
    /// Median over all cycles, us.
    pub p50_us: f64,
    /// Cycles that Vigil missed itself, with an answer of their own.
    pub own_misses: usize,
    /// Median over these, us; 0 if there are none.
    pub own_misses_p50_us: f64,
}

impl Part {
    /// For programs.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "stage": self.stage, "part": self.what, "p50_us": self.p50_us,
            "own_misses": self.own_misses, "own_misses_p50_us": self.own_misses_p50_us,
        })
    }
}

fn median_us(times_ns: impl Iterator<Item = u64>) -> f64 {
    let mut times_ns: Vec<u64> = times_ns.collect();
    times_ns.sort_unstable();
    times_ns
        .get(times_ns.len() / 2)
        .map_or(0.0, |ns| *ns as f64 * 1e-3)
}

/// The parts of a cycle at the median: of all cycles, and of those that Vigil missed itself and
/// that have an answer of their own. What is long only in these is what limits the rate.
#[must_use]
pub fn of(cell: &Cell) -> Vec<Part> {
    let own = cell.misses.iter().filter(|miss| !miss.is_machine);
    let missed = own.filter_map(|miss| {
        let at = |cycle: &Cycle| cycle.t_schedule_ns.cmp(&miss.t_schedule_ns);
        let found = cell.cycles.binary_search_by(at).ok()?;
        cell.cycles[found].stages
    });
    let missed: Vec<[Stage; STAGES]> = missed.collect();
    let mut parts = Vec::new();
    for (i, name) in STAGE_NAMES.into_iter().enumerate() {
        let (hand_over, compute) = &cell.graph.stages[i];
        let p50_us = |all: &Latency| all.percentiles().p50_ns as f64 * 1e-3;
        for (what, all, of) in [
            (
                "hand-over",
                hand_over,
                (|s: &Stage| s.hand_over_ns) as fn(&Stage) -> u64,
            ),
            ("compute", compute, |s: &Stage| s.compute_ns),
        ] {
            parts.push(Part {
                stage: name,
                what,
                p50_us: p50_us(all),
                own_misses: missed.len(),
                own_misses_p50_us: median_us(missed.iter().map(|stages| of(&stages[i]))),
            });
        }
    }
    parts
}
