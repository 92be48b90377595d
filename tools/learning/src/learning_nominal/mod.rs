//! Learns the nominal behaviour of any described robot from its own log, without labels.
//!
//! Every measured channel is regressed on the command and on the other channels (ridge, Huber
//! weights); what is left gets a variance that may grow with speed, a colour, and the scatter of
//! its mean from run to run. The runs left out (one run: every
//! third block of it) tell whether all this
//! holds; a short log widens the deviations. Last comes the tail of the detector's log-odds.

mod calibrate;
mod excitation;
mod noise;
mod record;
mod regression;
mod report;
mod terms;
mod told;
mod view;

use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::learned::model::Provenance;
use vigil_robot::nominal::model::{KIND, VERSION};
use vigil_robot::nominal::{Channel, Model, Range, Target, Term};

use crate::data_hash::data_hash;
use crate::plausibility::{self, RunCheck, RunDoubt};
use record::{Part, Record};
pub use report::{ChannelError, Report};
pub use view::View;

/// Logs shorter than this are learned from with a warning and wider deviations, s.
const LONG_ENOUGH_S: f64 = 600.0;
/// Blocks into which a single run is cut; every third is left out for the test.
const BLOCKS: usize = 9;

/// Why a nominal model could not be learned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NominalError {
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
        "no channel can be predicted: measured must have pose, wheel_rates, yaw_rate or currents"
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

/// Learns a model from the runs that are not in `held_out`, up to `until_s` of each, and tests it
/// on the others (a single run: on every third block of it, from which the final model learns too).
///
/// # Errors
/// [`NominalError`] naming what is missing.
pub fn learn(
    runs: &[Run],
    held_out: &[u32],
    until_s: f64,
    robot: &Description,
) -> Result<(Model, Report), NominalError> {
    let (left_out, learned): (Vec<&Run>, Vec<&Run>) =
        runs.iter().partition(|run| held_out.contains(&run.id));
    if learned.is_empty() {
        return Err(NominalError::NoRuns);
    }
    let doubt = doubt(&learned, until_s, robot)?;
    let records = record::all(&learned, until_s, robot);
    let tests = record::all(&left_out, until_s, robot);
    let command = excitation::ranges(&records, robot)?;
    let exposure_s = records.iter().map(|record| record.moving_s()).sum();
    let provenance = Provenance {
        data_hash: data_hash(&learned, until_s),
        runs_learned: learned.iter().map(|run| run.id).collect(),
        runs_held_out: left_out.iter().map(|run| run.id).collect(),
        until_s: until_s.is_finite().then_some(until_s),
        ..Provenance::default()
    };
    let mut model = blank(robot, exposure_s, command, provenance);
    let mut report = Report::new(&model, runs.len() - left_out.len(), left_out.len());
    report.warnings.extend(doubt);
    let beginnings = learned.iter().map(|run| (*run, until_s));
    report
        .warnings
        .extend(plausibility::slow(beginnings, robot));
    let targets = terms::targets(robot);
    if targets.is_empty() {
        return Err(NominalError::NoChannels);
    }
    let untold = untold(&records, &model, robot)?;
    report.untold(&untold, &model, robot);
    let (train, test) = parts(&records, &tests);
    let all = whole(&records);
    for (target, mut terms) in targets {
        let name = report::name(target, &model.wheels);
        let untold = &untold[usize::from(target.quantity.is_pose())];
        terms.retain(|term| !untold.contains(term));
        let (trial, _) = fit(&model, target, &terms, &train, &name)?;
        let ratio = noise::whitened_rms(&trial, &test, &model);
        let (mut channel, drift_sd) = fit(&model, target, &terms, &all, &name)?;
        channel.held_out_ratio = ratio;
        let widen = model.widened * ratio.max(1.0);
        channel.variance = channel.variance.map(|variance| variance * widen * widen);
        channel.rest_sd *= widen;
        report.add(&name, &channel, widen);
        let key = format!("channel[{}]", model.channel.len());
        noise::tell(&mut report.bounds, &key, &channel, &all, widen, drift_sd);
        model.channel.push(channel);
    }
    calibrate::fit(&mut model, &records, robot);
    calibrate::tell(&mut report.bounds, &model);
    report.finish(&model);
    Ok((model.sealed(), report))
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
        wheels: robot
            .wheels
            .iter()
            .map(|wheel| wheel.name.clone())
            .collect(),
        interval_s: robot.interval_s,
        exposure_s,
        widened: widening(exposure_s, robot.interval_s),
        provenance,
        command,
        channel: Vec::new(),
        joint: Vec::new(),
        calibration: Vec::new(),
    }
}

/// What is doubtful about a few of the runs, as on ground that lets a robot slip; where half of
/// them and more are doubtful, the columns are, and refused.
fn doubt(runs: &[&Run], until_s: f64, robot: &Description) -> Result<Option<String>, NominalError> {
    let checks = runs.iter().map(|run| RunCheck::new(run, robot, until_s));
    let judged: Vec<RunCheck> = checks.filter(|check| check.is_judged).collect();
    let all = judged.len();
    let doubts: Vec<RunDoubt> = judged.into_iter().filter_map(|c| c.doubt).collect();
    let found = doubts.len();
    match doubts.into_iter().next() {
        Some(doubt) if 2 * found >= all => Err(NominalError::Doubtful(doubt)),
        Some(doubt) => Ok(Some(format!(
            "{found} of {all} runs are doubtful and learned from nevertheless: {doubt}"
        ))),
        None => Ok(None),
    }
}

/// Products of powers of the command that the log does not tell: for what is looked at in all
/// motion, and for a pose.
fn untold(
    records: &[Record],
    model: &Model,
    robot: &Description,
) -> Result<[Vec<Term>; 2], NominalError> {
    let untold = [0.0, noise::SETTLED_S].map(|steady_s| {
        let commands = excitation::settled(records, &model.command, steady_s);
        told::untold(&terms::command(robot), &commands, &model.command)
    });
    let axis = untold[0].iter().find_map(told::single);
    match axis.and_then(|axis| model.command.get(axis)) {
        Some(range) => Err(NominalError::Follows {
            axis: range.name.clone(),
        }),
        None => Ok(untold),
    }
}

/// What to learn from and what to test on: runs left out, or every third block of each.
fn parts<'a>(records: &'a [Record], tests: &'a [Record]) -> (Vec<Part<'a>>, Vec<Part<'a>>) {
    match tests.is_empty() {
        true => records.iter().map(|record| record.split(BLOCKS)).unzip(),
        false => (whole(records), whole(tests)),
    }
}

fn whole(records: &[Record]) -> Vec<Part<'_>> {
    records.iter().map(Record::whole).collect()
}

/// Fits weights and noise of one channel; with the drift of its offset that the log shows.
fn fit(
    model: &Model,
    target: Target,
    terms: &[Term],
    records: &[Part<'_>],
    name: &str,
) -> Result<(Channel, f64), NominalError> {
    let mut channel = Channel {
        target,
        terms: terms.to_vec(),
        weights: vec![0.0; terms.len()],
        variance: [1.0, 0.0, 0.0],
        correlation: 0.0,
        offset_sd: 0.0,
        drift_sd: 0.0,
        rest_sd: 0.0,
        scatter: 1.0,
        held_out_ratio: 1.0,
        tails: Vec::new(),
    };
    regression::fit(&mut channel, records, &model.sizes(), name)?;
    let drift_sd = noise::fit(&mut channel, records, model);
    Ok((channel, drift_sd))
}

/// Factor on the deviations of a short log: two standard errors of a deviation from so many
/// observations.
fn widening(exposure_s: f64, interval_s: f64) -> f64 {
    if exposure_s >= LONG_ENOUGH_S {
        return 1.0;
    }
    1.0 + 2.0 / (2.0 * exposure_s / interval_s).max(2.0).sqrt()
}
