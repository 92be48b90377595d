//! `vigil learn --cross-validate`: each group of runs diagnosed by a model that was learned from the
//! others.

use std::collections::BTreeSet;

use vigil_diagnosis::detect::{self, Detector};
use vigil_diagnosis::identify::{self, ChannelIdentifier, Diagnoser};
use vigil_evaluation::scoring::{self, Case, Score, Taxonomy};
use vigil_evaluation::stages::{Stages, Vocabulary};
use vigil_recording::frames::Run;
use vigil_recording::labels::Label;
use vigil_robot::channel_model::tree::tree;
use vigil_terminal::CommandError;
use vigil_terminal::output::Progress;

use super::learn_channels::{self, Task};

/// The score of the diagnosis of each run by a model that has not seen its group.
///
/// # Errors
/// Groups that are too few, or without which there is nothing to learn from.
pub(super) fn score(
    task: &Task<'_>,
    labels: &[Label],
    false_alarm_interval_h: f64,
) -> Result<Score, CommandError> {
    let group_of = |run: &Run| {
        let label = labels.iter().find(|label| label.run == run.id);
        label.map_or("", |label| label.group.as_str())
    };
    let groups: BTreeSet<&str> = task.runs.iter().map(group_of).collect();
    if groups.len() < 2 {
        let refused = "--cross-validate: needs runs of two groups or more (column 'group')";
        return Err(CommandError::usage(refused));
    }
    let progress = Progress::new("groups", groups.len());
    let tree = tree(task.robot).map_err(CommandError::usage)?;
    let identify::Settings { p_unknown, .. } = identify::Settings::default();
    let vocabulary = Vocabulary {
        taxonomy: Taxonomy::new(&tree, task.robot).with_prior_unknown(p_unknown),
        robot: task.robot.clone(),
        actions: Vec::new(),
    };
    let settings = detect::Settings {
        false_alarm_interval_h,
        ..detect::Settings::default()
    };
    let (mut cases, mut alarm_log_odds) = (Vec::new(), f64::NEG_INFINITY);
    for (done, group) in groups.iter().enumerate() {
        progress.show(done);
        let is_left_out = |run: &&Run| group_of(run) == *group;
        let left_out: Vec<u32> = task.runs.iter().filter(is_left_out).map(|r| r.id).collect();
        let (model, _) = learn_channels::learn(task, &left_out)?;
        let refuse = |error: &dyn std::fmt::Display| {
            CommandError::usage(format!("without the group '{group}': {error}"))
        };
        let detector = Detector::of_channels(&model, task.robot, &settings);
        let detector = detector.map_err(|error| refuse(&error))?;
        alarm_log_odds = f64::max(alarm_log_odds, detector.alarm_log_odds());
        let used = (settings.sensors, settings.fault_rate_1_h);
        let identifier = ChannelIdentifier::new(&model, task.robot, &tree, used);
        let identifier = identifier.map_err(|error| refuse(&error))?;
        for run in task.runs.iter().filter(is_left_out) {
            let Some(label) = labels.iter().find(|label| label.run == run.id) else {
                continue;
            };
            let diagnoser = Diagnoser::from(identifier.clone());
            let mut stages = Stages::new(detector.clone(), diagnoser, None, vocabulary.clone());
            let verdicts = run.frames.iter().map(|frame| {
                stages.take(frame);
                stages.verdict(frame)
            });
            cases.push(Case {
                label: label.clone(),
                verdicts: verdicts.collect(),
            });
        }
    }
    Ok(scoring::score(&cases, &vocabulary.taxonomy, alarm_log_odds))
}
