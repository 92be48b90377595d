//! Signatures of declared faults from labelled runs.
//!
//! A fault's mean is that of its runs' means in each phase of its age: a long run counts no more
//! than a short one. The covariance lies between that of health and that of the runs; the fewer
//! these are, the nearer to health. All faults share it: only then do their ratios to health tell
//! them apart. A signature is kept if it finds at least half of the fault's
//! runs without having seen the group that they are of, so one of a single group never is.

use std::collections::BTreeSet;
use std::fmt;

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::Serialize;
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::channel::commands;
use vigil_robot::channel_model::law::BLOCKS;
use vigil_robot::channel_model::signature::{
    Features, Means, Phase, SD_MIN, Signature, Signatures, means, means_count, terms,
};
use vigil_robot::channel_model::window::{Suspects, Window};
use vigil_robot::channel_model::{AXES, Model, Scales};

use super::recognition::{found_unseen, highest, threshold};
use super::record::{self, Record};
use super::unseen;

/// Ages of a fault, s, over which it looks alike: it has hardly begun, it grows, it stands, and
/// controllers answer it. Chosen: the last ends where the robot is no longer the one that was
/// commanded before the fault.
const PHASES_S: [[f64; 2]; 4] = [[0.25, 1.0], [1.0, 2.0], [2.0, 4.0], [4.0, 9.0]];
/// Share of the runs' own covariance for many runs, and the number of runs for half of that.
const OWN_SHARE: f64 = 0.5;
const OWN_RUNS: f64 = 3.0;
/// Runs that would have shown, each at full command, that it changes nothing.
const STEADY_RUNS: f64 = 1.0;
/// Part of a covariance that is taken for independent.
const INDEPENDENT: f64 = 0.1;
/// Time after the onset within which a run is to be found, s.
const FOUND_S: f64 = 10.0;

/// A run with a declared fault.
#[derive(Debug, Clone)]
pub struct LabelledRun<'a> {
    /// Its frames, from before the onset on.
    pub run: &'a Run,
    /// Name of the fault.
    pub fault: &'a str,
    /// Onset, s.
    pub onset_s: f64,
}

/// Means since the onset of a run.
struct Sample<'a> {
    label: &'a LabelledRun<'a>,
    /// Name of the run's group.
    group: String,
    /// Age, s, and length of the observation, s.
    ages: Vec<[f64; 2]>,
    seen: Vec<Features>,
}

/// What came of a declared fault's runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct FaultFit {
    /// Name of the fault.
    pub fault: String,
    /// Wheel with whose turns it comes back; null if with none.
    pub wheel: Option<String>,
    /// Its runs.
    pub runs: usize,
    /// Those that show some healthy seconds, and then how the fault begins.
    pub runs_with_onset: usize,
    /// Groups of the runs with an onset.
    pub groups: usize,
    /// Runs that were looked for: parts of them, where all are of one group and come back with the
    /// turns of a wheel.
    pub parts: usize,
    /// Those of them found by a signature that has not seen their group.
    pub runs_found: usize,
    /// True if the model recognizes the fault by its runs.
    pub is_used: bool,
}

impl fmt::Display for FaultFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (fault, runs) = (&self.fault, self.runs);
        let used = if self.is_used {
            "recognized"
        } else {
            "not recognized"
        };
        let parts = (self.runs_found, self.parts);
        if let Some(wheel) = &self.wheel {
            return match self.groups {
                0 => write!(f, "{fault}: no run shows turns of {wheel}"),
                1 => write!(
                    f,
                    "{fault}: {used} by the turns of {wheel}: {} of {} parts found by a signature \
                     of the others. All runs are of one group: what else was special of that \
                     day is taken for the fault, too",
                    parts.0, parts.1
                ),
                _ => write!(
                    f,
                    "{fault}: {used} by the turns of {wheel}: {} of {} runs found by a signature \
                     that has not seen their group",
                    parts.0, parts.1
                ),
            };
        }
        if self.runs_with_onset < runs {
            let without = runs - self.runs_with_onset;
            write!(
                f,
                "{fault}: {without} of {runs} runs show no healthy seconds before it; "
            )?;
        }
        match self.groups {
            0 => write!(f, "{fault}: no run shows how it begins"),
            1 => write!(
                f,
                "{fault}: not recognized by its runs: all are of one group"
            ),
            _ => write!(
                f,
                "{fault}: {used} by its runs: {} of {} found by a signature that has not seen \
                 their group",
                parts.0, parts.1
            ),
        }
    }
}

/// Fits the signatures of `model`, whose joint law is fitted.
pub(super) fn fit(
    model: &mut Model,
    (models, records): (&[Model], &[Record]),
    (labelled, groups): (&[LabelledRun<'_>], &[(u32, String)]),
    (robot, scales, until_s): (&Description, &Scales, f64),
) -> Vec<FaultFit> {
    if labelled.is_empty() {
        return Vec::new();
    }
    let mut healthy = healthy_means(models, records, scales);
    let n = means_count(model.channel.len());
    let Some((mean, covariance)) = moments(&healthy, n) else {
        return Vec::new();
    };
    let sd: Vec<f64> = (0..n)
        .map(|i| covariance[(i, i)].sqrt().max(SD_MIN))
        .collect();
    model.signatures = Signatures {
        mean: mean.iter().copied().collect(),
        sd: sd.clone(),
        fault: Vec::new(),
    };
    for seen in healthy.iter_mut().flat_map(|run| &mut run.seen) {
        seen.means = model.signatures.standardized(&seen.means);
    }
    let health = Health {
        terms: 1 + model.command.len().min(AXES),
        correlation: DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] / (sd[i] * sd[j])),
        runs: healthy,
    };
    let samples = samples(model, (labelled, groups), (robot, scales, until_s));
    let (mut told, mut used, mut shown) = (Vec::new(), Vec::new(), Vec::new());
    for fault in robot.fault.iter().filter(|fault| fault.wheel.is_none()) {
        let of_fault = samples.iter().filter(|one| one.label.fault == fault.name);
        let runs: Vec<&Sample<'_>> = of_fault.collect();
        let labels = labelled.iter().filter(|label| label.fault == fault.name);
        let labels = labels.count();
        if labels == 0 {
            continue;
        }
        let groups: BTreeSet<&str> = runs.iter().map(|run| run.group.as_str()).collect();
        let runs_found = found(&health, &fault.name, &runs);
        let is_used = groups.len() > 1 && 2 * runs_found >= runs.len();
        if is_used {
            used.push(fault.name.as_str());
            shown.push(Shown::new(&runs, &health));
        }
        told.push(FaultFit {
            fault: fault.name.clone(),
            wheel: None,
            parts: runs.len(),
            runs: labels,
            runs_with_onset: runs.len(),
            groups: groups.len(),
            runs_found,
            is_used,
        });
    }
    model.signatures.fault = health.signatures(&used, &shown).unwrap_or_default();
    if model.signatures.is_empty() {
        model.signatures = Signatures::default();
    }
    told
}

/// The means of a healthy robot, in each run.
#[derive(Default)]
struct HealthyRun {
    dt_s: Vec<f64>,
    seen: Vec<Features>,
}

struct Health {
    /// Terms of the command.
    terms: usize,
    /// Correlation of the standardized means.
    correlation: DMatrix<f64>,
    /// Standardized means.
    runs: Vec<HealthyRun>,
}

/// Each part of the log seen through the model that has not seen it.
fn healthy_means(models: &[Model], records: &[Record], scales: &Scales) -> Vec<HealthyRun> {
    let mut out: Vec<HealthyRun> = Vec::new();
    let mut part = None;
    let sizes = models.first().map_or([1.0; AXES], Model::sizes);
    unseen::windows(models, records, scales, |sight| {
        let record = &records[sight.record];
        let Some(now) = record.histories[sight.newest].ago(0) else {
            return;
        };
        if !now.moving || sight.window.whole_blocks() < BLOCKS {
            return;
        }
        let fold = record.folds[sight.newest];
        if part.replace((sight.record, fold)) != Some((sight.record, fold)) {
            out.push(HealthyRun::default());
        }
        let channels = models[fold].channel.len();
        if let Some(run) = out.last_mut() {
            run.dt_s.push(now.dt_s);
            run.seen.push(Features {
                means: means(sight.window, channels),
                terms: terms(now, &sizes),
            });
        }
    });
    out
}

/// Mean and covariance of the first `n` means.
fn moments(runs: &[HealthyRun], n: usize) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let all = || {
        runs.iter()
            .flat_map(|run| &run.seen)
            .map(|seen| &seen.means)
    };
    let count = all().count();
    (count > n).then(|| {
        let part = 1.0 / count as f64;
        let mut mean = DVector::zeros(n);
        all().for_each(|m| mean += part * vector(m, n));
        let mut covariance = DMatrix::zeros(n, n);
        for m in all() {
            let apart = vector(m, n) - &mean;
            covariance.ger(part, &apart, &apart, 1.0);
        }
        (mean, covariance)
    })
}

fn vector(means: &Means, n: usize) -> DVector<f64> {
    DVector::from_column_slice(&means[..n])
}

/// The labelled runs through the model of health: those that show it for a whole window, and then
/// the fault.
fn samples<'a>(
    model: &Model,
    (labelled, groups): (&'a [LabelledRun<'a>], &[(u32, String)]),
    (robot, scales, until_s): (&Description, &Scales, f64),
) -> Vec<Sample<'a>> {
    let (n, sizes) = (model.channel.len(), model.sizes());
    let used = model.channel.iter().cloned().enumerate().collect();
    let mut window = Window::new(used, scales.clone(), model.interval_s);
    let mut sample = |label: &'a LabelledRun<'a>| {
        let mut out = Sample {
            label,
            group: record::group(label.run, groups),
            ages: Vec::new(),
            seen: Vec::new(),
        };
        window.reset();
        let mut is_healthy_first = false;
        let until_s = until_s.min(label.onset_s + FOUND_S);
        for record in record::all(&[label.run], until_s, robot) {
            for history in &record.histories {
                let Some(now) = history.ago(0) else { continue };
                if history.ago(scales.lags).is_none() {
                    window.clear();
                    continue;
                }
                window.push(
                    history,
                    &commands(history),
                    (model.widening(history), Suspects::default()),
                );
                let age_s = now.t_ns as f64 * 1e-9 - label.onset_s;
                let is_whole = window.whole_blocks() == BLOCKS;
                is_healthy_first |= age_s < 0.0 && is_whole;
                if age_s >= 0.0 && is_whole && is_healthy_first {
                    out.ages.push([age_s, now.dt_s]);
                    let found = means(&window, n);
                    out.seen.push(Features {
                        means: model.signatures.standardized(&found),
                        terms: terms(now, &sizes),
                    });
                }
            }
        }
        (!out.ages.is_empty()).then_some(out)
    };
    labelled.iter().filter_map(&mut sample).collect()
}

/// What runs of one fault show.
struct Shown {
    runs: usize,
    /// Mean of each phase that they show, a column for each term of the command.
    phases: Vec<DMatrix<f64>>,
    /// Sum of squares about these, over so many observations.
    spread: DMatrix<f64>,
    count: f64,
}

impl Shown {
    fn new(runs: &[&Sample<'_>], health: &Health) -> Self {
        let n = health.correlation.nrows();
        let mut shown = Self {
            runs: runs.len(),
            phases: Vec::new(),
            spread: DMatrix::zeros(n, n),
            count: 0.0,
        };
        for [from, to] in PHASES_S {
            let in_phase = |run: &&Sample<'_>| {
                let ages = run.ages.iter().zip(&run.seen);
                let within = ages.filter(|([age, _], _)| (from..to).contains(age));
                within.map(|(_, seen)| *seen).collect::<Vec<_>>()
            };
            let found = runs.iter().map(in_phase);
            let found: Vec<Vec<Features>> = found.filter(|found| !found.is_empty()).collect();
            let Some(by_terms) = by_terms(&found, n, health.terms) else {
                continue;
            };
            for seen in found.iter().flatten() {
                let terms = DVector::from_column_slice(&seen.terms[..health.terms]);
                let apart = vector(&seen.means, n) - &by_terms * terms;
                shown.spread.ger(1.0, &apart, &apart, 1.0);
                shown.count += 1.0;
            }
            shown.phases.push(by_terms);
        }
        shown
    }
}

/// What the runs' `n` means have in common, and what the command changes of it: ridge regression
/// on its `m` terms. Each run is one observation, and as many as [`STEADY_RUNS`] are taken to have
/// shown that the command changes nothing. None of no runs.
fn by_terms(runs: &[Vec<Features>], n: usize, m: usize) -> Option<DMatrix<f64>> {
    let mut gram = DMatrix::from_fn(m, m, |i, j| match i == j && i > 0 {
        true => STEADY_RUNS,
        false => 0.0,
    });
    let mut products = DMatrix::zeros(n, m);
    for run in runs {
        let part = 1.0 / run.len() as f64;
        let (mut means, mut terms) = (DVector::zeros(n), DVector::zeros(m));
        for seen in run {
            means += part * vector(&seen.means, n);
            terms += part * DVector::from_column_slice(&seen.terms[..m]);
        }
        gram.ger(1.0, &terms, &terms, 1.0);
        products.ger(1.0, &means, &terms, 1.0);
    }
    let solved = gram.cholesky()?.solve(&products.transpose());
    Some(solved.transpose())
}

impl Health {
    /// The signature that these runs show; none if they show no phase.
    fn signature(&self, fault: &str, runs: &[&Sample<'_>]) -> Option<Signature> {
        let shown = [Shown::new(runs, self)];
        self.signatures(&[fault], &shown)?.pop()
    }

    /// The signatures of faults that are told apart by one covariance; none if there is none.
    fn signatures(&self, faults: &[&str], shown: &[Shown]) -> Option<Vec<Signature>> {
        let n = self.correlation.nrows();
        let runs: usize = shown.iter().map(|one| one.runs).sum();
        let count: f64 = shown.iter().map(|one| one.count).sum();
        let spread = shown
            .iter()
            .fold(DMatrix::zeros(n, n), |sum, one| sum + &one.spread);
        let own = OWN_SHARE * runs as f64 / (runs as f64 + OWN_RUNS);
        let mixed = (1.0 - own) * &self.correlation + own / f64::max(count, 1.0) * spread;
        let diagonal = DMatrix::from_diagonal(&mixed.diagonal());
        let inverse = ((1.0 - INDEPENDENT) * mixed + INDEPENDENT * diagonal).cholesky()?;
        let rows = |of: &DMatrix<f64>| -> Vec<Vec<f64>> {
            let rows = of.row_iter();
            rows.map(|row| row.iter().copied().collect()).collect()
        };
        let phase = |by_terms: &DMatrix<f64>| {
            let weights = inverse.solve(by_terms);
            Phase {
                squares: rows(&(by_terms.transpose() * &weights)),
                weights: rows(&weights.transpose()),
            }
        };
        let signature = |(fault, shown): (&&str, &Shown)| Signature {
            fault: (*fault).to_owned(),
            runs: shown.runs,
            phase: shown.phases.iter().map(phase).collect(),
        };
        let all = faults.iter().zip(shown).map(signature);
        Some(all.filter(|one| !one.phase.is_empty()).collect())
    }

    /// The highest evidence that a signature has without a fault.
    fn highest(&self, signature: &Signature) -> f64 {
        let of_run = |run: &HealthyRun| {
            let observations = run.dt_s.iter().zip(&run.seen);
            highest(observations.map(|(dt_s, seen)| (signature.log_ratio(seen), *dt_s)))
        };
        self.runs.iter().map(of_run).fold(0.0, f64::max)
    }
}

/// How many of a fault's runs are found by the signature that the other groups show.
fn found(health: &Health, fault: &str, runs: &[&Sample<'_>]) -> usize {
    let learn = |others: &[&Sample<'_>]| {
        let signature = health.signature(fault, others)?;
        let threshold = threshold(health.highest(&signature));
        Some((signature, threshold))
    };
    found_unseen(
        runs,
        |run| &run.group,
        learn,
        |(signature, threshold), run| {
            let observations = run.ages.iter().zip(&run.seen);
            let ratios = observations.map(|([_, dt_s], seen)| (signature.log_ratio(seen), *dt_s));
            highest(ratios) > *threshold
        },
    )
}
