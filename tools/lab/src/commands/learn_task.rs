//! What a model of channels is learned from, and the learning itself.

use std::collections::BTreeSet;
use std::path::Path;

use vigil_learning::channel_learning::{self, LabelledRun, Log, Report};
use vigil_learning::split::split_runs;
use vigil_recording::frames::Run;
use vigil_recording::labels::Label;
use vigil_robot::Description;
use vigil_robot::channel_model::Model;
use vigil_terminal::CommandError;

use super::labelled_runs::{Labelled, healthy_part, labelled_runs};

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

/// Runs to leave out of learning: whole groups of labelled ones, each of which hardly differs from
/// its likes.
pub(super) fn held_out(task: &Task<'_>) -> Vec<u32> {
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
    let found = match task.labels {
        Some(labels) => labelled_runs(task.runs, labels, task.robot)?,
        None => Labelled::default(),
    };
    let Labelled { faults, changes } = found;
    let healthy = task.runs.iter().map(|run| healthy_part(run, &faults));
    let healthy: Vec<Run> = healthy.filter(|run| !run.frames.is_empty()).collect();
    let is_learned = |label: &LabelledRun<'_>| !held_out.contains(&label.run.id);
    let labelled: Vec<LabelledRun<'_>> = faults.into_iter().filter(is_learned).collect();
    let groups = task.labels.unwrap_or_default().iter();
    let groups: Vec<(u32, String)> = groups
        .map(|label| (label.run, label.group.clone()))
        .collect();
    let log = Log {
        healthy: &healthy,
        labelled: &labelled,
        changes: &changes,
        groups: &groups,
        held_out,
        until_s: task.until_s,
        isolability_at_h,
    };
    channel_learning::learn(&log, task.robot)
        .map_err(|error| CommandError::usage(format!("{}: {error}", task.frames.display())))
}
