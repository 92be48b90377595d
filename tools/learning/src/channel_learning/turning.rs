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
use vigil_blocks::SensorFrame;
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::orders::{ByOrder, MEMORIES_TURNS, ORDERS};
use vigil_robot::channel_model::turning::{
    TurningFault, TurningSignature, TurningSignatures, WheelNoise, turned,
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
/// Deviations by which what comes back without a fault exceeds chance before a wheel counts as not
/// round.
const ROUND_DEVIATIONS: f64 = 2.0;

/// What a wheel showed at the end of one observation.
#[derive(Debug)]
struct Sight<'a> {
    /// Length of the observation, s.
    dt_s: f64,
    /// How far the wheel has turned since the last sight, turns.
    turns: f64,
    /// By how much the fault's amplitude exceeds that in a single frame.
    gain: f64,
    /// True if a new record begins.
    begins: bool,
    /// With the memory that is learned from.
    orders: &'a WheelOrders,
    /// Of all wheels, with each memory.
    all: &'a [WheelOrders],
}

/// Successive sights of a run.
#[derive(Debug)]
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

/// A run of a fault, its group and what is seen of it.
struct SeenRun {
    group: String,
    onset_s: f64,
    records: Vec<Record>,
}

impl SeenRun {
    fn samples(&self, wheel: usize) -> impl Iterator<Item = Sample<'_>> {
        let sights = self
            .records
            .iter()
            .map(move |record| after_onset(record, wheel, self.onset_s));
        let shown = sights.filter(|sights| !sights.is_empty());
        shown.map(|sights| Sample {
            group: self.group.clone(),
            sights,
        })
    }
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
        let seen = labels.iter().map(|label| SeenRun {
            group: record::group(label.run, groups),
            onset_s: label.onset_s,
            records: record::all(&[label.run], until_s, robot),
        });
        let seen: Vec<SeenRun> = seen.collect();
        let runs: Vec<Sample<'_>> = seen.iter().flat_map(|run| run.samples(wheel)).collect();
        let of_groups: BTreeSet<&String> = runs.iter().map(|run| &run.group).collect();
        let mut fit = FaultFit {
            fault: fault.name.clone(),
            wheel: Some(name.clone()),
            runs: labels.len(),
            runs_with_onset: runs.len(),
            groups: of_groups.len(),
            parts: runs.len(),
            runs_found: 0,
            is_used: false,
        };
        if let Some(health) = health(records, wheel, name) {
            (fit.runs_found, fit.parts) = if fit.groups == 1 {
                let thirds = labels
                    .iter()
                    .flat_map(|label| thirds(label, until_s, robot));
                let thirds: Vec<SeenRun> = thirds.collect();
                let parts = thirds.iter().flat_map(|third| third.samples(wheel));
                health.found(&parts.collect::<Vec<_>>())
            } else {
                health.found(&runs)
            };
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

/// The signatures with the noise of the log without one of its parts.
pub(super) fn with_unseen_noise(
    all: &TurningSignatures,
    (records, part): (&[Record], usize),
    robot: &Description,
) -> TurningSignatures {
    let mut all = all.clone();
    for known in &mut all.wheel {
        let Some(wheel) = robot.wheel_index(&known.wheel) else {
            continue;
        };
        let unseen = records.iter().flat_map(|record| told(record, wheel));
        let unseen = unseen.filter(|(_, fold)| *fold != part);
        let unseen: Vec<Sight<'_>> = unseen.map(|(sight, _)| sight).collect();
        if let Some(found) = noise(unseen.iter(), &known.wheel) {
            *known = found;
        }
    }
    all
}

/// What a run shows after its onset, cut into thirds: each as if it were a run of its own.
fn thirds(label: &LabelledRun<'_>, until_s: f64, robot: &Description) -> Vec<SeenRun> {
    let time_s = |frame: &SensorFrame| frame.header.t_capture_ns as f64 * 1e-9;
    let warm_s = label.run.frames.first().map_or(0.0, time_s) + robot.warm_up_s;
    let is_shown =
        |frame: &&SensorFrame| (label.onset_s.max(warm_s)..=until_s).contains(&time_s(frame));
    let warm = Description {
        warm_up_s: 0.0,
        ..robot.clone()
    };
    let frames = label.run.frames.iter().filter(is_shown).copied();
    let frames: Vec<SensorFrame> = frames.collect();
    let length = frames.len().div_ceil(THIRDS).max(1);
    let third = |(third, frames): (usize, &[SensorFrame])| {
        let run = Run {
            id: label.run.id,
            frames: frames.to_vec(),
        };
        SeenRun {
            group: format!("third {third}"),
            onset_s: 0.0,
            records: record::all(&[&run], until_s, &warm),
        }
    };
    frames.chunks(length).enumerate().map(third).collect()
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
    for (history, all) in record.histories.iter().zip(&record.orders) {
        let is_of = |one: &&WheelOrders| one.wheel == wheel && one.memory_turns == TURNS;
        let found = all.iter().find(is_of);
        let (Some(now), Some(orders)) = (history.ago(0), found) else {
            continue;
        };
        let begins = out.is_empty() || orders.turns < before;
        let turns = if begins { 0.0 } else { orders.turns - before };
        before = orders.turns;
        let sight = Sight {
            dt_s: now.dt_s,
            turns,
            gain: orders.gain,
            begins,
            orders,
            all,
        };
        out.push((now.t_ns as f64 * 1e-9, sight));
    }
    out
}

/// The sights of a run that show its fault long enough to say something.
fn after_onset(record: &Record, wheel: usize, onset_s: f64) -> Vec<Sight<'_>> {
    let (mut began_at, mut begins) = (0.0, false);
    let mut out = Vec::new();
    for (t_s, mut sight) in sights(record, wheel) {
        if sight.begins {
            (began_at, begins) = (0.0, true);
        }
        if t_s < onset_s {
            began_at = sight.orders.turns;
            continue;
        }
        let turns = sight.orders.turns - began_at;
        if sight.orders.is_filled_by(turns) {
            sight.gain = sight.orders.gain_since(turns);
            sight.begins = std::mem::take(&mut begins);
            out.push(sight);
        }
    }
    out
}

/// The sights of a wheel that has turned far enough, with the part of the log of each.
fn told(record: &Record, wheel: usize) -> impl Iterator<Item = (Sight<'_>, usize)> {
    let all = sights(record, wheel).into_iter().zip(&record.folds);
    let all = all.map(|((_, sight), fold)| (sight, *fold));
    all.filter(|(sight, _)| sight.orders.is_told())
}

/// What a wheel shows in the log; none if it never turns far enough.
fn health<'a>(records: &'a [Record], wheel: usize, name: &str) -> Option<Health<'a>> {
    let run = |record: &'a Record| Sample {
        group: String::new(),
        sights: told(record, wheel).map(|(sight, _)| sight).collect(),
    };
    let runs: Vec<Sample<'a>> = records.iter().map(run).collect();
    Some(Health {
        wheel,
        noise: noise(runs.iter().flat_map(|run| &run.sights), name)?,
        runs,
    })
}

/// The noise that a wheel shows; none if it never turns far enough.
fn noise<'a>(
    sights: impl Iterator<Item = &'a Sight<'a>> + Clone,
    name: &str,
) -> Option<WheelNoise> {
    // A wheel at rest shows the same again: it counts by its turns.
    let turns: f64 = sights.clone().map(|sight| sight.turns).sum();
    let places = sights.clone().next()?.orders.beside.len();
    let (mut squares, mut ripple) = (Vec::new(), Vec::new());
    for place in 0..places {
        let (mut beside, mut grown, mut at, mut weight) = (0.0, 0.0, 0.0, 0.0);
        for sight in sights.clone() {
            let Some(square) = sight.orders.beside[place] else {
                continue;
            };
            beside += sight.turns * square;
            grown += sight.turns * square * sight.gain.powi(2);
            at += sight.turns * sight.orders.amplitudes[place].norm_sqr();
            weight += sight.turns;
        }
        squares.push(if weight > 0.0 { beside / weight } else { 0.0 });
        // Of so few independent looks this is chance.
        let chance = ROUND_DEVIATIONS / (weight / (2.0 * TURNS)).sqrt();
        let more = (at - beside - chance * beside).max(0.0);
        ripple.push(if grown > 0.0 { more / grown } else { 0.0 });
    }
    (turns > TURNS).then(|| WheelNoise {
        wheel: name.to_owned(),
        squares,
        ripple,
    })
}

/// Standardized amplitude of a fault over its gain, from successive sights of it.
struct Piece {
    turns: f64,
    /// Turns, by the square of the gain.
    weight: f64,
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
                    weight: 0.0,
                    mean: vec![Complex::default(); sight.orders.amplitudes.len()],
                });
            }
            let Some(last) = out.last_mut().filter(|_| sight.turns > 0.0) else {
                continue;
            };
            let weight = sight.turns * sight.gain.powi(2);
            last.turns += sight.turns;
            last.weight += weight;
            let part = weight / last.weight;
            for (place, mean) in last.mean.iter_mut().enumerate() {
                let amplitude = sight.orders.amplitudes[place] / sight.gain;
                let deviation = self.noise.deviation(sight.orders, place);
                let found = deviation.map_or_else(Complex::default, |sd| amplitude / sd);
                *mean += (found - *mean) * part;
            }
        }
        out.retain(|piece| piece.weight > 0.0);
        out
    }

    /// What these runs have in common; none if they show nothing.
    fn template(&self, runs: &[&Sample<'_>]) -> Option<Vec<Complex<f64>>> {
        let mut pieces: Vec<Piece> = runs.iter().flat_map(|run| self.pieces(run)).collect();
        pieces.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let weight: f64 = pieces.iter().map(|piece| piece.weight).sum();
        let of = |start: &Piece| in_agreement(&pieces, &start.mean);
        let found = pieces.iter().take(STARTS).map(of);
        let mut template = found.max_by(|a, b| square(a).total_cmp(&square(b)))?;
        // Sights within twice the memory are as good as one.
        let turns: f64 = pieces.iter().map(|piece| piece.turns).sum();
        let looks = (turns / (2.0 * TURNS)).max(LOOKS_MIN);
        let noise = turns / (weight * looks);
        for one in &mut template {
            *one *= (1.0 - noise / one.norm_sqr().max(noise)).max(0.0);
        }
        Some(template)
    }

    /// How many of these runs are found by what the runs of the other groups have in common, and
    /// how many there are.
    fn found(&self, runs: &[Sample<'_>]) -> (usize, usize) {
        let learn = |others: &[&Sample<'_>]| {
            let fault = TurningFault {
                wheel: self.wheel,
                noise: self.noise.clone(),
                signature: signature(("", others.len()), &self.template(others)?),
            };
            let healthy = self.runs.iter().map(|run| highest_of(&fault, run));
            let threshold = threshold(healthy.fold(0.0, f64::max));
            Some((fault, threshold))
        };
        let all: Vec<&Sample<'_>> = runs.iter().collect();
        let found = found_unseen(
            &all,
            |run| &run.group,
            learn,
            |(fault, threshold), run| highest_of(fault, run) > *threshold,
        );
        (found, runs.len())
    }
}

/// The highest evidence for a fault in a run.
fn highest_of(fault: &TurningFault, run: &Sample<'_>) -> f64 {
    let ratio = |sight: &Sight<'_>| Some((fault.log_ratio(sight.all)?, sight.dt_s));
    highest(run.sights.iter().filter_map(ratio))
}

/// Mean of pieces, each turned so that it agrees with the others; at first with `start`.
fn in_agreement(pieces: &[Piece], start: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let weight: f64 = pieces.iter().map(|piece| piece.weight).sum();
    let mut template = start.to_vec();
    for _ in 0..ROUNDS {
        let mut mean = vec![Complex::default(); template.len()];
        for piece in pieces {
            let by = Complex::from_polar(1.0, agreeing_rad(&template, &piece.mean));
            let part = piece.weight / weight;
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
    let mut along = ByOrder::default();
    for (place, (a, b)) in template.iter().zip(found).enumerate() {
        along[place % ORDERS] += a.conj() * b;
    }
    let turns = (0..STEPS).map(|step| step as f64 / STEPS as f64);
    let best = turns.max_by(|a, b| turned(&along, *a).total_cmp(&turned(&along, *b)));
    TAU * best.unwrap_or(0.0)
}
