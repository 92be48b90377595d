//! Scores verdicts against labels.
//!
//! Works on rows of verdicts only and knows no filter. Definitions:
//!
//! - *false alarm*: an alarm in a nominal run, or before the onset of a fault;
//! - *detection*: the first rise of the alarm at or after the onset; without one, the fault is
//!   missed; the delay is counted from the onset;
//! - *at h seconds*: the last verdict at or before onset + h; runs that end earlier do not count;
//! - *right leaf*: the reported mode is the true one (`UNKNOWN` if the tree does not know the true
//!   one); an abstract node is a wrong leaf, and a right side or type if all its leaves are of it;
//! - *isolation*: the time from the onset until the right leaf is named for good, of the runs
//!   that end with it.

mod calibration;
mod detection;
mod identification;
mod table;
mod taxonomy;

use std::collections::BTreeMap;

use serde::Serialize;

pub use calibration::{Calibration, Claims};
pub use detection::{Detection, FalseAlarms};
pub use identification::{Identification, Instants};
pub use taxonomy::{Side, Taxonomy};

use crate::labels::Label;

/// Reported when no modelled fault explains the data.
pub const UNKNOWN: &str = "UNKNOWN";
/// Reported when two or more faults are present.
pub const MULTIPLE: &str = "MULTIPLE";

/// Time after the onset at which confusion and calibration are taken, s.
const JUDGED_S: f64 = 2.0;
/// Slack when times are compared, s: they are read from decimal text.
const TIME_SLACK_S: f64 = 1e-6;

/// What was reported for one frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Verdict {
    /// Time of the frame, s.
    pub t_s: f64,
    /// Probability that anything is wrong.
    pub p_fault: f64,
    /// True while the alarm stands.
    pub alarm: bool,
    /// Reported mode: a node of the fault tree, [`UNKNOWN`] or [`MULTIPLE`].
    pub mode: String,
    /// Its probability.
    pub p_mode: f64,
    /// Probability that no modelled fault explains the data.
    pub p_unknown: f64,
    /// Most probable set of leaves, joined by `+`; the nominal mode's name if it is empty.
    pub fault_set: String,
    /// Probability that a left wheel is stuck.
    pub p_left_stuck: f64,
    /// Probability that a right wheel is stuck.
    pub p_right_stuck: f64,
    /// Probability of every node of the tree, in its order.
    pub p_nodes: Vec<f64>,
}

/// One run: what was true and what was reported.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// What was true.
    pub label: Label,
    /// What was reported, in order of time.
    pub verdicts: Vec<Verdict>,
}

impl Case {
    /// The verdict that stood `after_s` after the onset; `None` for a nominal run and one that
    /// ends earlier.
    fn at(&self, after_s: f64) -> Option<&Verdict> {
        let t_s = self.label.onset_s? + after_s + TIME_SLACK_S;
        if self.verdicts.last()?.t_s + 2.0 * TIME_SLACK_S < t_s {
            return None;
        }
        self.verdicts
            .iter()
            .rev()
            .find(|verdict| verdict.t_s <= t_s)
    }

    /// Classes under which a faulty run is counted: all, its type, its kind.
    fn classes(&self, taxonomy: &Taxonomy) -> Vec<String> {
        let class = taxonomy.class(&self.label.mode).unwrap_or("unmodelled");
        let mut classes = vec!["all".to_owned(), class.to_owned()];
        if !self.label.kind.is_empty() && self.label.kind != class {
            classes.push(self.label.kind.clone());
        }
        classes
    }
}

/// Cases that were right.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Ratio {
    /// Cases that count.
    pub n: usize,
    /// Cases that were right.
    pub right: usize,
    /// `right / n`; null without a case.
    pub fraction: Option<f64>,
}

impl Ratio {
    fn add(&mut self, right: bool) {
        self.n += 1;
        self.right += usize::from(right);
        self.fraction = Some(self.right as f64 / self.n as f64);
    }
}

/// Percentiles (nearest rank) of times, s; null without a value.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Spread {
    /// Values.
    pub n: usize,
    /// Median, s.
    pub p50_s: Option<f64>,
    /// 90th percentile, s.
    pub p90_s: Option<f64>,
    /// Largest, s.
    pub max_s: Option<f64>,
}

impl Spread {
    fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let rank = |q: f64| {
            let rank = (q * values.len() as f64).ceil() as usize;
            values.get(rank.saturating_sub(1)).copied()
        };
        Self {
            n: values.len(),
            p50_s: rank(0.5),
            p90_s: rank(0.9),
            max_s: rank(1.0),
        }
    }
}

/// How good the verdicts of many runs are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// Runs by kind; nominal ones are `nominal`.
    pub runs: BTreeMap<String, usize>,
    /// Alarms without a fault.
    pub false_alarms: FalseAlarms,
    /// Detection by class of fault; `all` is every one.
    pub detection: BTreeMap<String, Detection>,
    /// Identification by class of fault; `all` is every one.
    pub identification: BTreeMap<String, Identification>,
    /// True mode, reported mode, runs: 2 s after the onset, and at the end of nominal runs.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
    /// Whether the probabilities can be believed, 2 s after the onset, by class of fault; `all` is
    /// every one.
    pub calibration: BTreeMap<String, Calibration>,
}

/// Scores runs.
#[must_use]
pub fn score(cases: &[Case], taxonomy: &Taxonomy) -> Score {
    let mut runs = BTreeMap::new();
    let mut classes: BTreeMap<String, Vec<&Case>> = BTreeMap::new();
    for case in cases {
        let kind = match case.label.kind.as_str() {
            _ if case.label.is_nominal() => "nominal",
            "" => "unnamed",
            kind => kind,
        };
        *runs.entry(kind.to_owned()).or_default() += 1;
        if !case.label.is_nominal() {
            for class in case.classes(taxonomy) {
                classes.entry(class).or_default().push(case);
            }
        }
    }
    let detection = classes
        .iter()
        .map(|(class, of)| (class.clone(), Detection::of(of)));
    let identification = classes
        .iter()
        .map(|(class, of)| (class.clone(), Identification::of(of, taxonomy)));
    let calibration = classes
        .iter()
        .map(|(class, of)| (class.clone(), Calibration::of(of, taxonomy)));
    Score {
        runs,
        false_alarms: FalseAlarms::of(cases),
        detection: detection.collect(),
        identification: identification.collect(),
        confusion: confusion(cases),
        calibration: calibration.collect(),
    }
}

fn confusion(cases: &[Case]) -> BTreeMap<String, BTreeMap<String, usize>> {
    let mut confusion: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for case in cases {
        let verdict = match case.label.onset_s {
            Some(_) => case.at(JUDGED_S),
            None => case.verdicts.last(),
        };
        if let Some(verdict) = verdict {
            let row = confusion.entry(case.label.mode.clone()).or_default();
            *row.entry(verdict.mode.clone()).or_default() += 1;
        }
    }
    confusion
}
