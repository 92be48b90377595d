//! Scores verdicts against labels.
//!
//! Works on rows of verdicts only and knows no filter. Definitions:
//!
//! - *false alarm*: an alarm in a nominal run, or before the onset of a fault; their rate is over
//!   the time in which one was possible, so without the detector's warm-up at the beginning of each
//!   run (given beside it);
//! - *detection*: the first rise of the alarm at or after the onset; without one, the fault is
//!   missed; the delay is counted from the onset;
//! - *at h seconds*: the last verdict at or before onset + h; runs that end earlier do not count;
//! - *right leaf*: the reported mode is the true one (`UNKNOWN` if the tree does not know the true
//!   one); an abstract node is a wrong leaf, and a right side or type if all its leaves are of it;
//! - labels that name no leaf and no kind of fault, say `taped`, count as *fault* or *no fault*: if
//!   all do, only detection is scored;
//! - *isolation*: the time from the onset until the right leaf is named for good, of the runs
//!   that end with it.

mod belief;
pub mod bounds;
mod calibration;
mod confusion;
mod contest;
mod detection;
pub mod field;
mod identification;
mod ratio;
mod table;
mod taxonomy;
mod trade_off;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

pub use belief::Belief;
pub use calibration::{Bin, Calibration, Claims, expected_calibration_error, log_score_nats};
pub use confusion::{Coarse, Matrix};
pub use contest::{Contest, Entrant, Row, Share, Shares, contest};
pub use detection::{Detection, FalseAlarms, Rate};
pub use identification::{Identification, Instants};
pub use ratio::{Ratio, Spread};
pub use taxonomy::{Side, Taxonomy};
pub use trade_off::{ClassDetection, Point, TradeOff};

use vigil_recording::labels::Label;

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
    /// Its log-odds, natural logarithm, as the detector compares them with its threshold.
    pub log_odds: f64,
    /// True while the alarm stands.
    pub alarm: bool,
    /// True while none can rise: the detector is warming up.
    pub warming_up: bool,
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
    /// False before an alarm: no leaf is looked at yet.
    pub is_identifying: bool,
    /// Mode with hysteresis, named as `mode` is.
    pub reported: String,
    /// The action, and the wheels that it is about after a colon; empty if nothing is decided.
    pub action: String,
    /// What the action orders the robot to do, as far as it is scored.
    pub order: field::RobotOrder,
    /// In which way the component that `mode` names is broken, and by how much.
    pub size: field::Size,
    /// True if motion is commanded.
    pub drives: bool,
}

impl Verdict {
    /// Its belief.
    #[must_use]
    pub fn belief(&self) -> Belief<'_> {
        Belief {
            p_nodes: &self.p_nodes,
            p_unknown: self.p_unknown,
            is_identifying: self.is_identifying,
        }
    }
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

    /// True if the label says which fault it is: a leaf of the tree, or a kind that it lacks.
    fn is_named(&self, taxonomy: &Taxonomy) -> bool {
        let is_leaf = taxonomy.index(&self.label.mode).is_some();
        taxonomy.has_faults() && (is_leaf || !self.label.kind.is_empty())
    }

    /// Classes under which a faulty run is counted: all, its type, its kind.
    fn classes(&self, taxonomy: &Taxonomy) -> Vec<String> {
        let class = taxonomy.class_or_unmodelled(&self.label.mode);
        let mut classes = vec!["all".to_owned(), class.to_owned()];
        // Where it names no kind, its own name is all there is.
        let kind = match self.is_named(taxonomy) {
            true => &self.label.kind,
            false => &self.label.mode,
        };
        if !kind.is_empty() && kind != class {
            classes.push(kind.clone());
        }
        classes
    }
}

/// How good the verdicts of many runs are.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Score {
    /// Runs by kind; nominal ones are `nominal`.
    pub runs: BTreeMap<String, usize>,
    /// False if the tree has no faults, or if no faulty run's label names one: identification, the
    /// confusion of sides and types, and calibration do not apply and are empty.
    pub identifies: bool,
    /// Alarms without a fault.
    pub false_alarms: FalseAlarms,
    /// Detection by class of fault; `all` is every one.
    pub detection: BTreeMap<String, Detection>,
    /// Identification by class of fault; `all` is every one.
    pub identification: BTreeMap<String, Identification>,
    /// Runs by true and by reported mode: 2 s after the onset, and at the end of nominal runs.
    pub confusion: Matrix,
    /// The same by side and by type.
    pub confusion_by: Coarse,
    /// Whether the probabilities can be believed, 2 s after the onset, by class of fault; `all` is
    /// every one.
    pub calibration: BTreeMap<String, Calibration>,
    /// Detection delay against false alarms over all thresholds of the detector.
    pub trade_off: TradeOff,
    /// What is said and done at every instant: figures by class of run and by name, of which the
    /// unit is the last part.
    pub field: BTreeMap<String, field::Figures>,
}

/// Scores runs. `alarm_log_odds`: the detector's threshold, nats.
#[must_use]
pub fn score(cases: &[Case], taxonomy: &Taxonomy, alarm_log_odds: f64) -> Score {
    let mut runs = BTreeMap::new();
    let mut classes: BTreeMap<String, Vec<&Case>> = BTreeMap::new();
    for case in cases {
        let kind = match case.label.kind.as_str() {
            _ if case.label.is_nominal() => "nominal",
            "" => taxonomy.class(&case.label.mode).unwrap_or("unnamed"),
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
        .map(|(class, of)| (class.clone(), Detection::new(of)));
    let mut faulty = cases.iter().filter(|case| !case.label.is_nominal());
    let identifies =
        taxonomy.has_faults() && (classes.is_empty() || faulty.any(|case| case.is_named(taxonomy)));
    // Only runs whose label names a fault tell whether a name is right.
    let mut named = classes.clone();
    for of in named.values_mut() {
        of.retain(|case| identifies && case.is_named(taxonomy));
    }
    named.retain(|_, of| !of.is_empty());
    let named = || named.iter();
    let identification =
        named().map(|(class, of)| (class.clone(), Identification::new(of, taxonomy)));
    let calibration = named().map(|(class, of)| (class.clone(), Calibration::new(of, taxonomy)));
    Score {
        runs,
        identifies,
        false_alarms: FalseAlarms::new(cases),
        detection: detection.collect(),
        identification: identification.collect(),
        confusion: confusion::leaves(cases),
        confusion_by: match identifies {
            true => Coarse::new(cases, taxonomy),
            false => Coarse::default(),
        },
        calibration: calibration.collect(),
        trade_off: TradeOff::new(cases, taxonomy, alarm_log_odds),
        field: field::of_cases(cases, taxonomy),
    }
}
