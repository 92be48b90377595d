//! `vigil learn` for any described robot: a model of its channels.

use schemars::JsonSchema;
use serde::Serialize;
use vigil_evaluation::scoring::Score;
use vigil_learning::channel_learning::Report;
use vigil_robot::learned::model::Provenance;

use super::cross_validation;
use super::files::{file_name, write_whole};
use super::learn_task::{Task, held_out, learn};
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// What `learn` prints with --json of a model of channels.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document<'a> {
    /// Version of this document.
    schema_version: u32,
    /// Path of the model written.
    model: String,
    /// Hash of the model, as beliefs and reports carry it.
    model_hash: String,
    /// What was learned, and how well it holds.
    #[serde(flatten)]
    report: &'a Report,
    /// Ids of the runs left out.
    held_out_run_ids: &'a [u32],
    /// With --cross-validate: score of each group of runs, diagnosed by a model of the others.
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
