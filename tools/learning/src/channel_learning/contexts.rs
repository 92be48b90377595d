//! How changes that are no fault show, from labelled runs.
//!
//! All is seen through models that have not seen it. Of the steps without a change the second
//! moment is known well, as the log is long; of those with a change it is that of a few runs. Their
//! ratio is kept where it exceeds what so few runs show by chance. A change is used if at least
//! half of its runs are told without their group having been seen.

use std::collections::BTreeSet;
use std::fmt;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use schemars::JsonSchema;
use serde::Serialize;
use vigil_robot::Description;
use vigil_robot::channel_model::context_change::{
    AGES, ChangeAge, ContextChange, DIRECTIONS_MAX, Step, StepChannels, StepDirection, Steps,
    WAIT_S, steps,
};
use vigil_robot::channel_model::{Model, Scales};

use super::recognition::{FOUND, FOUND_RATIO, found_unseen};
use super::record::Record;
use super::unseen;

/// A change is told right within this of its label, s.
pub const TOLD_S: f64 = 1.0;
/// Around a labelled change nothing counts as without one, s: before it, as labels are not exact,
/// and after it, as wheels follow each other.
const AROUND_S: [f64; 2] = [1.0, 10.0];
/// Part of a covariance that is taken for independent.
const INDEPENDENT: f64 = 0.1;
/// Smallest variance of a step: of a channel that never varies.
const VARIANCE_MIN: f64 = 1e-6;
/// So often a change may be told where none is, 1/h, where a log is long enough to show it. Chosen.
const FALSE_1_H: f64 = 3.0;

/// A change that is no fault, in a run that is healthy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabelledChange<'a> {
    /// Id of the run, which is one of the healthy ones.
    pub run: u32,
    /// Name of the declared context.
    pub context: &'a str,
    /// When it came, s.
    pub onset_s: f64,
}

/// What came of a context's runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ContextFit {
    /// Name of the context.
    pub context: String,
    /// Its runs.
    pub runs: usize,
    /// Those that show the step.
    pub runs_with_step: usize,
    /// Groups of the runs with a step.
    pub groups: usize,
    /// Runs told within a second by a signature that has not seen their group.
    pub runs_told: usize,
    /// True if the model tells the change.
    pub is_used: bool,
}

impl ContextFit {
    /// Of a log that is too short to tell what is usual.
    fn of_no_run(context: &str, runs: usize) -> Self {
        Self {
            context: context.to_owned(),
            runs,
            runs_with_step: 0,
            groups: 0,
            runs_told: 0,
            is_used: false,
        }
    }
}

impl fmt::Display for ContextFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (context, told, runs) = (&self.context, self.runs_told, self.runs_with_step);
        if runs < self.runs {
            let (without, all) = (self.runs - runs, self.runs);
            write!(
                f,
                "{context}: {without} of {all} runs are too short around it; "
            )?;
        }
        match self.groups {
            0 => write!(f, "{context}: no run shows it"),
            1 => write!(f, "{context}: not used: all runs are of one group"),
            _ => write!(
                f,
                "{context}: {}told by {told} of {runs} runs within {TOLD_S:.0} s, by a signature \
                 that has not seen their group",
                if self.is_used { "" } else { "not used: " }
            ),
        }
    }
}

/// One window of a run.
struct Moment {
    t_s: f64,
    dt_s: f64,
    steps: Steps,
}

/// A run, or the part of one that one model has not seen.
struct Stretch {
    record: usize,
    /// Length of a block, s.
    block_s: f64,
    moments: Vec<Moment>,
}

/// A labelled change and where it is.
struct Labelled<'a> {
    label: LabelledChange<'a>,
    record: usize,
    group: &'a str,
}

/// The runs of a log by the places of their records.
pub(super) struct Runs<'a> {
    pub ids: Vec<u32>,
    pub groups: Vec<String>,
    pub labelled: &'a [LabelledChange<'a>],
}

/// Fits the changes of `model`, whose channels are fitted.
pub(super) fn fit(
    model: &mut Model,
    (models, records): (&[Model], &[Record]),
    runs: &Runs<'_>,
    (robot, scales): (&Description, &Scales),
) -> Vec<ContextFit> {
    let of_robot = |label: &&LabelledChange<'_>| {
        let mut contexts = robot.context.iter();
        contexts.any(|context| context.name == label.context)
    };
    let all: Vec<Labelled<'_>> = runs
        .labelled
        .iter()
        .filter(of_robot)
        .filter_map(|label| {
            let record = runs.ids.iter().position(|id| *id == label.run)?;
            Some(Labelled {
                label: *label,
                record,
                group: &runs.groups[record],
            })
        })
        .collect();
    if all.is_empty() {
        return Vec::new();
    }
    let channels = model.channel.len();
    let stretches = stretches(models, records, scales, StepChannels::of_robot(robot));
    let mut told = Vec::new();
    for context in &robot.context {
        let shown = (0..channels).filter(|&i| {
            let name = &model.channel[i].name;
            context.shows.is_empty() || context.shows.contains(name)
        });
        let (shown, used) = (shown.collect(), (stretches.as_slice(), all.as_slice()));
        let labels = all.iter().filter(|one| one.label.context == context.name);
        let labels: Vec<&Labelled<'_>> = labels.collect();
        if labels.is_empty() {
            continue;
        }
        let Some(health) = Health::new(used, shown, channels) else {
            told.push(ContextFit::of_no_run(&context.name, labels.len()));
            continue;
        };
        let seen: Vec<&Labelled<'_>> = labels
            .iter()
            .copied()
            .filter(|one| health.shows(one))
            .collect();
        let groups: BTreeSet<&str> = seen.iter().map(|one| one.group).collect();
        let runs_told = health.told(&seen);
        let is_enough = groups.len() > 1 && 2 * runs_told >= seen.len();
        let change = health.change(&context.name, &seen).filter(|_| is_enough);
        told.push(ContextFit {
            context: context.name.clone(),
            runs: labels.len(),
            runs_with_step: seen.len(),
            groups: groups.len(),
            runs_told,
            is_used: change.is_some(),
        });
        model.contexts.change.extend(change);
    }
    told
}

/// The windows of motion, each seen through the model that has not seen it.
fn stretches(
    models: &[Model],
    records: &[Record],
    scales: &Scales,
    seen: StepChannels,
) -> Vec<Stretch> {
    let mut out: Vec<Stretch> = Vec::new();
    let mut part = None;
    unseen::windows(models, records, scales, |sight| {
        let record = &records[sight.record];
        let now = record.histories[sight.newest].ago(0);
        let Some(now) = now.filter(|now| now.moving) else {
            return;
        };
        let fold = record.folds[sight.newest];
        if part.replace((sight.record, fold)) != Some((sight.record, fold)) {
            out.push(Stretch {
                record: sight.record,
                block_s: sight.window.block_s(),
                moments: Vec::new(),
            });
        }
        let steps = steps(sight.window, seen);
        if let Some(stretch) = out.last_mut().filter(|_| steps[0].is_some()) {
            stretch.moments.push(Moment {
                t_s: now.t_ns as f64 * 1e-9,
                dt_s: now.dt_s,
                steps,
            });
        }
    });
    out
}

/// All runs, and what steps they show where nothing changes.
struct Health<'a> {
    /// Length of a block, s.
    block_s: f64,
    channels: usize,
    /// The channels in which it shows.
    shown: Vec<usize>,
    stretches: &'a [Stretch],
    all: &'a [Labelled<'a>],
    /// Roots of the covariances of each age.
    roots: Vec<DMatrix<f64>>,
}

fn vector(step: &Step, shown: &[usize]) -> DVector<f64> {
    DVector::from_iterator(shown.len(), shown.iter().map(|&channel| step[channel]))
}

impl<'a> Health<'a> {
    /// None if the log is too short.
    fn new(
        (stretches, all): (&'a [Stretch], &'a [Labelled<'a>]),
        shown: Vec<usize>,
        channels: usize,
    ) -> Option<Self> {
        let n = shown.len();
        let mut health = Self {
            block_s: stretches.first()?.block_s,
            channels,
            shown,
            stretches,
            all,
            roots: Vec::new(),
        };
        for age in 0..AGES {
            let mut covariance = DMatrix::zeros(n, n);
            let mut count = 0;
            for stretch in stretches {
                let moments = stretch.moments.iter();
                for moment in moments.filter(|one| !health.is_near(stretch, one.t_s)) {
                    if let Some(step) = &moment.steps[age] {
                        let step = vector(step, &health.shown);
                        covariance.ger(1.0, &step, &step, 1.0);
                        count += 1;
                    }
                }
            }
            if count <= n {
                return None;
            }
            covariance /= f64::from(count as u32);
            let diagonal = DMatrix::from_diagonal(&covariance.diagonal());
            let mut shrunk = (1.0 - INDEPENDENT) * covariance + INDEPENDENT * diagonal;
            for i in 0..n {
                shrunk[(i, i)] = shrunk[(i, i)].max(VARIANCE_MIN);
            }
            health.roots.push(shrunk.cholesky()?.l());
        }
        Some(health)
    }

    /// True if a labelled change is so near that nothing counts as without one.
    fn is_near(&self, stretch: &Stretch, t_s: f64) -> bool {
        let [before_s, after_s] = AROUND_S;
        self.all.iter().any(|one| {
            let age_s = t_s - one.label.onset_s;
            one.record == stretch.record && (-before_s..after_s).contains(&age_s)
        })
    }

    fn stretches_of(&self, one: &Labelled<'_>) -> impl Iterator<Item = &'a Stretch> {
        let (record, stretches) = (one.record, self.stretches);
        stretches
            .iter()
            .filter(move |stretch| stretch.record == record)
    }

    /// The steps that a labelled change leaves at an age.
    fn steps_at(&self, one: &Labelled<'_>, age: usize) -> Vec<DVector<f64>> {
        let at_s = one.label.onset_s + (age + 1) as f64 * self.block_s;
        let moments = self.stretches_of(one).flat_map(|stretch| &stretch.moments);
        let near = moments.filter(|moment| (moment.t_s - at_s).abs() <= 0.5 * self.block_s);
        let steps = near.filter_map(|moment| moment.steps[age].as_ref());
        steps.map(|step| vector(step, &self.shown)).collect()
    }

    fn shows(&self, one: &Labelled<'_>) -> bool {
        (0..AGES).any(|age| !self.steps_at(one, age).is_empty())
    }

    /// What these runs show; none if they show nothing.
    fn change(&self, context: &str, runs: &[&Labelled<'_>]) -> Option<ContextChange> {
        let age = (0..AGES).map(|age| ChangeAge {
            direction: self.directions(age, runs),
        });
        let mut change = ContextChange {
            context: context.to_owned(),
            runs: runs.len(),
            threshold: 0.0,
            age: age.collect(),
        };
        change.threshold = self.threshold(&change);
        let shows = change.age.iter().any(|age| !age.direction.is_empty());
        shows.then_some(change)
    }

    /// The directions in which steps of an age are larger with a change. Each run counts alike.
    fn directions(&self, age: usize, runs: &[&Labelled<'_>]) -> Vec<StepDirection> {
        let n = self.shown.len();
        let mut moment = DMatrix::zeros(n, n);
        let mut count = 0.0;
        for run in runs {
            let steps = self.steps_at(run, age);
            let part = 1.0 / steps.len().max(1) as f64;
            for step in &steps {
                let white = self.roots[age].solve_lower_triangular(step);
                let Some(white) = white else { continue };
                moment.ger(part, &white, &white, 1.0);
            }
            count += f64::from(u8::from(!steps.is_empty()));
        }
        if count == 0.0 {
            return Vec::new();
        }
        let eigen = SymmetricEigen::new(moment / count);
        // Of so few runs the ratios of a law without a change lie below this (Marchenko, Pastur).
        let edge = (1.0 + (n as f64 / count).sqrt()).powi(2);
        let ratios = eigen.eigenvalues.iter().copied().enumerate();
        let mut large: Vec<(usize, f64)> = ratios.filter(|(_, ratio)| *ratio > edge).collect();
        large.sort_by(|a, b| b.1.total_cmp(&a.1));
        large.truncate(DIRECTIONS_MAX);
        let direction = |(i, ratio): (usize, f64)| {
            let white = eigen.eigenvectors.column(i).into_owned();
            let found = self.roots[age].tr_solve_lower_triangular(&white)?;
            let mut weights = vec![0.0; self.channels];
            for (&channel, weight) in self.shown.iter().zip(&found) {
                weights[channel] = *weight;
            }
            Some(StepDirection { weights, ratio })
        };
        large.into_iter().filter_map(direction).collect()
    }

    /// The ratio that healthy driving exceeds rarely enough.
    fn threshold(&self, change: &ContextChange) -> f64 {
        let (mut peaks, mut time_s) = (Vec::new(), 0.0);
        for stretch in self.stretches {
            let moments = stretch.moments.iter();
            let healthy = moments.filter(|one| !self.is_near(stretch, one.t_s));
            let mut last_s = f64::NEG_INFINITY;
            for moment in healthy {
                time_s += moment.dt_s;
                let Some((ratio, _)) = change.log_ratio(&moment.steps) else {
                    continue;
                };
                // What the same window holds is told once.
                match peaks.last_mut().filter(|_| moment.t_s < last_s + WAIT_S) {
                    Some(peak) => *peak = f64::max(*peak, ratio),
                    None => {
                        last_s = moment.t_s;
                        peaks.push(ratio);
                    }
                }
            }
        }
        peaks.sort_by(|a, b| b.total_cmp(a));
        let allowed = (FALSE_1_H * time_s / 3600.0) as usize;
        let highest = peaks.get(allowed).copied().unwrap_or(0.0);
        let margin = if allowed == 0 { FOUND_RATIO } else { 1.0 };
        FOUND.max(margin * highest)
    }

    /// How many of these are told by what the other groups show, and when they came.
    fn told(&self, runs: &[&Labelled<'_>]) -> usize {
        let learn = |others: &[&Labelled<'_>]| self.change("", others);
        let is_told = |change: &ContextChange, run: &Labelled<'_>| self.is_told(change, run);
        found_unseen(runs, |run| run.group, learn, is_told)
    }

    /// True if the first change that is told of a run is the labelled one.
    fn is_told(&self, change: &ContextChange, one: &Labelled<'_>) -> bool {
        let moments = self.stretches_of(one).flat_map(|stretch| &stretch.moments);
        let events = moments.filter_map(|moment| {
            let (ratio, age) = change.log_ratio(&moment.steps)?;
            let came_s = moment.t_s - age as f64 * self.block_s;
            let counts = came_s >= one.label.onset_s - AROUND_S[1];
            (ratio > change.threshold && counts).then_some((moment.t_s, came_s))
        });
        let first = events
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, came_s)| came_s);
        first.is_some_and(|t_s| (t_s - one.label.onset_s).abs() <= TOLD_S)
    }
}
