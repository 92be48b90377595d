//! What is left of a channel: its variance by speed, its colour, its scatter from run to run.

use vigil_inference::logspace::log_normal;
use vigil_robot::nominal::channel::REST_S;
use vigil_robot::nominal::{Channel, History, Model, Residual, ResidualWhitener};

use super::record::Part;
use crate::bounds::{Bounds, Limits};

/// Motion before an observation counts, s, and how long the command must be steady for a pose.
pub(super) const MOVING_S: f64 = 0.5;
pub(super) const SETTLED_S: f64 = 1.0;
/// Part of the runs whose scatter counts as usual, and the bounds of the scatter.
const USUAL: f64 = 0.95;
const SCATTER: Limits = Limits {
    number: "channel.scatter",
    least: (1.0, "no run is quieter than the learned noise"),
    most: (
        10.0,
        "a run noisier than three deviations all along is no healthy one",
    ),
};
/// Time in which an offset may change as much as from run to run, s.
const DRIFT_S: f64 = 60.0;
/// Rounds of the fit of the variance.
const STEPS: usize = 60;
/// Bounds of the correlation.
const CORRELATION: Limits = Limits {
    number: "channel.correlation",
    least: (
        -0.45,
        "differences of white noise have -0.5, and then no mean is left to tell",
    ),
    most: (
        0.97,
        "residuals that last longer than 33 observations are an offset's drift",
    ),
};
/// Length of the pieces whose means tell the scatter of an offset where there is one run,
/// observations.
const PIECE: usize = 100;
const PIECE_MIN: usize = 4;
/// Smallest deviation, relative to the channel's usual size: a channel that follows its prediction
/// exactly would else see a fault in every rounding.
const FLOOR: f64 = 1e-3;

/// The fastest motion in the log at rest counts as so many deviations.
const REST_SDS: f64 = 3.0;
/// Least deviation of a velocity at rest, m/s or rad/s: chosen, below what any pose tells.
const REST_SD_MIN: f64 = 1e-3;

/// Drifts tried, per observation, relative to the residual's deviation.
const DRIFTS: [f64; 7] = [0.0, 0.01, 0.02, 0.04, 0.07, 0.12, 0.2];
/// Residuals beyond so many deviations say nothing more on the noise.
const CLIP: f64 = 4.0;

/// True if an observation takes part in learning a channel.
pub(super) fn counts(history: &History, channel: &Channel) -> bool {
    history.ago(0).is_some_and(|now| {
        let steady = now.steady_s >= SETTLED_S || !channel.target.quantity.is_pose();
        now.moving && now.moving_s >= MOVING_S && steady
    })
}

/// Residuals, and whether each follows the one before.
fn residuals(channel: &Channel, record: &[&History], model: &Model) -> Vec<(Residual, bool)> {
    let (mut out, mut follows) = (Vec::new(), false);
    for history in record {
        let residual = channel.residual(history, &model.sizes());
        let Some(residual) = residual.filter(|_| counts(history, channel)) else {
            follows = false;
            continue;
        };
        out.push((residual, follows));
        follows = true;
    }
    out
}

/// Fits variance, correlation, offset and drift. Returns the drift that the log shows, which the
/// channel's may not reach.
pub(super) fn fit(channel: &mut Channel, records: &[Part<'_>], model: &Model) -> f64 {
    let several = records.len() > 1;
    let of = |record: &Part<'_>| residuals(channel, &record.histories, model);
    let whole: Vec<Vec<(Residual, bool)>> = records.iter().map(of).collect();
    let length = if several { usize::MAX } else { PIECE };
    let pieces = whole.iter().flat_map(|record| record.chunks(length));
    let pieces: Vec<_> = pieces.filter(|piece| piece.len() >= PIECE_MIN).collect();
    let means: Vec<f64> = pieces
        .iter()
        .map(|piece| mean(piece.iter().map(|r| r.0.apart)))
        .collect();
    let mut squares = Vec::new();
    for (piece, &mean) in pieces.iter().zip(&means) {
        // Only where each run has its own offset is it taken out.
        let mean = if several { mean } else { 0.0 };
        let n = piece.len() as f64;
        let used = if several { (n / (n - 1.0)).sqrt() } else { 1.0 };
        for &(residual, follows) in *piece {
            squares.push(((residual.apart - mean) * used, residual.basis, follows));
        }
    }
    channel.variance = variance(&squares);
    channel.variance[0] = channel.variance[0].max(variance_min(channel, records));
    channel.correlation = correlation(channel, &squares);
    let within = mean(
        squares
            .iter()
            .map(|&(apart, basis, _)| apart * apart / at(channel, basis)),
    );
    let usual = mean(squares.iter().map(|&(_, basis, _)| at(channel, basis)));
    let longest = squares.len() as f64 / pieces.len().max(1) as f64;
    let rho = channel.correlation;
    let of_mean = within * usual * ((1.0 + rho) / (1.0 - rho)).max(0.1) / longest.max(1.0);
    let between = mean(means.iter().map(|mean| mean * mean));
    let offset = (between - of_mean).max(0.0).sqrt();
    channel.offset_sd = if means.len() > 1 { offset } else { 0.0 };
    // In a minute, an offset may change as much as from run to run, and no more: a faster one would
    // explain a fault away.
    let limit = channel.offset_sd * (model.interval_s / DRIFT_S).sqrt();
    let drift_sd = drift(channel, &whole);
    channel.drift_sd = drift_sd.min(limit);
    channel.scatter = scatter(channel, &whole, length);
    channel.rest_sd = rest_sd(channel, records, &whole);
    drift_sd
}

/// Least constant part of a channel's variance.
fn variance_min(channel: &Channel, records: &[Part<'_>]) -> f64 {
    let floor = FLOOR * usual_size(channel, records);
    (floor * floor).max(1e-12)
}

/// Tells which numbers of the channel at `key`, whose deviations were widened by `widen`, stand on
/// a bound; `drift_sd`: what [`fit`] returned.
pub(super) fn tell(
    bounds: &mut Bounds,
    key: &str,
    channel: &Channel,
    records: &[Part<'_>],
    widen: f64,
    drift_sd: f64,
) {
    let mut look = |limits: &Limits, field: &str, value: f64| {
        bounds.look(limits, format!("{key}.{field}"), value);
    };
    let least = variance_min(channel, records) * widen * widen;
    let why = "a thousandth of the channel's size: a rounding is no fault";
    let variance = Limits::least("channel.variance[0]", least, why);
    look(&variance, "variance[0]", channel.variance[0]);
    look(&CORRELATION, "correlation", channel.correlation);
    look(&SCATTER, "scatter", channel.scatter);
    if drift_sd > channel.drift_sd {
        let why = "a mean may change in a minute as much as from run to run";
        let most = Limits::most("channel.drift_sd", channel.drift_sd, why);
        look(&most, "drift_sd", channel.drift_sd);
    }
    if channel.target.quantity.is_pose() {
        let why = "no pose tells a slower motion at rest";
        let rest = Limits::least("channel.rest_sd", REST_SD_MIN * widen, why);
        look(&rest, "rest_sd", channel.rest_sd);
    }
}

/// Deviation of the velocity that a pose shows at rest: that of its residuals in motion, which have
/// the sensor's noise and the ground's, or what the log's own rests ask for.
fn rest_sd(channel: &Channel, records: &[Part<'_>], residuals: &[Vec<(Residual, bool)>]) -> f64 {
    if !channel.target.quantity.is_pose() {
        return 0.0;
    }
    // The second of the basis is the square of the commanded speed.
    let squares = residuals.iter().flatten();
    let in_motion = mean(squares.map(|(r, _)| r.apart * r.apart * r.basis[1])).sqrt();
    let newest = records.iter().flat_map(|part| &part.histories);
    let rests = newest.filter_map(|h| h.ago(0).filter(|now| now.rest_s >= REST_S)?.drift);
    let sizes = rests.filter_map(|drift| Some(channel.target.quantity.of_pose(drift)?.abs()));
    let largest = sizes.fold(0.0, f64::max);
    in_motion.max(largest / REST_SDS).max(REST_SD_MIN)
}

/// Mean square of the whitened residuals in the noisiest usual run, or piece of one: no run's noise
/// is quite that of another.
fn scatter(channel: &Channel, records: &[Vec<(Residual, bool)>], length: usize) -> f64 {
    let mut squares = Vec::new();
    for record in records {
        let mut track = ResidualWhitener::new(channel);
        let whitened = innovations(channel, &mut track, record);
        let whitened: Vec<f64> = whitened
            .map(|(apart, spread)| apart * apart / spread)
            .collect();
        for piece in whitened
            .chunks(length)
            .filter(|piece| piece.len() >= PIECE_MIN)
        {
            squares.push(mean(piece.iter().map(|square| square.min(CLIP * CLIP))));
        }
    }
    squares.sort_by(f64::total_cmp);
    let at = (USUAL * squares.len().saturating_sub(1) as f64).round() as usize;
    squares
        .get(at)
        .map_or(SCATTER.least.0, |&found| SCATTER.hold(found))
}

fn at(channel: &Channel, basis: [f64; 3]) -> f64 {
    channel
        .variance
        .iter()
        .zip(basis)
        .map(|(part, basis)| part * basis)
        .sum()
}

/// The parts of the variance, by maximum likelihood: multiplicative steps keep them positive.
fn variance(squares: &[(f64, [f64; 3], bool)]) -> [f64; 3] {
    let size = |i: usize| mean(squares.iter().map(|square| square.1[i]));
    let all = mean(squares.iter().map(|square| square.0 * square.0)).max(1e-12);
    let mut parts: [f64; 3] = std::array::from_fn(|i| match size(i) > 1e-12 {
        true => all / (3.0 * size(i)),
        false => 0.0,
    });
    for _ in 0..STEPS {
        let (mut up, mut down) = ([0.0; 3], [1e-300; 3]);
        for &(apart, basis, _) in squares {
            let total: f64 = parts
                .iter()
                .zip(basis)
                .map(|(part, basis)| part * basis)
                .sum();
            let total = total.max(1e-12);
            let ratio = (apart * apart / total).min(CLIP * CLIP);
            for i in 0..3 {
                up[i] += basis[i] * ratio / total;
                down[i] += basis[i] / total;
            }
        }
        for i in 0..3 {
            parts[i] *= up[i] / down[i];
        }
    }
    parts
}

/// Correlation of successive normalised residuals.
fn correlation(channel: &Channel, squares: &[(f64, [f64; 3], bool)]) -> f64 {
    let (mut along, mut all, mut before) = (0.0, 1e-300, 0.0);
    for &(apart, basis, follows) in squares {
        let normal = (apart / at(channel, basis).sqrt()).clamp(-CLIP, CLIP);
        all += normal * normal;
        along += if follows { normal * before } else { 0.0 };
        before = normal;
    }
    CORRELATION.hold(along / all)
}

/// The drift of the offset under which all residuals are most likely.
fn drift(channel: &Channel, records: &[Vec<(Residual, bool)>]) -> f64 {
    let usual = records.iter().flatten();
    let usual_sd = mean(usual.map(|(residual, _)| at(channel, residual.basis))).sqrt();
    let mut tried = channel.clone();
    let mut best = (f64::NEG_INFINITY, 0.0);
    for part in DRIFTS {
        tried.drift_sd = part * usual_sd;
        let mut likelihood = 0.0;
        for record in records {
            let mut track = ResidualWhitener::new(&tried);
            for (apart, spread) in innovations(&tried, &mut track, record) {
                let most = CLIP * spread.sqrt();
                likelihood += log_normal(apart.clamp(-most, most), spread);
            }
        }
        if likelihood > best.0 {
            best = (likelihood, tried.drift_sd);
        }
    }
    best.1
}

fn innovations<'a>(
    channel: &'a Channel,
    track: &'a mut ResidualWhitener,
    record: &'a [(Residual, bool)],
) -> impl Iterator<Item = (f64, f64)> + 'a {
    record.iter().map(move |(residual, follows)| {
        if !follows {
            track.interrupt();
        }
        track.step(channel, residual.apart, at(channel, residual.basis), false)
    })
}

fn usual_size(channel: &Channel, records: &[Part<'_>]) -> f64 {
    let newest = records
        .iter()
        .flat_map(|part| &part.histories)
        .filter_map(|h| h.ago(0));
    let values = newest.filter_map(|now| channel.target.value(now));
    mean(values.map(|value| value * value)).sqrt()
}

/// Root mean square of the whitened residuals of other records: 1 if the model holds there, or if
/// there is nothing to tell.
pub(super) fn whitened_rms(channel: &Channel, records: &[Part<'_>], model: &Model) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for record in records {
        let mut track = ResidualWhitener::new(channel);
        let record = residuals(channel, &record.histories, model);
        for (apart, spread) in innovations(channel, &mut track, &record) {
            sum += (apart * apart / spread).min(CLIP * CLIP);
            count += 1.0;
        }
    }
    if count < 10.0 {
        1.0
    } else {
        f64::sqrt(sum / count)
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}
