//! What is shown and kept.

use serde_json::{Value, json};
use vigil_evaluation::scoring::field::{Figure, Run, figures};

use super::bar::Bar;
use super::scenario::Scenario;
use crate::has_percentile;

/// Figures that stand in the table even where no bar asks for them; the others are in the document.
const SHOWN: [&str; 29] = [
    "detected",
    "delay_p50_s",
    "delay_p95_s",
    "leaf_2s",
    "side_2s",
    "leaf_10s",
    "side_10s",
    "right_share",
    "right_side_share",
    "reported_right_share",
    "confident_wrong_share",
    "settled_mode_changes_per_min",
    "mode_changes_per_min",
    "reported_changes_per_min",
    "alarm_cleared_p50_s",
    "alarm_cleared_10s",
    "name_cleared_10s",
    "alarms_per_h",
    "runs_with_alarm",
    "healthy_wrong_share",
    "actions_per_h",
    "blind_stops_per_h",
    "help_latched",
    "faults_told",
    "told_without_alarm",
    "faults_pending",
    "contradiction_s",
    "ece",
    "log_score_2s",
];

/// The same of departures of constant size.
const OF_DEPARTURES: [&str; 2] = ["detected", "standing_share_10s"];

const NOT_MET: &str = "NOT met";

/// A scenario with one set of sensors.
#[derive(Debug, Clone)]
pub struct Outcome<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// Name of the set of sensors.
    pub sensors: &'static str,
    /// Its runs.
    pub runs: Vec<Run>,
    /// Their figures.
    pub figures: Vec<Figure>,
}

impl<'a> Outcome<'a> {
    /// Of these runs.
    #[must_use]
    pub fn new(scenario: &'a Scenario, sensors: &'static str, runs: Vec<Run>) -> Self {
        Self {
            figures: figures(&runs),
            scenario,
            sensors,
            runs,
        }
    }

    /// The bars that hold for this set of sensors, and whether each is met; none without a case.
    pub fn bars(&self) -> impl Iterator<Item = (&Bar, Option<bool>)> {
        let all = self.scenario.bars.iter();
        let mine = all.filter(|bar| bar.is_for(self.sensors));
        mine.map(|bar| (bar, bar.is_met(&self.figures)))
    }

    /// Driven time of all runs, h.
    #[must_use]
    pub fn hours(&self) -> f64 {
        self.runs.iter().map(|run| run.duration_s).sum::<f64>() / 3600.0
    }

    fn json(&self) -> Value {
        let bars = self
            .bars()
            .map(|(bar, met)| json!({ "figure": bar.figure, "bar": bar.to_string(), "met": met }));
        let figures = self
            .figures
            .iter()
            .map(|figure| (figure.name.to_owned(), json!(figure)));
        json!({
            "scenario": self.scenario.name, "about": self.scenario.about,
            "sensors": self.sensors, "runs": self.runs.len(), "hours": self.hours(),
            "first_seed": self.scenario.first_seed,
            "figures": figures.collect::<serde_json::Map<_, _>>(),
            "bars": bars.collect::<Vec<Value>>(),
        })
    }

    /// What an operator was told, run by run, if a bar is about how often.
    fn told_timelines(&self) -> Option<Value> {
        self.bars()
            .find(|(bar, _)| bar.figure == "activations_most")?;
        let runs = self.runs.iter().filter(|run| !run.told.is_empty());
        let runs = runs.map(|run| json!({"seed": run.seed, "changes": run.told}));
        let runs: Vec<Value> = runs.collect();
        Some(json!({"scenario": self.scenario.name, "sensors": self.sensors, "runs": runs}))
    }

    /// The bars that are not met, one by line with the figure.
    fn missed(&self) -> Vec<String> {
        let missed = self.bars().filter(|(_, met)| *met == Some(false));
        let line = |(bar, _): (&Bar, Option<bool>)| {
            let mut all = self.figures.iter();
            let figure = all.find(|figure| figure.name == bar.figure)?;
            let value = figure.value.map_or("never".to_owned(), number);
            let bounds = bounds(figure).map_or(String::new(), |bounds| format!(" ({bounds})"));
            let (name, sensors) = (&self.scenario.name, self.sensors);
            let runs = self.runs.len();
            Some(format!(
                "- {name}, {sensors}, runs {runs}: {bar}: {value}{bounds}"
            ))
        };
        missed.filter_map(line).collect()
    }

    fn lines(&self) -> Vec<String> {
        let head = format!(
            "| {} | {} | {} | {:.2} ",
            self.scenario.name,
            self.sensors,
            self.runs.len(),
            self.hours()
        );
        let is_asked = |name: &str| self.bars().any(|(bar, _)| bar.figure == name);
        // A departure is one of many sizes.
        let names = match self.scenario.departure {
            Some(_) => &OF_DEPARTURES[..],
            None => &SHOWN,
        };
        let is_shown = |figure: &Figure| names.contains(&figure.name) && says_something(figure);
        let all = self.figures.iter();
        let shown = all.filter(|figure| is_asked(figure.name) || is_shown(figure));
        let mut lines: Vec<String> = Vec::new();
        for figure in shown {
            let bars = self.bars().filter(|(bar, _)| bar.figure == figure.name);
            let bars: Vec<String> = bars.map(|(bar, met)| verdict(bar, met)).collect();
            lines.push(format!("{head}{}| {} |", words(figure), bars.join("; ")));
        }
        // A bar whose figure has no case is shown all the same.
        let has = |bar: &Bar| self.figures.iter().any(|figure| figure.name == bar.figure);
        for (bar, met) in self.bars().filter(|(bar, _)| !has(bar)) {
            lines.push(format!(
                "{head}| {} | no case | | | {} |",
                bar.figure,
                verdict(bar, met)
            ));
        }
        lines
    }
}

/// False for a percentile of too few cases, and for a rule that nothing broke.
fn says_something(figure: &Figure) -> bool {
    if figure.name.contains("_p95_") && !has_percentile(0.95, figure.n as u64) {
        return false;
    }
    let is_rule = figure.name.starts_with("reported_changes")
        || figure.name.starts_with("mode_changes")
        || figure.name == "contradiction_s"
        || figure.name == "help_latched"
        || figure.name == "blind_stops_per_h";
    !(is_rule && figure.value == Some(0.0))
}

fn verdict(bar: &Bar, met: Option<bool>) -> String {
    let word = match met {
        Some(true) => "met",
        Some(false) => NOT_MET,
        None => "no case",
    };
    format!("{bar}: {word}")
}

fn words(figure: &Figure) -> String {
    let text = |value: Option<f64>| value.map_or("never".to_owned(), number);
    let bounds = bounds(figure).unwrap_or_default();
    let worst = figure.worst.map_or(String::new(), |worst| {
        format!("{} ({})", text(worst.value), worst.seed)
    });
    let (name, value, n) = (figure.name, text(figure.value), figure.n);
    format!("| {name} | {value} | {bounds} | {n} | {worst} ")
}

fn bounds(figure: &Figure) -> Option<String> {
    let (lower, upper) = (figure.lower_95?, figure.upper_95?);
    Some(format!("{} to {}", number(lower), number(upper)))
}

/// Four digits, or all of a whole number.
fn number(value: f64) -> String {
    let magnitude = value.abs();
    match magnitude {
        _ if value == value.trunc() && magnitude < 1e6 => format!("{value:.0}"),
        m if m >= 100.0 => format!("{value:.0}"),
        m if m >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.4}"),
    }
}

const HEAD: [&str; 2] = [
    "| scenario | sensors | runs | h | figure | value | 95 % | n | worst (seed) | bar |",
    "|---|---|---|---|---|---|---|---|---|---|",
];

/// The table.
#[must_use]
pub fn lines(outcomes: &[Outcome<'_>]) -> Vec<String> {
    let mut lines = HEAD.map(str::to_owned).to_vec();
    lines.extend(outcomes.iter().flat_map(Outcome::lines));
    lines
}

/// The bars that are not met, as a list that no summary cuts; the rows of the table that meet
/// theirs.
#[must_use]
pub fn barred_lines(outcomes: &[Outcome<'_>]) -> Vec<String> {
    let mut lines: Vec<String> = outcomes.iter().flat_map(Outcome::missed).collect();
    if !lines.is_empty() {
        lines.splice(0..0, ["Not met:".to_owned(), String::new()]);
        lines.push(String::new());
    }
    lines.extend(HEAD.map(str::to_owned));
    let rows = outcomes.iter().flat_map(Outcome::lines);
    lines.extend(rows.filter(|row| !row.ends_with("|  |") && !row.contains(NOT_MET)));
    lines
}

/// What an operator was told in scenarios with a bar on how often.
#[must_use]
pub fn told_timelines(outcomes: &[Outcome<'_>]) -> Vec<Value> {
    outcomes
        .iter()
        .filter_map(Outcome::told_timelines)
        .collect()
}

/// Everything as data.
#[must_use]
pub fn document(outcomes: &[Outcome<'_>], wall_s: f64, scale: f64) -> Value {
    let met: Vec<Option<bool>> = outcomes
        .iter()
        .flat_map(|o| o.bars().map(|(_, met)| met))
        .collect();
    let (bars, without) = (met.iter().flatten(), met.iter().filter(|met| met.is_none()));
    let results: Vec<Value> = outcomes.iter().map(Outcome::json).collect();
    json!({
        "wall_s": wall_s, "scale": scale,
        "bars": bars.clone().count(), "bars_met": bars.filter(|met| **met).count(),
        "bars_without_case": without.count(), "results": results,
    })
}
