//! Was the right fault named?

use schemars::JsonSchema;
use serde::Serialize;

use super::{Case, Ratio, Spread, Taxonomy, Verdict};

/// A ratio at several instants after the onset.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, JsonSchema)]
pub struct Instants {
    /// 2 s after the onset.
    pub after_2_s: Ratio,
    /// 5 s after the onset.
    pub after_5_s: Ratio,
    /// 10 s after the onset.
    pub after_10_s: Ratio,
    /// At the end of the run.
    pub at_end: Ratio,
}

impl Instants {
    pub(super) fn new(cases: &[&Case], right: impl Fn(&Case, &Verdict) -> bool) -> Self {
        let mut found = Self::default();
        for &case in cases {
            let note = |ratio: &mut Ratio, verdict: Option<&Verdict>| {
                if let Some(verdict) = verdict {
                    ratio.add(right(case, verdict));
                }
            };
            note(&mut found.after_2_s, case.at(2.0));
            note(&mut found.after_5_s, case.at(5.0));
            note(&mut found.after_10_s, case.at(10.0));
            note(&mut found.at_end, case.verdicts.last());
        }
        found
    }
}

/// Identification of the faults of one class.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Identification {
    /// The right leaf was named.
    pub leaf: Instants,
    /// The right side was named.
    pub side: Instants,
    /// The right type of fault was named.
    #[serde(rename = "type")]
    pub class: Instants,
    /// `UNKNOWN` was reported.
    pub unknown: Instants,
    /// Time from the onset until the right leaf was named for good.
    pub isolation: Spread,
    /// Ids of the runs whose leaf was wrong 2 s after the onset.
    pub wrong_run_ids_after_2_s: Vec<u32>,
}

impl Identification {
    pub(super) fn new(cases: &[&Case], taxonomy: &Taxonomy) -> Self {
        let leaf = |case: &Case, v: &Verdict| taxonomy.is_leaf_right(&v.mode, &case.label.mode);
        let side = |case: &Case, v: &Verdict| taxonomy.is_side_right(&v.mode, &case.label.mode);
        let class = |case: &Case, v: &Verdict| taxonomy.is_class_right(&v.mode, &case.label.mode);
        let isolated_s = |case: &&Case| {
            let onset_s = case.label.onset_s?;
            let right = case
                .verdicts
                .iter()
                .rev()
                .take_while(|verdict| leaf(case, verdict));
            right.last().map(|since| (since.t_s - onset_s).max(0.0))
        };
        let wrong = |case: &&&Case| case.at(2.0).is_some_and(|verdict| !leaf(case, verdict));
        Self {
            leaf: Instants::new(cases, leaf),
            side: Instants::new(cases, side),
            class: Instants::new(cases, class),
            unknown: Instants::new(cases, |_, verdict| verdict.mode == super::UNKNOWN),
            isolation: Spread::new(cases.iter().filter_map(isolated_s).collect()),
            wrong_run_ids_after_2_s: cases.iter().filter(wrong).map(|c| c.label.run).collect(),
        }
    }
}
