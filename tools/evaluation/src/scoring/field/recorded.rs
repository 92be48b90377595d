//! Recorded runs: one truth each, a verdict a frame.

use std::collections::BTreeMap;

use super::{Figure, Moment, RobotOrder, Run, Scorer, Size, Stretch, Truth, figures};
use crate::scoring::{Case, Taxonomy, Verdict};

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
    let mode = &case.label.mode;
    let truth = match (case.label.onset_s, taxonomy.index(mode)) {
        (None, _) => Truth::Healthy,
        (Some(_), Some(_)) => Truth::Faults(vec![mode.clone()]),
        (Some(_), None) => Truth::Unmodelled { own: None },
    };
    let begins = Stretch {
        from_s: f64::NEG_INFINITY,
        truth: Truth::Healthy,
        size: None,
    };
    let breaks = case.label.onset_s.map(|from_s| Stretch {
        from_s,
        truth,
        size: None,
    });
    let truth: Vec<Stretch> = std::iter::once(begins).chain(breaks).collect();
    let ends = [case.verdicts.first(), case.verdicts.last()];
    let span_s = ends.map(|verdict| verdict.map_or(0.0, |verdict| verdict.t_s));
    let mut scorer = Scorer::new(&truth, taxonomy, span_s, u64::from(case.label.run));
    let mut actions: Vec<&str> = Vec::new();
    let mut t_before_s = None;
    for verdict in &case.verdicts {
        let action = actions.iter().position(|&action| action == verdict.action);
        let action = action.unwrap_or_else(|| {
            actions.push(&verdict.action);
            actions.len() - 1
        });
        scorer.take(&Moment {
            t_s: verdict.t_s,
            dt_s: verdict.t_s - t_before_s.unwrap_or(verdict.t_s),
            drives: verdict.drives,
            alarm: verdict.alarm,
            belief: verdict.belief(),
            mode: &verdict.mode,
            p_mode: verdict.p_mode,
            // No label has a size.
            size: Size::default(),
            set: &verdict.fault_set,
            reported: &verdict.reported,
            order: order(verdict),
            action: action as u64,
        });
        t_before_s = Some(verdict.t_s);
    }
    scorer.finish()
}

fn order(verdict: &Verdict) -> RobotOrder {
    let name = verdict.action.split(':').next().unwrap_or_default();
    match name {
        "" | "go_on" => RobotOrder::GoOn,
        "slow_down" => RobotOrder::Slow,
        "stop" | "give_up" => RobotOrder::Stop,
        "call_for_help" => RobotOrder::Help,
        SAFE_STOP => RobotOrder::Blind,
        _ => RobotOrder::Other,
    }
}
