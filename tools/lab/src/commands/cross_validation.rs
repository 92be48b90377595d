//! `vigil learn --cross-validate`: each group of runs diagnosed by a model that was learned from
//! the others.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use vigil_diagnosis::detect::{self, Detector};
use vigil_diagnosis::identify::{self, ChannelIdentifier, Diagnoser};
use vigil_evaluation::parallel::in_parallel;
use vigil_evaluation::scoring::{self, Case, Score, Taxonomy};
use vigil_evaluation::stages::{Stages, Vocabulary};
use vigil_recording::frames::Run;
use vigil_recording::labels::Label;
use vigil_robot::FaultTree;
use vigil_robot::channel_model::tree::tree;
use vigil_terminal::CommandError;
use vigil_terminal::output::Progress;

use super::labelled_runs::as_scored;
use super::learn_task::{Task, learn};

/// What stays the same over the groups.
struct CrossValidation<'a> {
    task: &'a Task<'a>,
    labels: &'a [Label],
    tree: FaultTree,
    vocabulary: Vocabulary,
    settings: detect::Settings,
}

/// The diagnosis of one group.
struct Fold {
    cases: Vec<Case>,
    alarm_log_odds: f64,
}

/// The score of the diagnosis of each run by a model that has not seen its group.
///
/// # Errors
/// Groups that are too few, or without which there is nothing to learn from.
pub(super) fn score(task: &Task<'_>, labels: &[Label]) -> Result<Score, CommandError> {
    let ids: Vec<u32> = task.runs.iter().map(|run| run.id).collect();
    let used = labels.iter().filter(|label| ids.contains(&label.run));
    let groups: BTreeSet<&str> = used.map(|label| label.group.as_str()).collect();
    if groups.len() < 2 {
        let refused = "--cross-validate: needs runs of two groups or more (column 'group')";
        return Err(CommandError::usage(refused));
    }
    let tree = tree(task.robot).map_err(CommandError::usage)?;
    let identify::Settings { p_unknown, .. } = identify::Settings::default();
    let validation = CrossValidation {
        task,
        labels,
        vocabulary: Vocabulary {
            taxonomy: Taxonomy::new(&tree, task.robot).with_prior_unknown(p_unknown),
            robot: task.robot.clone(),
            actions: Vec::new(),
        },
        tree,
        settings: detect::Settings {
            false_alarm_interval_h: task.false_alarm_interval_h,
            ..detect::Settings::default()
        },
    };
    let groups: Vec<&str> = groups.into_iter().collect();
    let folds = validation.folds(&groups)?;
    let threshold = folds.iter().map(|fold| fold.alarm_log_odds);
    let alarm_log_odds = threshold.fold(f64::NEG_INFINITY, f64::max);
    // Each model has its own threshold: told from that, all are alike.
    let cases = folds.into_iter().flat_map(|fold| {
        let apart = alarm_log_odds - fold.alarm_log_odds;
        let mut cases = fold.cases;
        for verdict in cases.iter_mut().flat_map(|case| &mut case.verdicts) {
            verdict.log_odds += apart;
        }
        cases
    });
    let cases: Vec<Case> = cases.collect();
    let taxonomy = &validation.vocabulary.taxonomy;
    Ok(scoring::score(&cases, taxonomy, alarm_log_odds))
}

impl CrossValidation<'_> {
    /// All groups, in order.
    fn folds(&self, groups: &[&str]) -> Result<Vec<Fold>, CommandError> {
        let done = AtomicUsize::new(0);
        let progress = Progress::new("groups", groups.len());
        let fold = |group: &&str| {
            progress.show(done.fetch_add(1, Ordering::Relaxed));
            self.fold(group)
        };
        in_parallel(groups, fold).into_iter().collect()
    }

    fn fold(&self, group: &str) -> Result<Fold, CommandError> {
        let task = self.task;
        let label = |run: &&Run| self.labels.iter().find(|label| label.run == run.id);
        let of_group = |run: &&Run| label(run).is_some_and(|label| label.group == group);
        let left_out: Vec<u32> = task
            .runs
            .iter()
            .filter(of_group)
            .map(|run| run.id)
            .collect();
        let refuse = |error: &dyn std::fmt::Display| {
            CommandError::usage(format!("without the group '{group}': {error}"))
        };
        let learned = learn(task, &left_out, None);
        let (model, _) = learned.map_err(|error| refuse(&error))?;
        let settings = &self.settings;
        let detector = Detector::of_channels(&model, task.robot, settings);
        let detector = detector.map_err(|error| refuse(&error))?;
        let used = (settings.sensors, settings.fault_rate_1_h);
        let identifier = ChannelIdentifier::new(&model, task.robot, &self.tree, used);
        let identifier = identifier.map_err(|error| refuse(&error))?;
        let case = |run: &Run| {
            let mut stages = Stages::new(
                detector.clone(),
                Diagnoser::from(identifier.clone()),
                None,
                self.vocabulary.clone(),
            );
            let verdicts = run.frames.iter().map(|frame| {
                stages.take(frame);
                stages.verdict(frame)
            });
            Some(Case {
                label: as_scored(label(&run)?, task.robot),
                verdicts: verdicts.collect(),
            })
        };
        Ok(Fold {
            cases: task.runs.iter().filter(of_group).filter_map(case).collect(),
            alarm_log_odds: detector.alarm_log_odds(),
        })
    }
}
