//! What was reported for what was true.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use super::{Case, JUDGED_S, Side, Taxonomy};

/// Runs by what was true and what was reported.
pub type Matrix = BTreeMap<String, BTreeMap<String, usize>>;

/// Confusion by coarser words than the leaf, 2 s after the onset; at the end of nominal runs.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, JsonSchema)]
pub struct Coarse {
    /// Sides: `left`, `right`; without a common side, the mode itself.
    pub side: Matrix,
    /// Types of fault (`stuck`, `encoder`); without a common type, the mode itself.
    #[serde(rename = "type")]
    pub class: Matrix,
}

/// Counts leaves: true mode, reported mode, runs.
pub(super) fn leaves(cases: &[Case]) -> Matrix {
    matrix(cases, str::to_owned)
}

impl Coarse {
    pub(super) fn new(cases: &[Case], taxonomy: &Taxonomy) -> Self {
        let side = |mode: &str| match taxonomy.side(mode) {
            Some(Side::Left) => "left".to_owned(),
            Some(Side::Right) => "right".to_owned(),
            None => mode.to_owned(),
        };
        let class = |mode: &str| taxonomy.class(mode).unwrap_or(mode).to_owned();
        Self {
            side: matrix(cases, side),
            class: matrix(cases, class),
        }
    }
}

fn matrix(cases: &[Case], word: impl Fn(&str) -> String) -> Matrix {
    let mut matrix = Matrix::new();
    for case in cases {
        let verdict = match case.label.onset_s {
            Some(_) => case.at(JUDGED_S),
            None => case.verdicts.last(),
        };
        if let Some(verdict) = verdict {
            let row = matrix.entry(word(&case.label.mode)).or_default();
            *row.entry(word(&verdict.mode)).or_default() += 1;
        }
    }
    matrix
}
