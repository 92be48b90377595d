//! `vigil learn` without labels: a model of the channels of any described robot.

use std::path::Path;

use serde::Serialize;
use vigil_learning::channel_learning::{self, Report};
use vigil_learning::split::split_runs;
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::learned::model::Provenance;

use super::files::{file_name, write_whole};
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Runs from which some are left out; below, blocks of them are.
const RUNS_TO_SPLIT: usize = 6;

/// What to learn from.
pub(super) struct Task<'a> {
    /// The robot.
    pub robot: &'a Description,
    /// Runs, all without a fault.
    pub runs: &'a [Run],
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
}

/// Writes the model and says how well it holds.
///
/// # Errors
/// A log that cannot support a model; an output that cannot be written.
pub(super) fn run(task: &Task<'_>) -> Result<Outcome, CommandError> {
    let ids: Vec<u32> = task.runs.iter().map(|run| run.id).collect();
    let held_out = match ids.len() < RUNS_TO_SPLIT {
        true => Vec::new(),
        false => split_runs(&ids, task.test_fraction, task.seed),
    };
    let (mut model, report) =
        channel_learning::learn(task.runs, &held_out, task.until_s, task.robot)
            .map_err(|error| CommandError::usage(format!("{}: {error}", task.frames.display())))?;
    model.provenance = Provenance {
        frames_file: file_name(task.frames),
        seed: task.seed,
        test_fraction: task.test_fraction,
        software_version: env!("CARGO_PKG_VERSION").to_owned(),
        ..model.provenance
    };
    let model = model.sealed();
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
        })
    } else {
        output::line(&format!("model {}\n{report}", task.out.display()))
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

#[cfg(test)]
mod tests {
    use vigil_diagnosis::detect::Settings;
    use vigil_learning::channel_learning::FALSE_ALARM_INTERVAL_H;

    #[test]
    fn the_report_is_of_the_detectors_own_interval_between_false_alarms() {
        let settings = Settings::default();
        assert_eq!(FALSE_ALARM_INTERVAL_H, settings.false_alarm_interval_h);
    }
}
