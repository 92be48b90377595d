//! Runs in figures.

use serde_json::{Value, json};
use statrs::distribution::{ContinuousCDF, Normal};

use super::{NONCENTRALITY_MIN, Run, Verdict, WINDOW_S};
use crate::quantile;
use crate::shares::Share;

/// Ends of the bands of noncentrality.
const BANDS: [f64; 7] = [NONCENTRALITY_MIN, 40.0, 60.0, 100.0, 200.0, 500.0, 1e12];

/// Figures of a group of runs, those in cells that no nominal model could tell from nominal left
/// out.
#[derive(Debug, Clone)]
pub struct Totals {
    /// Runs judged.
    pub runs: usize,
    /// Runs left out for their noncentrality.
    pub excluded: usize,
    /// Runs left out as an alarm stood before the onset.
    pub alarmed_before: usize,
    /// Detected within 2 s.
    pub detected: Share,
    /// Median delay of those detected, s.
    pub median_s: f64,
    /// Right 2 s after the detection (of those detected), 5 s and 10 s after the onset (of all).
    pub right: [Share; 3],
    /// Wrong with more than 0.9, at the same instants, of all.
    pub wrong: [Share; 3],
}

/// Figures of `runs`.
#[must_use]
pub fn totals(runs: &[&Run]) -> Totals {
    let enough = |run: &&&Run| run.noncentrality >= NONCENTRALITY_MIN;
    let clear: Vec<&Run> = runs.iter().filter(enough).copied().collect();
    let judged: Vec<&Run> = clear
        .iter()
        .filter(|run| !run.alarmed_before)
        .copied()
        .collect();
    let mut delays: Vec<f64> = judged.iter().filter_map(|run| run.delay_s).collect();
    let share = |instant: usize, wanted: Verdict| {
        let due = judged.iter().filter(|run| run.said[instant].is_some());
        Share::of(due, |run| run.verdict(instant) == Some(wanted))
    };
    let wrong =
        |instant: usize| Share::of(&judged, |run| run.verdict(instant) == Some(Verdict::Wrong));
    Totals {
        runs: judged.len(),
        excluded: runs.len() - clear.len(),
        alarmed_before: clear.len() - judged.len(),
        detected: Share::of(&judged, |run| run.is_detected(WINDOW_S)),
        median_s: quantile(&mut delays, 0.5),
        right: std::array::from_fn(|instant| share(instant, Verdict::Right)),
        wrong: std::array::from_fn(wrong),
    }
}

impl Totals {
    /// Head of a table of [`Self::row`].
    pub const HEAD: [&'static str; 2] = [
        "| disturbance | runs (left out) | detected in 2 s | median, s | unknown 2 s after alarm | \
         5 s after onset | 10 s | wrong, p > 0.9: 2 s after alarm | 5 s | 10 s |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ];

    /// A row of the table.
    #[must_use]
    pub fn row(&self, name: &str) -> String {
        let median = match self.median_s.is_nan() {
            true => "-".to_owned(),
            false => format!("{:.2}", self.median_s),
        };
        let [right, wrong] = [self.right, self.wrong].map(|s| s.map(|s| s.short()).join(" | "));
        format!(
            "| {name} | {} ({}) | {} | {median} | {right} | {wrong} |",
            self.runs,
            self.excluded + self.alarmed_before,
            self.detected.short(),
        )
    }

    /// The main figures in words.
    #[must_use]
    pub fn words(&self) -> String {
        format!(
            "detected within 2 s {}; unknown (or the right encoder) 2 s after the alarm {}, 5 s \
             after the onset {}; wrong with p > 0.9 2 s after the alarm {}, 5 s after the onset {}",
            self.detected.long(),
            self.right[0].long(),
            self.right[1].long(),
            self.wrong[0].long(),
            self.wrong[1].long(),
        )
    }

    /// Raw data.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "runs": self.runs, "excluded": self.excluded, "alarmed_before": self.alarmed_before,
            "detected": self.detected.json(), "median_delay_s": self.median_s,
            "right": self.right.map(|share| share.json()),
            "wrong": self.wrong.map(|share| share.json()),
            "instants": ["2 s after the alarm", "5 s after the onset", "10 s after the onset"],
        })
    }
}

/// Figures kind by kind, in order of appearance.
#[must_use]
pub fn by_kind(runs: &[&Run]) -> Vec<(&'static str, Totals)> {
    let mut kinds: Vec<&'static str> = runs.iter().map(|run| run.cell.kind).collect();
    kinds.dedup();
    let of = |kind: &'static str| {
        let own: Vec<&Run> = runs
            .iter()
            .filter(|r| r.cell.kind == kind)
            .copied()
            .collect();
        (kind, totals(&own))
    };
    kinds.into_iter().map(of).collect()
}

/// Runs of one noncentrality.
#[derive(Debug, Clone)]
pub struct Band {
    /// Noncentrality from ..
    pub from: f64,
    /// .. and up to.
    pub to: f64,
    /// Detected within 2 s.
    pub detected: Share,
    /// Mean probability with which a test could detect them that is told the fault's every effect
    /// and its onset, and looks once in 2 s. As far as a fault shifts means by what its
    /// noncentrality says, no detector with one false alarm in 24 h sees more.
    pub p_clairvoyant: f64,
}

/// Probability that a test of known signal finds one of this noncentrality, at one false alarm in
/// 24 h of tests that follow one another (Neyman and Pearson).
fn p_clairvoyant(noncentrality: f64) -> f64 {
    let standard = Normal::standard();
    let threshold = standard.inverse_cdf(1.0 - WINDOW_S / 86_400.0);
    standard.cdf(noncentrality.max(0.0).sqrt() - threshold)
}

/// Runs by noncentrality.
#[must_use]
pub fn bands(runs: &[&Run]) -> Vec<Band> {
    BANDS
        .windows(2)
        .map(|ends| {
            let within = |run: &&&Run| {
                (ends[0]..ends[1]).contains(&run.noncentrality) && !run.alarmed_before
            };
            let own: Vec<&&Run> = runs.iter().filter(within).collect();
            let sum: f64 = own.iter().map(|r| p_clairvoyant(r.noncentrality)).sum();
            Band {
                from: ends[0],
                to: ends[1],
                p_clairvoyant: sum / own.len().max(1) as f64,
                detected: Share::of(own, |run| run.is_detected(WINDOW_S)),
            }
        })
        .collect()
}

/// Every run left out for its noncentrality.
#[must_use]
pub fn excluded(runs: &[Run]) -> Vec<Value> {
    let little = runs
        .iter()
        .filter(|run| run.noncentrality < NONCENTRALITY_MIN);
    little.map(Run::cell_json).collect()
}
