//! Filters beside each other on the same runs.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use super::bounds::Difference;
use super::calibration::{VerdictScore, judge};
use super::{Case, JUDGED_S, Ratio, Taxonomy};

/// Instants after the onset at which names are compared, s.
const INSTANTS_S: [f64; 3] = [2.0, 5.0, 10.0];

/// What a filter made of the faulty runs: all that a comparison needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Entrant {
    name: String,
    runs: Vec<Run>,
}

/// One faulty run.
#[derive(Debug, Clone, PartialEq)]
struct Run {
    class: String,
    leaf: [Option<bool>; 3],
    side: [Option<bool>; 3],
    judged: Option<VerdictScore>,
}

impl Entrant {
    /// Keeps what the filter `name` reported.
    #[must_use]
    pub fn new(name: &str, cases: &[Case], taxonomy: &Taxonomy) -> Self {
        let faulty = cases.iter().filter(|case| !case.label.is_nominal());
        let run = |case: &Case| {
            let truth = &case.label.mode;
            let leaf = |at_s: f64| Some(taxonomy.is_leaf_right(&case.at(at_s)?.mode, truth));
            let side = |at_s: f64| Some(taxonomy.is_side_right(&case.at(at_s)?.mode, truth));
            Run {
                class: taxonomy.class_or_unmodelled(truth).to_owned(),
                leaf: INSTANTS_S.map(leaf),
                side: INSTANTS_S.map(side),
                judged: case.at(JUDGED_S).map(|v| judge(v, truth, taxonomy)),
            }
        };
        Self {
            name: name.to_owned(),
            runs: faulty.map(run).collect(),
        }
    }
}

/// A share of runs, and how it differs from the first filter's.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Share {
    /// This filter's.
    #[serde(flatten)]
    pub ratio: Ratio,
    /// This filter's less the first one's, run by run; null for the first itself.
    pub difference: Option<Difference>,
}

/// Shares at instants after the onset.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Shares {
    /// 2 s after the onset.
    pub after_2_s: Share,
    /// 5 s after the onset.
    pub after_5_s: Share,
    /// 10 s after the onset.
    pub after_10_s: Share,
}

/// One filter on the faults of one type.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Row {
    /// Name of the filter.
    pub filter: String,
    /// The right leaf was named.
    pub leaf: Shares,
    /// The right side was named.
    pub side: Shares,
    /// Mean of -ln p(true mode) 2 s after the onset, nats.
    pub log_score_nats: Option<f64>,
    /// Its difference from the first filter's, run by run, nats; null for the first itself.
    pub log_score_difference: Option<Difference>,
    /// Something false was said with more than 0.9, 2 s after the onset (`right` counts them).
    pub confident_wrong: Share,
}

/// Rows by type of fault; `all` is every one. The first row is the filter that the others are
/// compared with.
pub type Contest = BTreeMap<String, Vec<Row>>;

/// Compares filters over the same runs with the first of them.
#[must_use]
pub fn contest(entrants: &[Entrant]) -> Contest {
    let mut contest = Contest::new();
    let Some(first) = entrants.first() else {
        return contest;
    };
    let mut classes: Vec<&str> = first.runs.iter().map(|run| run.class.as_str()).collect();
    classes.push("all");
    classes.sort_unstable();
    classes.dedup();
    for class in classes {
        let rows = entrants.iter().enumerate().map(|(i, entrant)| {
            let pairs = entrant.runs.iter().zip(&first.runs);
            let pairs = pairs.filter(|(run, _)| class == "all" || run.class == class);
            row(&entrant.name, &pairs.collect::<Vec<_>>(), i == 0)
        });
        contest.insert(class.to_owned(), rows.collect());
    }
    contest
}

fn row(filter: &str, pairs: &[(&Run, &Run)], is_first: bool) -> Row {
    let share = |right: &dyn Fn(&Run) -> Option<bool>| share(pairs, is_first, right);
    let shares = |of: &dyn Fn(&Run) -> [Option<bool>; 3]| {
        let [after_2_s, after_5_s, after_10_s] = [0, 1, 2].map(|at| share(&|run| of(run)[at]));
        Shares {
            after_2_s,
            after_5_s,
            after_10_s,
        }
    };
    let log_score = |run: &Run| run.judged.as_ref().map(|judged| judged.log_score_nats);
    let scores: Vec<f64> = pairs.iter().filter_map(|(run, _)| log_score(run)).collect();
    let apart: Vec<f64> = pairs
        .iter()
        .filter_map(|(run, first)| Some(log_score(run)? - log_score(first)?))
        .collect();
    let n = scores.len();
    Row {
        filter: filter.to_owned(),
        leaf: shares(&|run| run.leaf),
        side: shares(&|run| run.side),
        log_score_nats: (n > 0).then(|| scores.iter().sum::<f64>() / n as f64),
        log_score_difference: Difference::of_numbers(&apart).filter(|_| !is_first),
        confident_wrong: share(&|run| Some(run.judged.as_ref()?.is_confident_wrong)),
    }
}

fn share(pairs: &[(&Run, &Run)], is_first: bool, right: &dyn Fn(&Run) -> Option<bool>) -> Share {
    let mut ratio = Ratio::default();
    let (mut gained, mut lost, mut both) = (0, 0, 0);
    for (run, first) in pairs {
        if let Some(right) = right(run) {
            ratio.add(right);
        }
        if let (Some(here), Some(there)) = (right(run), right(first)) {
            both += 1;
            gained += usize::from(here && !there);
            lost += usize::from(there && !here);
        }
    }
    Share {
        ratio,
        difference: Difference::of_shares(gained, lost, both).filter(|_| !is_first),
    }
}
