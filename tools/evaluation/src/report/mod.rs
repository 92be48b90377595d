//! What an evaluation found, as one page to read: no script, nothing loaded, light and dark.
//!
//! Every figure in it is one of the [`Score`]s and [`Contest`]s given; nothing is computed anew but
//! the curves of belief.

mod belief;
mod contest;
mod curves;
mod matrix;
mod summary;

use crate::scoring::{Case, Contest, Score, Taxonomy};

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
        let mut body = summary::section(self);
        body.push_str(&contest::section(self));
        body.push_str(&matrix::section(self));
        if self.identifies() {
            body.push_str(&curves::calibration(self));
        }
        body.push_str(&curves::delays(self));
        body.push_str(&curves::trade_off(self));
        body.push_str(&belief::section(self));
        body.push_str(&summary::facts(&self.facts));
        vigil_pages::page::page("Vigil: evaluation", &body)
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
    let body = format!(
        "<header><h1>Vigil: diagnosis</h1></header>\n{}{}",
        belief::unlabelled(cases, set, taxonomy),
        summary::facts(facts)
    );
    vigil_pages::page::page("Vigil: diagnosis", &body)
}

/// Name of a set of channels in words.
fn words(set: &str) -> &str {
    match set {
        "pose" => "pose only",
        "pose+encoders" => "pose and encoders",
        other => other,
    }
}
