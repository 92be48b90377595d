//! `vigil learn` for any described robot: a model of its channels.

use std::collections::BTreeSet;
use std::path::Path;

use serde::Serialize;
use vigil_evaluation::scoring::Score;
use vigil_learning::channel_learning::{self, LabelledRun, Log, Report};
use vigil_learning::split::split_runs;
use vigil_recording::frames::Run;
use vigil_recording::labels::Label;
use vigil_robot::Description;
use vigil_robot::channel_model::Model;
use vigil_robot::learned::model::Provenance;

use super::cross_validation;
use super::files::{file_name, write_whole};
use super::labelled_runs::{healthy_part, labelled_runs};
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Runs from which some are left out; below, blocks of them are.
const RUNS_TO_SPLIT: usize = 6;

/// What to learn from.
pub(super) struct Task<'a> {
    /// The robot.
    pub robot: &'a Description,
    /// Runs; without labels all count as healthy.
    pub runs: &'a [Run],
    /// Labels of the runs.
    pub labels: Option<&'a [Label]>,
    /// Their file, for the record.
    pub labels_file: Option<&'a Path>,
    /// Frames file, for messages.
    pub frames: &'a Path,
    /// Where to write the model.
    pub out: &'a Path,
    /// Part of the runs to leave out.
    pub test_fraction: f64,
    /// Seed of that choice.
    pub seed: u64,
    /// End of what is learned from in each run, s.
    pub until_s: f64,
    /// Mean time between false alarms, h, of what is said of the model.
    pub false_alarm_interval_h: f64,
    /// Diagnose each group by a model of the others.
    pub cross_validate: bool,
    /// Print JSON.
    pub json: bool,
}

#[derive(Debug, Serialize)]
struct Document<'a> {
    schema_version: u32,
    model: String,
    model_hash: String,
    #[serde(flatten)]
    report: &'a Report,
    held_out_run_ids: &'a [u32],
    #[serde(skip_serializing_if = "Option::is_none")]
    cross_validation: Option<&'a Score>,
}

/// Writes the model and says how well it holds.
///
/// # Errors
/// A log that cannot support a model; an output that cannot be written.
pub(super) fn run(task: &Task<'_>) -> Result<Outcome, CommandError> {
    let held_out = held_out(task);
    let (mut model, report) = learn(task, &held_out, Some(task.false_alarm_interval_h))?;
    model.provenance = Provenance {
        frames_file: file_name(task.frames),
        labels_file: task.labels_file.map(file_name).unwrap_or_default(),
        seed: task.seed,
        test_fraction: task.test_fraction,
        software_version: env!("CARGO_PKG_VERSION").to_owned(),
        ..model.provenance
    };
    let model = model.sealed();
    let labels = task.labels.filter(|_| task.cross_validate);
    let score = labels.map(|labels| cross_validation::score(task, labels));
    let score = score.transpose()?;
    let text = model.to_toml().map_err(CommandError::failure)?;
    write_whole(task.out, &text)?;
    for warning in &report.warnings {
        eprintln!("warning: {warning}");
    }
    let printed = if task.json {
        output::json(&Document {
            schema_version: 1,
            model: task.out.display().to_string(),
            model_hash: format!("{:016x}", model.hash()),
            report: &report,
            held_out_run_ids: &model.provenance.runs_held_out,
            cross_validation: score.as_ref(),
        })
    } else {
        let validated = score.map_or_else(String::new, |score| {
            format!("\neach group diagnosed by what the others show\n{score}")
        });
        output::line(&format!(
            "model {}\n{report}{validated}",
            task.out.display()
        ))
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

/// Runs to leave out of learning: whole groups of labelled ones, each of which hardly differs from
/// its likes.
fn held_out(task: &Task<'_>) -> Vec<u32> {
    let ids = task.runs.iter().map(|run| run.id);
    let Some(labels) = task.labels else {
        let ids: Vec<u32> = ids.collect();
        return match ids.len() < RUNS_TO_SPLIT {
            true => Vec::new(),
            false => split_runs(&ids, task.test_fraction, task.seed),
        };
    };
    let group = |id: u32| {
        labels
            .iter()
            .find(|label| label.run == id)
            .map(|label| &label.group)
    };
    let groups: BTreeSet<&String> = ids.clone().filter_map(group).collect();
    let numbered: Vec<u32> = (0..).take(groups.len()).collect();
    let left_out = split_runs(&numbered, task.test_fraction, task.seed);
    let is_left_out = |id: &u32| {
        let place = group(*id).and_then(|group| groups.iter().position(|other| *other == group));
        place.is_some_and(|place| left_out.contains(&(place as u32)))
    };
    ids.filter(is_left_out).collect()
}

/// Learns from the runs that are not held out; if asked for, with a study of isolability at so many
/// hours between false alarms.
pub(super) fn learn(
    task: &Task<'_>,
    held_out: &[u32],
    isolability_at_h: Option<f64>,
) -> Result<(Model, Report), CommandError> {
    let faulty = match task.labels {
        Some(labels) => labelled_runs(task.runs, labels, task.robot)?,
        None => Vec::new(),
    };
    let healthy = task.runs.iter().map(|run| healthy_part(run, &faulty));
    let healthy: Vec<Run> = healthy.collect();
    let is_learned = |label: &LabelledRun<'_>| !held_out.contains(&label.run.id);
    let labelled: Vec<LabelledRun<'_>> = faulty.into_iter().filter(is_learned).collect();
    let groups = task.labels.unwrap_or_default().iter();
    let groups: Vec<(u32, String)> = groups
        .map(|label| (label.run, label.group.clone()))
        .collect();
    let log = Log {
        healthy: &healthy,
        labelled: &labelled,
        groups: &groups,
        held_out,
        until_s: task.until_s,
        isolability_at_h,
    };
    channel_learning::learn(&log, task.robot)
        .map_err(|error| CommandError::usage(format!("{}: {error}", task.frames.display())))
}
