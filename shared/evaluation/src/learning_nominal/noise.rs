//! What is left of a channel: its variance by speed, its colour, its scatter from run to run.

use vigil_robot::nominal::{Channel, History, Model, Track};

use super::record::Record;

/// Motion before an observation counts, s; a pose needs a steady command too.
const SETTLED_S: f64 = 0.5;
/// Part of the largest squares that is cut off: they are not noise.
const CUT: f64 = 0.01;
/// Bounds of the correlation.
const CORRELATION: (f64, f64) = (-0.45, 0.97);
/// Length of the pieces whose means tell the scatter of an offset where there is one run,
/// observations.
const PIECE: usize = 100;
/// Smallest deviation, relative to the channel's usual size: a channel that follows its prediction
/// exactly would else see a fault in every rounding.
const FLOOR: f64 = 1e-3;

/// True if an observation takes part in learning a channel.
pub(super) fn counts(history: &History, channel: &Channel) -> bool {
    history.ago(0).is_some_and(|now| {
        let steady = now.steady_s >= SETTLED_S || !channel.target.quantity.is_pose();
        now.moving && now.moving_s >= SETTLED_S && steady
    })
}

/// Residuals with the commanded speed and whether each follows the one before.
fn residuals(channel: &Channel, record: &[History], model: &Model) -> Vec<(f64, f64, bool)> {
    let (mut out, mut follows) = (Vec::new(), false);
    for history in record {
        let residual = channel.residual(history, &model.sizes());
        let now = history.ago(0).filter(|_| counts(history, channel));
        let (Some(residual), Some(now)) = (residual, now) else {
            follows = false;
            continue;
        };
        out.push((residual, now.path_speed_m_s, follows));
        follows = true;
    }
    out
}

/// Fits variance, correlation and offset.
pub(super) fn fit(channel: &mut Channel, records: &[Record], model: &Model) {
    let pieces: Vec<Vec<(f64, f64, bool)>> = if records.len() > 1 {
        let of = |record: &Record| residuals(channel, &record.histories, model);
        records.iter().map(of).collect()
    } else {
        let all = records.iter().flat_map(|r| residuals(channel, &r.histories, model));
        all.collect::<Vec<_>>().chunks(PIECE).map(<[_]>::to_vec).collect()
    };
    let several = records.len() > 1;
    let pieces: Vec<_> = pieces.into_iter().filter(|piece| piece.len() >= 4).collect();
    let means: Vec<f64> = pieces.iter().map(|piece| mean(piece.iter().map(|r| r.0))).collect();
    let mut squares = Vec::new();
    let (mut along, mut all) = (0.0, 0.0);
    for (piece, &mean) in pieces.iter().zip(&means) {
        // Only where each run has its own offset is it taken out.
        let mean = if several { mean } else { 0.0 };
        let used = if several { (piece.len() as f64 / (piece.len() as f64 - 1.0)).sqrt() } else { 1.0 };
        let mut before = 0.0;
        for &(residual, speed, follows) in piece {
            let apart = (residual - mean) * used;
            squares.push((apart * apart, speed));
            all += apart * apart;
            along += if follows { apart * before } else { 0.0 };
            before = apart;
        }
    }
    channel.correlation = (along / all.max(1e-300)).clamp(CORRELATION.0, CORRELATION.1);
    channel.variance = by_speed(&mut squares);
    let floor = FLOOR * usual_size(channel, records);
    channel.variance[0] = channel.variance[0].max(floor * floor).max(1e-12);
    let longest = pieces.iter().map(Vec::len).sum::<usize>() as f64 / pieces.len().max(1) as f64;
    let within = all / squares.len().max(1) as f64;
    let rho = channel.correlation;
    let of_mean = within * ((1.0 + rho) / (1.0 - rho)).max(0.1) / longest.max(1.0);
    let between = mean(means.iter().map(|mean| mean * mean));
    let offset = (between - of_mean).max(0.0).sqrt();
    channel.offset_sd = if means.len() > 1 { offset } else { 0.0 };
}

/// Variance as a constant and a part that grows with the square of the speed.
fn by_speed(squares: &mut [(f64, f64)]) -> [f64; 2] {
    squares.sort_by(|a, b| a.0.total_cmp(&b.0));
    let highest = squares.len() - (squares.len() as f64 * CUT) as usize;
    let limit = squares.get(highest.saturating_sub(1)).map_or(0.0, |square| square.0);
    let points = || squares.iter().map(|&(square, speed)| (square.min(limit), speed * speed));
    let (my, mx) = (mean(points().map(|p| p.0)), mean(points().map(|p| p.1)));
    let xx = mean(points().map(|p| (p.1 - mx) * (p.1 - mx)));
    let xy = mean(points().map(|p| (p.1 - mx) * (p.0 - my)));
    let slope = if xx > 1e-12 { (xy / xx).max(0.0) } else { 0.0 };
    let base = my - slope * mx;
    if base > 0.1 * my {
        return [base, slope];
    }
    // At rest, too, something is left.
    [0.1 * my, 0.9 * my / mx.max(1e-12)]
}

fn usual_size(channel: &Channel, records: &[Record]) -> f64 {
    let newest = records.iter().flat_map(|r| &r.histories).filter_map(|h| h.ago(0));
    let values = newest.filter_map(|now| channel.target.value(now));
    mean(values.map(|value| value * value)).sqrt()
}

/// Root mean square of the whitened residuals of other records: 1 if the model holds there. 1 if
/// there is nothing to tell.
pub(super) fn whitened_rms(channel: &Channel, records: &[Record], model: &Model) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for record in records {
        let mut track = Track::new(channel);
        for (residual, speed, follows) in residuals(channel, &record.histories, model) {
            if !follows {
                track.interrupt();
            }
            let (apart, spread) = track.step(channel, residual, channel.variance_at(speed), false);
            sum += apart * apart / spread;
            count += 1.0;
        }
    }
    if count < 10.0 { 1.0 } else { f64::sqrt(sum / count) }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}
