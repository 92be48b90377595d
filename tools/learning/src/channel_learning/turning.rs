//! Signatures of faults that come back with the turns of a wheel, from labelled runs.
//!
//! How a wheel stood when a run began is not known. The runs are cut into pieces, the pieces turned
//! until they agree, and averaged; each amplitude is lessened by as much as noise alone would leave
//! of it. A signature is kept if it finds at least half of the fault's runs without having seen
//! their group. All runs of one group are cut into thirds, of which two find the other: nothing
//! tells the fault from what was special of that day, and the report says so.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use nalgebra::Complex;
use vigil_robot::Description;
use vigil_robot::channel_model::orders::{MEMORIES_TURNS, ORDERS};
use vigil_robot::channel_model::turning::{
    TurningSignature, TurningSignatures, WheelNoise, turned,
};
use vigil_robot::channel_model::{Model, WheelOrders};

use super::labelled::{FaultFit, LabelledRun};
use super::recognition::{found_unseen, highest, threshold};
use super::record::{self, Record};

/// The memory that is learned from.
const TURNS: f64 = MEMORIES_TURNS[0];
/// Turns of a piece: so few that an angle summed from rates has not gone astray. Chosen.
const PIECE_TURNS: f64 = 24.0;
/// Pieces with which the others are made to agree in turn, to find where all agree most.
const STARTS: usize = 16;
/// Rounds in which pieces are turned to agree with their mean, and the steps in a turn.
const ROUNDS: usize = 8;
const STEPS: usize = 72;
/// Fewest independent looks that a mean is taken for.
const LOOKS_MIN: f64 = 3.0;
/// Parts of the runs of a single group.
const THIRDS: usize = 3;

/// What a wheel showed at the end of one observation.
#[derive(Debug, Clone)]
struct Sight<'a> {
    /// Length of the observation, s.
    dt_s: f64,
    /// How far the wheel has turned since the last sight, turns.
    turns: f64,
    /// True if a new record begins.
    begins: bool,
    /// With the memory that is learned from.
    orders: &'a WheelOrders,
    /// Of all wheels, with each memory.
    all: &'a [WheelOrders],
}

/// Successive sights of a run.
#[derive(Debug, Clone)]
struct Sample<'a> {
    group: String,
    sights: Vec<Sight<'a>>,
}

/// The wheel of a fault without a fault.
struct Health<'a> {
    wheel: usize,
    noise: WheelNoise,
    runs: Vec<Sample<'a>>,
}

/// Fits the turning signatures of `model`.
pub(super) fn fit(
    model: &mut Model,
    records: &[Record],
    (labelled, groups): (&[LabelledRun<'_>], &[(u32, String)]),
    (robot, until_s): (&Description, f64),
) -> Vec<FaultFit> {
    let mut told = Vec::new();
    for fault in &robot.fault {
        let labels = labelled.iter().filter(|label| label.fault == fault.name);
        let labels: Vec<&LabelledRun<'_>> = labels.collect();
        let Some(name) = fault.wheel.as_ref().filter(|_| !labels.is_empty()) else {
            continue;
        };
        let Some(wheel) = robot.wheel_index(name) else {
            continue;
        };
        let of_run = |label: &&LabelledRun<'_>| record::all(&[label.run], until_s, robot);
        let seen: Vec<Vec<Record>> = labels.iter().map(of_run).collect();
        let mut runs = Vec::new();
        for (label, records) in labels.iter().zip(&seen) {
            let group = record::group(label.run, groups);
            for record in records {
                let sights = after_onset(record, wheel, label.onset_s);
                if !sights.is_empty() {
                    runs.push(Sample {
                        group: group.clone(),
                        sights,
                    });
                }
            }
        }
        let mut fit = FaultFit {
            fault: fault.name.clone(),
            wheel: Some(name.clone()),
            runs: labels.len(),
            runs_with_onset: runs.len(),
            groups: runs
                .iter()
                .map(|run| &run.group)
                .collect::<BTreeSet<_>>()
                .len(),
            parts: runs.len(),
            runs_found: 0,
            is_used: false,
        };
        if let Some(health) = health(records, wheel, name) {
            let parts = if fit.groups == 1 {
                thirds(&runs)
            } else {
                runs.clone()
            };
            fit.parts = parts.len();
            fit.runs_found = health.found(&parts);
            let template = health.template(&runs.iter().collect::<Vec<_>>());
            let is_enough = fit.parts > 1 && 2 * fit.runs_found >= fit.parts;
            if let Some(template) = template.filter(|_| is_enough) {
                fit.is_used = true;
                keep(
                    &mut model.turning,
                    &health.noise,
                    (&fault.name, runs.len()),
                    &template,
                );
            }
        }
        told.push(fit);
    }
    told
}

/// Adds a signature, and the noise of its wheel.
fn keep(
    all: &mut TurningSignatures,
    noise: &WheelNoise,
    (fault, runs): (&str, usize),
    template: &[Complex<f64>],
) {
    if all.noise(&noise.wheel).is_none() {
        all.wheel.push(noise.clone());
    }
    all.fault.push(signature((fault, runs), template));
}

fn signature((fault, runs): (&str, usize), template: &[Complex<f64>]) -> TurningSignature {
    TurningSignature {
        fault: fault.to_owned(),
        runs,
        real: template.iter().map(|one| one.re).collect(),
        imaginary: template.iter().map(|one| one.im).collect(),
    }
}

/// All sights of a wheel in a record, with their times, s.
fn sights(record: &Record, wheel: usize) -> Vec<(f64, Sight<'_>)> {
    let mut out = Vec::new();
    let mut before = 0.0;
    for (history, orders) in record.histories.iter().zip(&record.orders) {
        let is_of = |one: &&WheelOrders| one.wheel == wheel && one.memory_turns == TURNS;
        let all = orders;
        let found = orders.iter().find(is_of);
        let (Some(now), Some(orders)) = (history.ago(0), found) else {
            continue;
        };
        let begins = out.is_empty() || orders.turns < before;
        let turns = if begins { 0.0 } else { orders.turns - before };
        before = orders.turns;
        let sight = Sight {
            dt_s: now.dt_s,
            turns,
            begins,
            orders,
            all,
        };
        out.push((now.t_ns as f64 * 1e-9, sight));
    }
    out
}

/// The sights of a run that show its fault: the turns before the onset are forgotten.
fn after_onset(record: &Record, wheel: usize, onset_s: f64) -> Vec<Sight<'_>> {
    let mut forgotten_at = 0.0;
    let mut out = Vec::new();
    for (t_s, sight) in sights(record, wheel) {
        if sight.begins {
            forgotten_at = 0.0;
        }
        let turns = sight.orders.turns;
        if t_s < onset_s {
            forgotten_at = turns + TURNS;
        } else if turns >= forgotten_at && sight.orders.is_told() {
            out.push(sight);
        }
    }
    out
}

/// What a wheel shows in the log; none if it never turns far enough.
fn health<'a>(records: &'a [Record], wheel: usize, name: &str) -> Option<Health<'a>> {
    let run = |record: &'a Record| Sample {
        group: String::new(),
        sights: sights(record, wheel)
            .into_iter()
            .map(|(_, sight)| sight)
            .filter(|sight| sight.orders.is_told())
            .collect(),
    };
    let runs: Vec<Sample<'a>> = records.iter().map(run).collect();
    let all = || runs.iter().flat_map(|run| &run.sights);
    // A wheel at rest shows the same again: it counts by its turns.
    let turns: f64 = all().map(|sight| sight.turns).sum();
    let mut squares = vec![0.0; all().next()?.orders.beside.len()];
    for sight in all() {
        for (square, beside) in squares.iter_mut().zip(&sight.orders.beside) {
            *square += sight.turns / turns * beside;
        }
    }
    (turns > TURNS).then(|| Health {
        wheel,
        noise: WheelNoise {
            wheel: name.to_owned(),
            squares,
        },
        runs,
    })
}

/// Each run cut into thirds, the first turns of which are left out: they show the third before.
fn thirds<'a>(runs: &[Sample<'a>]) -> Vec<Sample<'a>> {
    let mut out = Vec::new();
    for run in runs {
        let turns: f64 = run.sights.iter().map(|sight| sight.turns).sum();
        for third in 0..THIRDS {
            let from = turns * third as f64 / THIRDS as f64;
            let to = turns * (third + 1) as f64 / THIRDS as f64;
            let from = if third == 0 { from } else { from + TURNS };
            let mut turned = 0.0;
            let is_within = |sight: &&Sight<'_>| {
                turned += sight.turns;
                (from..=to).contains(&turned)
            };
            out.push(Sample {
                group: format!("third {third}"),
                sights: run.sights.iter().filter(is_within).cloned().collect(),
            });
        }
    }
    out.retain(|third| !third.sights.is_empty());
    out
}

/// Mean of successive standardized amplitudes.
struct Piece {
    turns: f64,
    mean: Vec<Complex<f64>>,
}

impl Health<'_> {
    fn pieces(&self, run: &Sample<'_>) -> Vec<Piece> {
        let mut out: Vec<Piece> = Vec::new();
        for sight in &run.sights {
            let is_full = out.last().is_none_or(|last| last.turns >= PIECE_TURNS);
            if sight.begins || is_full {
                out.push(Piece {
                    turns: 0.0,
                    mean: vec![Complex::default(); sight.orders.amplitudes.len()],
                });
            }
            let Some(last) = out.last_mut().filter(|_| sight.turns > 0.0) else {
                continue;
            };
            last.turns += sight.turns;
            let part = sight.turns / last.turns;
            for (place, mean) in last.mean.iter_mut().enumerate() {
                *mean += (self.noise.standardized(sight.orders, place) - *mean) * part;
            }
        }
        out.retain(|piece| piece.turns > 0.0);
        out
    }

    /// What these runs have in common; none if they show nothing.
    fn template(&self, runs: &[&Sample<'_>]) -> Option<Vec<Complex<f64>>> {
        let mut pieces: Vec<Piece> = runs.iter().flat_map(|run| self.pieces(run)).collect();
        pieces.sort_by(|a, b| b.turns.total_cmp(&a.turns));
        let turns: f64 = pieces.iter().map(|piece| piece.turns).sum();
        let of = |start: &Piece| in_agreement(&pieces, &start.mean);
        let found = pieces.iter().take(STARTS).map(of);
        let mut template = found.max_by(|a, b| square(a).total_cmp(&square(b)))?;
        let noise = 1.0 / (turns / TURNS).max(LOOKS_MIN);
        for one in &mut template {
            *one *= (1.0 - noise / one.norm_sqr().max(noise)).max(0.0);
        }
        Some(template)
    }

    /// How many of these runs are found by what the runs of the other groups have in common.
    fn found(&self, runs: &[Sample<'_>]) -> usize {
        let learn = |others: &[&Sample<'_>]| {
            let signature = signature(("", others.len()), &self.template(others)?);
            let healthy = self.runs.iter().map(|run| self.highest(&signature, run));
            let threshold = threshold(healthy.fold(0.0, f64::max));
            Some((signature, threshold))
        };
        let runs: Vec<&Sample<'_>> = runs.iter().collect();
        found_unseen(
            &runs,
            |run| &run.group,
            learn,
            |(signature, threshold), run| self.highest(signature, run) > *threshold,
        )
    }

    /// The highest evidence for a signature in a run.
    fn highest(&self, signature: &TurningSignature, run: &Sample<'_>) -> f64 {
        highest(run.sights.iter().filter_map(|sight| {
            let log_ratio = signature.log_ratio(&self.noise, self.wheel, sight.all)?;
            Some((log_ratio, sight.dt_s))
        }))
    }
}

/// Mean of pieces, each turned so that it agrees with the others; at first with `start`.
fn in_agreement(pieces: &[Piece], start: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let turns: f64 = pieces.iter().map(|piece| piece.turns).sum();
    let mut template = start.to_vec();
    for _ in 0..ROUNDS {
        let mut mean = vec![Complex::default(); template.len()];
        for piece in pieces {
            let by = Complex::from_polar(1.0, agreeing_rad(&template, &piece.mean));
            let part = piece.turns / turns;
            for (place, (mean, one)) in mean.iter_mut().zip(&piece.mean).enumerate() {
                *mean += one * by.powi((place % ORDERS) as i32 + 1) * part;
            }
        }
        template = mean;
    }
    template
}

fn square(template: &[Complex<f64>]) -> f64 {
    template.iter().map(Complex::norm_sqr).sum()
}

/// By how much to turn on a wheel so that its amplitudes agree most with a template, rad.
fn agreeing_rad(template: &[Complex<f64>], found: &[Complex<f64>]) -> f64 {
    let mut along = [Complex::default(); ORDERS];
    for (place, (a, b)) in template.iter().zip(found).enumerate() {
        along[place % ORDERS] += a.conj() * b;
    }
    let turns = (0..STEPS).map(|step| step as f64 / STEPS as f64);
    let best = turns.max_by(|a, b| turned(&along, *a).total_cmp(&turned(&along, *b)));
    TAU * best.unwrap_or(0.0)
}
