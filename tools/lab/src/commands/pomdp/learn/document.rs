//! What was learned, for people and for programs.

use std::fmt::Write;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_missions::learning::{Iteration, LearnedModel, LearnedRow, Table};
use vigil_missions::simulation::Summary;

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    pub schema_version: u32,
    /// Path of the model made by hand.
    pub file: String,
    /// Path of the recorded missions.
    pub missions_file: String,
    /// Number of recorded missions.
    pub missions: usize,
    /// All their steps.
    pub steps: usize,
    /// Policy by which they were recorded, as their file says; null if it does not.
    pub flown_by: Option<String>,
    /// Visits that each row of the model made by hand counts as.
    pub prior_strength: f64,
    /// The start whose model was taken, from 0.
    pub start: usize,
    /// Every iteration of every start.
    pub iterations: Vec<Iteration>,
    /// The start belief and every row of T and Z.
    pub rows: Vec<Row>,
    /// Policy of the learned model whose reward is predicted.
    pub policy: String,
    /// Missions simulated for the prediction.
    pub episodes: u64,
    /// Reward of the policy by the learned model.
    pub predicted: Mean,
    /// Reward of the policy in the world of --world; null without one.
    pub measured: Option<Mean>,
    /// Reward of the recorded missions by the learned model; null if they hold no rewards.
    pub logged_predicted: Option<Mean>,
    /// Recorded reward of the recorded missions; null if they hold no rewards.
    pub logged_measured: Option<Mean>,
    /// Whether there was anything to check by: rewards of missions, or a world.
    pub is_checked: bool,
    /// Whether chance alone may set prediction and measurement apart by more than is allowed.
    pub is_weakly_checked: bool,
    /// Whether the file to be written is there all the same: from before.
    pub is_older_out_left: bool,
    /// Why the model is not to be deployed; null if it was written.
    pub refused: Option<String>,
    /// Hash of the learned model.
    pub hash: String,
}

/// Discounted reward of a mission.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Mean {
    /// Mean over missions.
    mean: f64,
    /// The mean's 95 % interval is `mean` +- this; null for a single mission.
    // JSON has no infinity.
    #[schemars(with = "Option<f64>")]
    half_width_95: f64,
}

impl Mean {
    /// Of a summary.
    pub const fn new(summary: Summary) -> Self {
        Self {
            mean: summary.mean,
            half_width_95: summary.half_width,
        }
    }
}

/// A learned row.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Row {
    /// What it is of: `start` (start belief), `T` (transitions) or `O` (observations).
    table: &'static str,
    /// Name of the action; null for the start belief.
    action: Option<String>,
    /// Name of the state: before the action for `T`, after it for `O`; null for the start belief.
    state: Option<String>,
    /// Expected visits in the missions.
    visits: f64,
    /// Visits that the model made by hand counts as.
    prior: f64,
    /// Visits in the missions over the sum of both, 0 to 1.
    data_share: f64,
    /// Its probabilities, but for those that the model made by hand rules out.
    entries: Vec<Entry>,
}

/// A learned probability.
#[derive(Debug, Serialize, JsonSchema)]
struct Entry {
    /// State or observation that it is the probability of.
    name: String,
    /// In the model made by hand.
    prior: f64,
    /// Learned.
    learned: f64,
    /// Lower end of the 95 % credible interval, which holds fewer worlds if the prior is off.
    credible_low: f64,
    /// Upper end of the same interval.
    credible_high: f64,
    /// Visits that the missions are worth for this number; fewer, the harder states are to tell.
    effective_visits: f64,
}

/// All rows.
pub fn rows(learned: &LearnedModel) -> Vec<Row> {
    let model = &learned.model;
    let of = |row: LearnedRow| {
        let (table, columns) = match row.row.table {
            Table::Start => ("start", model.states()),
            Table::Transition => ("T", model.states()),
            Table::Observation => ("O", model.observations()),
        };
        let named = row.row.table != Table::Start;
        let name = |names: &[String], index: usize| names.get(index).cloned();
        let entries = row.entries.iter().map(|entry| Entry {
            name: name(columns, entry.column).unwrap_or_default(),
            prior: entry.prior,
            learned: entry.learned,
            credible_low: entry.interval[0],
            credible_high: entry.interval[1],
            effective_visits: entry.effective_visits,
        });
        Row {
            table,
            action: name(model.actions(), row.row.action).filter(|_| named),
            state: name(model.states(), row.row.state).filter(|_| named),
            visits: row.visits,
            prior: row.prior,
            data_share: row.data_share(),
            entries: entries.collect(),
        }
    };
    learned.rows().map(of).collect()
}

impl Document {
    /// To read.
    pub fn text(&self) -> String {
        let mut text = format!(
            "{}: learned from {} missions, {} steps, of {}{}; prior: {} visits a row\n\n\
             log-likelihood, nats (what rises: with the prior)\n",
            self.file,
            self.missions,
            self.steps,
            self.missions_file,
            self.flown_by
                .as_ref()
                .map_or_else(String::new, |policy| format!(" (flown by {policy})")),
            self.prior_strength,
        );
        let own: Vec<&Iteration> = self
            .iterations
            .iter()
            .filter(|i| i.start == self.start)
            .collect();
        for (index, iteration) in own.iter().enumerate() {
            let n = iteration.iteration;
            if n < 5 || n % 10 == 0 || index + 1 == own.len() {
                let (likelihood, objective) = (iteration.log_likelihood, iteration.objective);
                let _ = writeln!(text, "{n:>6} {likelihood:>18.3} {objective:>18.3}");
            }
        }
        text.push_str(
            "\nrow: visits in the missions, share of data; its most changed number, in brackets \
             what is credible\n(95 % of the worlds that the prior expects; a prior that is off \
             pulls numbers along)\n",
        );
        for row in &self.rows {
            text.push_str(&row.line());
        }
        text.push_str(&self.checks());
        text
    }

    fn checks(&self) -> String {
        let mut text = format!(
            "\ndiscounted reward of a mission, {} simulated\n",
            self.episodes
        );
        let mut put = |what: &str, mean: &Option<&Mean>| {
            if let Some(mean) = mean {
                let (mean, half) = (mean.mean, mean.half_width_95);
                let _ = writeln!(text, "  {what:<58} {mean:.4} +- {half:.4}");
            }
        };
        let policy = &self.policy;
        put(
            &format!("{policy}, predicted by the learned model"),
            &Some(&self.predicted),
        );
        put(
            &format!("{policy}, measured in the world"),
            &self.measured.as_ref(),
        );
        put(
            "recorded missions, predicted step by step",
            &self.logged_predicted.as_ref(),
        );
        put(
            "recorded missions, measured",
            &self.logged_measured.as_ref(),
        );
        if self.is_weakly_checked {
            text.push_str(
                "a weak check: chance alone may set the two apart by more than 20 %; more \
                 missions tell more\n",
            );
        }
        if !self.is_checked {
            text.push_str("not checked: the missions hold no rewards, and no --world was given\n");
        }
        if self.refused.is_some() {
            text.push_str("not written: see below");
        } else {
            let _ = write!(text, "model {}", self.hash);
        }
        text
    }
}

impl Row {
    fn line(&self) -> String {
        let change = |entry: &&Entry| (entry.learned - entry.prior).abs();
        let most = self
            .entries
            .iter()
            .max_by(|a, b| change(a).total_cmp(&change(b)));
        let (action, state) = (self.action.as_deref(), self.state.as_deref());
        let mut line = format!(
            "  {:<5} {:<8} {:<8} {:>12.1} {:>5.1} %",
            self.table,
            action.unwrap_or_default(),
            state.unwrap_or_default(),
            self.visits,
            100.0 * self.data_share,
        );
        if let Some(entry) = most {
            let _ = write!(
                line,
                "   {:<10} {:.4} -> {:.4} [{:.4}, {:.4}]",
                entry.name, entry.prior, entry.learned, entry.credible_low, entry.credible_high
            );
        }
        line.push('\n');
        line
    }
}
