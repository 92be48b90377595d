//! What an evaluation found, as one page to read: no script, nothing loaded, light and dark.
//!
//! Every figure in it is one of the [`Score`]s and [`Contest`]s given; nothing is computed anew but
//! the curves of belief.

mod belief;
mod contest;
mod curves;
mod matrix;
mod summary;
mod verdict;

use crate::scoring::{Case, Contest, Score, Taxonomy};
use vigil_pages::page::page;

/// What was found with one set of channels.
#[derive(Debug, Clone, Copy)]
pub struct SensorSet<'a> {
    /// Its name: `pose`, `pose+encoders`.
    pub name: &'a str,
    /// The score.
    pub score: &'a Score,
    /// The runs behind it.
    pub cases: &'a [Case],
    /// Filters beside each other, if they were asked for.
    pub contest: Option<&'a Contest>,
}

/// An evaluation.
#[derive(Debug, Clone)]
pub struct Report<'a> {
    /// What was evaluated and how, for the record: name and value.
    pub facts: Vec<(&'static str, String)>,
    /// Sets of channels over the same runs in the same order.
    pub sets: Vec<SensorSet<'a>>,
    /// Sides and types of the faults.
    pub taxonomy: &'a Taxonomy,
}

impl Report<'_> {
    /// False if the model names no faults, so that all of that does not apply.
    fn identifies(&self) -> bool {
        self.sets.iter().all(|set| set.score.identifies)
    }

    /// The page.
    #[must_use]
    pub fn html(&self) -> String {
        let mut sections = vec![summary::section(self)];
        sections.extend(contest::section(self));
        sections.push(matrix::section(self));
        if self.identifies() {
            sections.push(curves::calibration(self));
        }
        sections.push(curves::delays(self));
        sections.push(curves::trade_off(self));
        sections.push(belief::section(self));
        sections.push(summary::facts(&self.facts));
        page("Vigil: evaluation", &verdict::verdict(self), &sections)
    }
}

/// The page of recorded runs without labels, diagnosed with the channels of `set`; `facts` say what
/// was diagnosed and how.
#[must_use]
pub fn unlabelled(
    facts: &[(&'static str, String)],
    cases: &[Case],
    set: &str,
    taxonomy: &Taxonomy,
) -> String {
    let alarmed = |case: &&Case| case.verdicts.iter().any(|verdict| verdict.alarm);
    let alarmed = cases.iter().filter(alarmed).count();
    let said = format!("An alarm rose in {alarmed} of {} runs.", cases.len());
    let sections = [
        belief::unlabelled(cases, set, taxonomy),
        summary::facts(facts),
    ];
    page("Vigil: diagnosis", &said, &sections)
}

/// Name of a set of channels in words.
fn words(set: &str) -> &str {
    match set {
        "pose" => "pose only",
        "pose+encoders" => "pose and encoders",
        other => other,
    }
}
