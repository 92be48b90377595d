//! Learns the behaviour of any described robot from its own log of healthy driving.
//!
//! Every channel is regressed on the command (ridge, Huber weights). The log is divided into parts,
//! and each part predicted by a model of the others: what is left there gives the noise, the joint
//! law of all channels in time, and the tails of the log-odds without a fault. A short log widens
//! the deviations.

mod calibrate;
mod contexts;
mod coverage;
mod excitation;
mod isolability;
mod joint;
mod labelled;
mod noise;
mod recognition;
mod record;
mod regression;
mod report;
mod terms;
mod told;
mod turning;
mod unseen;
mod view;

use std::collections::BTreeSet;

use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::channel::lags;
use vigil_robot::channel_model::context_change::ContextChanges;
use vigil_robot::channel_model::model::{KIND, VERSION};
use vigil_robot::channel_model::scatter::Scatter;
use vigil_robot::channel_model::signature::Signatures;
use vigil_robot::channel_model::turning::TurningSignatures;
use vigil_robot::channel_model::{
    Channel, Combinations, Model, Range, Scales, Target, Term, drives, targets,
};
use vigil_robot::learned::model::Provenance;

use crate::data_hash::data_hash;
use crate::plausibility::{self, RunCheck, RunDoubt};
pub use contexts::{ContextFit, LabelledChange, TOLD_S};
pub use isolability::Isolability;
pub use labelled::{FaultFit, LabelledRun};
use record::{FOLDS, Record};
pub use report::{ChannelFit, Report};
pub use view::View;

/// Logs shorter than this are learned from with a warning and wider deviations, s.
const LONG_ENOUGH_S: f64 = 600.0;

/// Part of the error of a smaller set of terms up to which a larger one is worth its terms. Chosen:
/// on logs without anything slow a larger set differs by up to 0.09 either way, where something is
/// slow its error is half and less.
const WORTH: f64 = 0.9;

/// Why a log supports no model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LogError {
    /// Nothing to learn from.
    #[error("there are no runs to learn from")]
    NoRuns,
    /// Half of the runs, or more, cannot mean what their columns say: one of them.
    #[error(transparent)]
    Doubtful(RunDoubt),
    /// The robot hardly moves.
    #[error("the robot moves for {found_s:.1} s, at least {needed_s:.0} s are needed")]
    Still {
        /// Time in motion, s.
        found_s: f64,
        /// Needed, s.
        needed_s: f64,
    },
    /// An axis of the command is not excited.
    #[error(
        "{axis} stays between {min:.3} and {max:.3} {unit}: its effect cannot be learned; record \
         driving over at least {needed:.3} {unit} of it, or leave it out of the description"
    )]
    Unexcited {
        /// Axis.
        axis: String,
        /// Its unit.
        unit: String,
        /// Smallest command.
        min: f64,
        /// Largest command.
        max: f64,
        /// Width needed.
        needed: f64,
    },
    /// Two axes always change together.
    #[error(
        "{one} and {other} always change together (correlation {correlation:.3}): record driving \
         in which each changes without the other"
    )]
    Together {
        /// One axis.
        one: String,
        /// The other.
        other: String,
        /// Their correlation.
        correlation: f64,
    },
    /// An axis of the command hardly varies, or follows from the others.
    #[error(
        "{axis} hardly varies where the command is kept up, or follows from the other axes: its \
         effect cannot be learned; record driving in which it changes by itself"
    )]
    Follows {
        /// Axis.
        axis: String,
    },
    /// The description measures nothing that a model could be made of.
    #[error(
        "no channel can be predicted: the description has neither measured channels nor [[channel]]"
    )]
    NoChannels,
    /// A channel has too few observations.
    #[error("{channel}: {found} observations to learn {needed} weights from")]
    Few {
        /// Channel.
        channel: String,
        /// Observations.
        found: usize,
        /// Needed.
        needed: usize,
    },
}

/// What to learn from.
#[derive(Debug, Clone, Copy)]
pub struct Log<'a> {
    /// Runs without a fault, and what comes before it of those with one.
    pub healthy: &'a [Run],
    /// Runs of declared faults.
    pub labelled: &'a [LabelledRun<'a>],
    /// Changes of declared contexts in healthy runs.
    pub changes: &'a [LabelledChange<'a>],
    /// Names of groups by the ids of runs: those of one group are never judged by each other. A run
    /// without one is a group of its own.
    pub groups: &'a [(u32, String)],
    /// Ids of the runs to leave out.
    pub held_out: &'a [u32],
    /// End of what is learned from in each run, s.
    pub until_s: f64,
    /// Mean time between false alarms, h, for which [`Report::isolability`] is found; none: it is
    /// not.
    pub isolability_at_h: Option<f64>,
}

impl<'a> Log<'a> {
    /// All of these runs, none of which has a fault.
    #[must_use]
    pub const fn of_healthy(runs: &'a [Run]) -> Self {
        Self {
            healthy: runs,
            labelled: &[],
            changes: &[],
            groups: &[],
            held_out: &[],
            until_s: f64::INFINITY,
            isolability_at_h: None,
        }
    }
}

/// Learns a model of a robot.
///
/// # Errors
/// [`LogError`] naming what is missing.
pub fn learn(log: &Log<'_>, robot: &Description) -> Result<(Model, Report), LogError> {
    let until_s = log.until_s;
    let is_left_out = |run: &&Run| log.held_out.contains(&run.id);
    let (left_out, learned): (Vec<&Run>, Vec<&Run>) = log.healthy.iter().partition(is_left_out);
    if learned.is_empty() {
        return Err(LogError::NoRuns);
    }
    let doubt = doubt(&learned, until_s, robot)?;
    let records = record::grouped(&learned, log.groups, until_s, robot);
    let command = excitation::ranges(&records, robot)?;
    let exposure_s = records.iter().map(Record::moving_s).sum();
    let provenance = provenance(log, robot, &learned, &left_out);
    let mut model = blank(robot, exposure_s, command, provenance);
    model.rest_s = record::rest_s(&records, lags(robot.interval_s));
    let mut report = Report::new(&model, learned.len(), left_out.len());
    report.warnings.extend(doubt);
    let beginnings = learned.iter().map(|run| (*run, until_s));
    report
        .warnings
        .extend(plausibility::slow(beginnings, robot));
    let all = targets(robot);
    if all.is_empty() {
        return Err(LogError::NoChannels);
    }
    let untold = untold(&records, &model, robot)?;
    report.untold(&untold, &model);
    let scales = Scales::new(model.sizes(), drives(robot), robot.interval_s);
    let mut models = cover(&mut model, &records, robot, &untold);
    for (place, target) in all.iter().enumerate() {
        let mut terms = terms::candidates(target, robot);
        let told = |set: &mut Vec<Term>| set.retain(|term| !untold.contains(term));
        terms.iter_mut().for_each(told);
        let (channel, of_parts) = fit(target, place, &terms, &records, (&models, &scales))?;
        let astray = |period| record::part_astray(&records, place, period);
        report.astray(&channel.name, target.period.map_or(0.0, astray));
        report.add(&channel, &target.unit);
        model.channel.push(channel);
        for (part, channel) in models.iter_mut().zip(of_parts) {
            part.channel.push(channel);
        }
    }
    joint::fit(&mut model, &mut models, &records, &scales);
    let changes = contexts::Runs {
        ids: learned.iter().map(|run| run.id).collect(),
        groups: learned
            .iter()
            .map(|run| record::group(run, log.groups))
            .collect(),
        labelled: log.changes,
    };
    let parts = (models.as_slice(), records.as_slice());
    report.contexts = contexts::fit(&mut model, parts, &changes, (robot, &scales));
    report.faults = fit_declared((&mut model, &mut models), &records, log, (robot, &scales));
    calibrate::fit(&mut model, &mut models, &records, robot);
    calibrate::tell(&mut report.bounds, &model);
    let study = |interval_h| {
        isolability::report(&isolability::Task {
            model: &model,
            models: &models,
            records: &records,
            scales: &scales,
            robot,
            interval_h,
        })
    };
    report.isolability = log.isolability_at_h.and_then(study);
    report.finish(&model);
    Ok((model.sealed(), report))
}

/// Learns from labelled runs how declared faults show, for all models.
fn fit_declared(
    (model, models): (&mut Model, &mut [Model]),
    records: &[Record],
    log: &Log<'_>,
    (robot, scales): (&Description, &Scales),
) -> Vec<FaultFit> {
    let labelled = (log.labelled, log.groups);
    let used = (robot, scales, log.until_s);
    let mut told = labelled::fit(model, (models, records), labelled, used);
    told.extend(turning::fit(model, records, labelled, (robot, log.until_s)));
    for (fold, part) in models.iter_mut().enumerate() {
        part.signatures.clone_from(&model.signatures);
        part.turning = turning::with_unseen_noise(&model.turning, (records, fold), robot);
    }
    told
}

/// Learns which commands the log covers; with models of the parts' others.
fn cover(
    model: &mut Model,
    records: &[Record],
    robot: &Description,
    untold: &[Term],
) -> Vec<Model> {
    let products = coverage::products(&terms::command(robot), untold);
    let ranges = model.command.clone();
    let combinations = |part| coverage::combinations(records, part, &products, &ranges);
    model.combinations = combinations(None);
    let mut models = excitation::of_parts(records, model);
    for (part, seen) in models.iter_mut().enumerate() {
        seen.combinations = combinations(Some(part));
    }
    models
}

fn provenance(
    log: &Log<'_>,
    robot: &Description,
    learned: &[&Run],
    left_out: &[&Run],
) -> Provenance {
    let labels = log.labelled.iter().map(|label| {
        let LabelledRun { run, onset_s, .. } = label;
        format!("{} {} {onset_s}", run.id, label.fault)
    });
    let changes = log.changes.iter();
    let changes = changes.map(|one| format!("{} {} {}", one.run, one.context, one.onset_s));
    let labels: Vec<String> = labels.chain(changes).collect();
    // Those with several faults at once teach nothing.
    let one = |label: &&LabelledRun<'_>| robot.fault.iter().any(|fault| fault.name == label.fault);
    let runs = log.labelled.iter().filter(one).map(|label| label.run);
    let runs: Vec<&Run> = learned.iter().copied().chain(runs).collect();
    let ids: BTreeSet<u32> = runs.iter().map(|run| run.id).collect();
    Provenance {
        data_hash: data_hash(&runs, log.until_s, &labels),
        runs_learned: ids.into_iter().collect(),
        runs_held_out: left_out.iter().map(|run| run.id).collect(),
        until_s: log.until_s.is_finite().then_some(log.until_s),
        ..Provenance::default()
    }
}

/// A model of which nothing but the command is known.
fn blank(
    robot: &Description,
    exposure_s: f64,
    command: Vec<Range>,
    provenance: Provenance,
) -> Model {
    Model {
        kind: KIND.to_owned(),
        version: VERSION,
        hash: String::new(),
        robot: robot.name.clone(),
        interval_s: robot.interval_s,
        warm_up_s: robot.warm_up_s,
        exposure_s,
        rest_s: 0.0,
        widened: widening(exposure_s, robot.interval_s),
        provenance,
        command,
        combinations: Combinations::default(),
        channel: Vec::new(),
        direction: Vec::new(),
        scatter: Scatter::default(),
        declared: robot.fault.clone(),
        signatures: Signatures::default(),
        turning: TurningSignatures::default(),
        declared_context: robot.context.clone(),
        contexts: ContextChanges::default(),
        tail: Vec::new(),
        calibration: Vec::new(),
    }
}

/// What is doubtful about a few of the runs, as on ground that lets a robot slip; where half of
/// them and more are doubtful, the columns are, and refused.
fn doubt(runs: &[&Run], until_s: f64, robot: &Description) -> Result<Option<String>, LogError> {
    let checks = runs.iter().map(|run| RunCheck::new(run, robot, until_s));
    let judged: Vec<RunCheck> = checks.filter(|check| check.is_judged).collect();
    let all = judged.len();
    let doubts: Vec<RunDoubt> = judged.into_iter().filter_map(|c| c.doubt).collect();
    let found = doubts.len();
    match doubts.into_iter().next() {
        Some(doubt) if 2 * found >= all => Err(LogError::Doubtful(doubt)),
        Some(doubt) => Ok(Some(format!(
            "{found} of {all} runs are doubtful and learned from nevertheless: {doubt}"
        ))),
        None => Ok(None),
    }
}

/// Products of powers of the command that the log does not tell.
fn untold(records: &[Record], model: &Model, robot: &Description) -> Result<Vec<Term>, LogError> {
    let commands = excitation::settled(records, &model.command);
    let untold = told::untold(&terms::command(robot), &commands, &model.command);
    let axis = untold.iter().find_map(told::single);
    match axis.and_then(|axis| model.command.get(axis)) {
        Some(range) => Err(LogError::Follows {
            axis: range.name.clone(),
        }),
        None => Ok(untold),
    }
}

/// Fits weights and noise of one channel; with its models of the parts' others. Of the sets of
/// terms a larger one is taken if it predicts the parts not seen better by [`WORTH`].
fn fit(
    target: &Target,
    place: usize,
    sets: &[Vec<Term>; 3],
    records: &[Record],
    (parts, scales): (&[Model], &Scales),
) -> Result<(Channel, Vec<Channel>), LogError> {
    let ranges: Vec<&[Range]> = parts.iter().map(|part| part.command.as_slice()).collect();
    let error = |models: &[Channel]| noise::unseen_error((models, &ranges), place, records, scales);
    let [quick, larger @ ..] = sets;
    let (mut channel, mut models) = weights(target, place, quick, records, scales)?;
    let mut least = error(&models);
    for terms in larger {
        let Ok(other) = weights(target, place, terms, records, scales) else {
            break;
        };
        let found = error(&other.1);
        if found < WORTH * least {
            least = found;
            (channel, models) = other;
        }
    }
    noise::fit(&mut channel, (&models, &ranges), place, records, scales);
    for model in &mut models {
        model.context_sd = channel.context_sd;
        (model.variance, model.usual) = (channel.variance, channel.usual);
    }
    Ok((channel, models))
}

/// Fits weights alone.
fn weights(
    target: &Target,
    place: usize,
    terms: &[Term],
    records: &[Record],
    scales: &Scales,
) -> Result<(Channel, Vec<Channel>), LogError> {
    let mut channel = Channel {
        name: target.name.clone(),
        period: target.period,
        drifts: target.drifts,
        terms: terms.to_vec(),
        weights: vec![0.0; terms.len()],
        variance: [0.0; 3],
        context_sd: [0.0; 2],
        usual: 0.0,
        silence_s: record::silence_s(records, place),
        held_out_ratio: 1.0,
    };
    let mut models = vec![channel.clone(); FOLDS];
    regression::fit(&mut channel, place, records, None, scales)?;
    for (fold, model) in models.iter_mut().enumerate() {
        regression::fit(model, place, records, Some(fold), scales)?;
    }
    Ok((channel, models))
}

/// Factor on the deviations of a short log: two standard errors of a deviation from so many
/// observations.
fn widening(exposure_s: f64, interval_s: f64) -> f64 {
    if exposure_s >= LONG_ENOUGH_S {
        return 1.0;
    }
    1.0 + 2.0 / (2.0 * exposure_s / interval_s).max(2.0).sqrt()
}
