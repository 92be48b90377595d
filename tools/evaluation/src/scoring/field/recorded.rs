//! Recorded runs: one truth each, a verdict a frame.

use std::collections::BTreeMap;

use super::{Figure, Run, Scorer, Stretch, figures};
use crate::scoring::{Case, Taxonomy};

/// Name of a stop by rule, without a usable belief, among the actions of verdicts.
pub const SAFE_STOP: &str = "safe_stop";

/// Figures by name.
pub type Figures = BTreeMap<&'static str, Figure>;

/// Figures of recorded runs by class: `all`, `nominal`, and the classes of faults. Figures of
/// actions are left out if nothing was decided.
#[must_use]
pub fn of_cases(cases: &[Case], taxonomy: &Taxonomy) -> BTreeMap<String, Figures> {
    let mut classes: BTreeMap<String, Vec<Run>> = BTreeMap::new();
    for case in cases {
        let run = score(case, taxonomy);
        let mut of = case.classes(taxonomy);
        if case.label.is_nominal() {
            of = vec!["all".to_owned(), "nominal".to_owned()];
        }
        for class in of {
            classes.entry(class).or_default().push(run.clone());
        }
    }
    let decides = |case: &Case| case.verdicts.iter().any(|v| !v.action.is_empty());
    let decides = cases.iter().any(decides);
    let named = |runs: &[Run]| -> Figures {
        let all = figures(runs).into_iter();
        let kept = all.filter(|figure| decides || !figure.is_of_actions());
        kept.map(|figure| (figure.name, figure)).collect()
    };
    let all = classes.iter();
    all.map(|(class, runs)| (class.clone(), named(runs)))
        .collect()
}

fn score(case: &Case, taxonomy: &Taxonomy) -> Run {
    let truth = Stretch::of_label(&case.label.mode, case.label.onset_s, taxonomy);
    let ends = [case.verdicts.first(), case.verdicts.last()];
    let span_s = ends.map(|verdict| verdict.map_or(0.0, |verdict| verdict.t_s));
    let mut scorer = Scorer::new(&truth, taxonomy, span_s, u64::from(case.label.run));
    case.verdicts
        .iter()
        .for_each(|verdict| scorer.take(verdict));
    scorer.finish()
}
