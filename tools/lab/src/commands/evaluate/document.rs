//! What is printed: one JSON document, or tables.

use std::collections::BTreeMap;
use std::fmt::Write;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_evaluation::scoring::bounds::Difference;
use vigil_evaluation::scoring::{Contest, Score, Share};

use super::Part;
use super::passes::SensorSetResult;
use crate::commands::offline::FilterSettings;

/// What it prints with --json. Keys of the score stand at its top, for the set of channels that
/// was asked for.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document<'a> {
    /// Version of this document.
    schema_version: u32,
    /// Part of the runs that was scored.
    part: Part,
    /// What was used.
    #[serde(flatten)]
    used: &'a FilterSettings,
    /// How good the verdicts are.
    #[serde(flatten)]
    score: &'a Score,
    /// The scores of all sets of channels, if a report or filters were asked for.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    sensor_sets: BTreeMap<&'a str, &'a Score>,
    /// Filters beside each other by set of channels, if they were asked for.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    filters: BTreeMap<&'a str, &'a Contest>,
}

impl<'a> Document<'a> {
    /// Of the set that was `asked` for and of all sets `found`, which count if there are `several`.
    pub(super) fn new(
        part: Part,
        used: &'a FilterSettings,
        asked: &'a SensorSetResult,
        found: &'a [SensorSetResult],
        several: bool,
    ) -> Self {
        let sets = found.iter().filter(|_| several);
        let filters = found
            .iter()
            .filter_map(|set| Some((set.name.as_str(), set.contest.as_ref()?)));
        Self {
            schema_version: 1,
            part,
            used,
            score: &asked.score,
            sensor_sets: sets.map(|set| (set.name.as_str(), &set.score)).collect(),
            filters: filters.collect(),
        }
    }
}

/// The comparison of filters as tables, if there is one.
pub fn filters_text(found: &SensorSetResult) -> Option<String> {
    let mut text = String::new();
    for (class, rows) in found.contest.as_ref()? {
        let _ = write!(
            text,
            "\n\n{:<14} {:>26} {:>26} {:>26}\n{:<14} {:>26} {:>26} {:>26}",
            format!("{}: {class}", found.name),
            "leaf after 2 s",
            "side after 2 s",
            "log score, nats",
            "",
            "(difference, points)",
            "(difference, points)",
            "(difference)"
        );
        for row in rows {
            let score = row.log_score_nats.map_or("-".into(), |x| format!("{x:.3}"));
            let apart = difference(row.log_score_difference.as_ref(), 1.0, 3);
            let score = format!("{score}{apart}");
            let (leaf, side) = (share(&row.leaf.after_2_s), share(&row.side.after_2_s));
            let _ = write!(
                text,
                "\n{:<14} {leaf:>26} {side:>26} {score:>26}",
                row.filter
            );
        }
    }
    Some(text)
}

fn share(share: &Share) -> String {
    let apart = difference(share.difference.as_ref(), 100.0, 1);
    let percent = share.ratio.fraction();
    let percent = percent.map_or("-".into(), |p| format!("{:.1} %", 100.0 * p));
    format!("{percent}{apart}")
}

fn difference(difference: Option<&Difference>, scale: f64, decimals: usize) -> String {
    let text = |x: f64| format!("{:+.decimals$}", scale * x);
    difference.map_or(String::new(), |found| {
        format!(" ({} to {})", text(found.lower_95), text(found.upper_95))
    })
}
