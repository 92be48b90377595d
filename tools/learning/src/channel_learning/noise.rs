//! What is left of a channel: its variance by speed and by change.

use std::iter::once;

use vigil_robot::channel_model::channel::{VarianceBasis, commands};
use vigil_robot::channel_model::level::Level;
use vigil_robot::channel_model::prediction::Predictor;
use vigil_robot::channel_model::{Channel, History, Range, Scales};

use super::record::{FOLDS, Record};

/// Motion before an observation counts as driven, s.
pub(super) const MOVING_S: f64 = 0.5;
/// Parts of a variance.
const PARTS: usize = 3;
/// Rounds of the fit of the variance.
const STEPS: usize = 60;
/// Residuals beyond so many deviations say nothing more on the noise.
const CLIP: f64 = 4.0;
/// Largest deviation of a run's own gain.
const GAIN_SD_MAX: f64 = 0.3;
/// Smallest deviation, relative to the channel's usual size: a channel that follows its prediction
/// exactly would else see a fault in every rounding.
const FLOOR: f64 = 1e-3;

/// A command this far outside what was driven, relative to the width of that, is still known: the
/// same command is never twice the same to the last digit.
const BEYOND_MAX: f64 = 0.02;

/// True if an observation takes part in learning a channel: all that it is predicted from is known,
/// and the robot moves, or has just stopped. Of a longer rest one observation a second does, so
/// that it does not outweigh the motion.
pub(super) fn counts(history: &History, lags: usize) -> bool {
    let Some((now, _)) = history.ago(0).zip(history.ago(lags)) else {
        return false;
    };
    let second = |t_ns: u64| t_ns / 1_000_000_000;
    let moved = (0..=lags).any(|lag| history.ago(lag).is_some_and(|then| then.moving));
    let before = history.ago(1).map_or(0, |last| second(last.t_ns));
    moved || second(now.t_ns) != before
}

/// A residual of a model that has not seen it.
#[derive(Debug, Clone, Copy)]
struct Residual {
    /// Number of its run, or of the piece of one.
    run: usize,
    apart: f64,
    predicted: f64,
    basis: VarianceBasis,
}

/// Residuals of a channel, each by the model of its part, where that knows the command.
fn residuals(
    (models, ranges): (&[Channel], &[&[Range]]),
    place: usize,
    records: &[Record],
    scales: &Scales,
) -> Vec<Residual> {
    let predictors = models.iter().map(|model| Predictor::new(once(model)));
    let predictors: Vec<Predictor> = predictors.collect();
    let mut out = Vec::new();
    for (run, record) in records.iter().enumerate() {
        let mut before = None;
        let (mut level, mut level_of) = (Level::default(), 0);
        for (history, fold) in record.histories.iter().zip(&record.folds) {
            let (Some(model), Some(now)) = (models.get(*fold), history.ago(0)) else {
                continue;
            };
            if *fold != level_of {
                (level, level_of) = (Level::default(), *fold);
            }
            let [mut predicted, ..] = predictors[*fold].predict(&commands(history), scales);
            let mut variance = 1.0;
            if model.drifts {
                variance = level.variance();
                let apart = now.values[place].map(|value| value - predicted);
                predicted += level.advance(apart, now.dt_s);
                if let Some(apart) = apart {
                    level.take(apart, f64::INFINITY, now.dt_s);
                }
            }
            let last = before
                .filter(|_| history.ago(1).is_some())
                .unwrap_or(predicted);
            before = Some(predicted);
            let mut axes = ranges[*fold].iter().zip(&now.command);
            let known = axes.all(|(range, value)| range.beyond(*value) <= BEYOND_MAX);
            if let Some(value) = now.values[place].filter(|_| known && counts(history, scales.lags))
            {
                out.push(Residual {
                    run: if records.len() < FOLDS {
                        run * FOLDS + *fold
                    } else {
                        run
                    },
                    apart: (value - predicted) / f64::sqrt(variance),
                    predicted,
                    basis: Channel::basis(&now.command, scales, predicted, last),
                });
            }
        }
    }
    out
}

/// Root mean square of the residuals that models of parts have on parts that they have not seen.
pub(super) fn unseen_error(
    (models, ranges): (&[Channel], &[&[Range]]),
    place: usize,
    records: &[Record],
    scales: &Scales,
) -> f64 {
    let unseen = residuals((models, ranges), place, records, scales);
    mean(
        unseen
            .iter()
            .map(|residual| residual.apart * residual.apart),
    )
    .sqrt()
}

/// Fits the variance of `channel` to the residuals that models of parts have on the parts that they
/// have not seen. Its `held_out_ratio` becomes their size over that on what was seen.
pub(super) fn fit(
    channel: &mut Channel,
    (models, ranges): (&[Channel], &[&[Range]]),
    place: usize,
    records: &[Record],
    scales: &Scales,
) {
    let unseen = residuals((models, ranges), place, records, scales);
    let same = vec![channel.clone(); models.len()];
    let seen = residuals((&same, ranges), place, records, scales);
    let values = records.iter().flat_map(|record| &record.histories);
    let values = values.filter(|history| counts(history, scales.lags));
    let values = values.filter_map(|history| history.ago(0)?.values[place]);
    channel.usual = mean(values.map(|value| value * value)).sqrt();
    channel.variance = variance(&unseen);
    let floor = (FLOOR * channel.usual).powi(2).max(1e-12);
    channel.variance[0] = channel.variance[0].max(floor);
    channel.context_sd = context_sd(&unseen, channel);
    let square = |residuals: &[Residual]| {
        let squares = residuals.iter().map(|residual| {
            let square = residual.apart * residual.apart / channel.variance_at(residual.basis);
            square.min(CLIP * CLIP)
        });
        mean(squares)
    };
    let (unseen, seen) = (square(&unseen), square(&seen));
    channel.held_out_ratio = if seen > 0.0 {
        (unseen / seen).sqrt()
    } else {
        1.0
    };
}

/// Deviations of the runs' own offsets and gains: those of the least-squares estimates, each held
/// back by a prior of the residuals' size.
fn context_sd(residuals: &[Residual], channel: &Channel) -> [f64; 2] {
    let variance = mean(residuals.iter().map(|r| r.apart * r.apart)).max(1e-12);
    let usual = channel.usual * channel.usual;
    let (mut sums, mut runs, mut at) = ([0.0; 2], 0.0, 0);
    while let Some(first) = residuals.get(at) {
        let run = residuals[at..].iter().take_while(|r| r.run == first.run);
        let (mut a, mut b, mut c, mut x, mut y, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0, 0);
        for &Residual {
            apart, predicted, ..
        } in run
        {
            a += 1.0;
            b += predicted;
            c += predicted * predicted;
            x += apart;
            y += apart * predicted;
            count += 1;
        }
        at += count;
        // As if a tenth of the observations more had shown none.
        let (a, c) = (1.1 * a, 1.1 * c + 0.1 * a * usual);
        let determinant = (a * c - b * b).max(1e-12);
        let estimates = [(c * x - b * y) / determinant, (a * y - b * x) / determinant];
        let squares = sums.iter_mut().zip(estimates);
        squares.for_each(|(sum, value)| *sum += value * value);
        runs += 1.0;
    }
    let most = [variance.sqrt(), GAIN_SD_MAX];
    std::array::from_fn(|i| f64::sqrt(sums[i] / f64::max(runs, 1.0)).min(most[i]))
}

/// The parts of the variance, by maximum likelihood: multiplicative steps keep them positive.
fn variance(residuals: &[Residual]) -> VarianceBasis {
    let size = |i: usize| mean(residuals.iter().map(|residual| residual.basis[i]));
    let all = mean(residuals.iter().map(|r| r.apart * r.apart)).max(1e-12);
    let mut parts: VarianceBasis = std::array::from_fn(|i| match size(i) > 1e-12 {
        true => all / (PARTS as f64 * size(i)),
        false => 0.0,
    });
    for _ in 0..STEPS {
        let (mut up, mut down) = ([0.0; PARTS], [1e-300; PARTS]);
        for &Residual { apart, basis, .. } in residuals {
            let products = parts.iter().zip(basis).map(|(part, basis)| part * basis);
            let total = products.sum::<f64>().max(1e-12);
            let ratio = (apart * apart / total).min(CLIP * CLIP);
            for i in 0..PARTS {
                up[i] += basis[i] * ratio / total;
                down[i] += basis[i] / total;
            }
        }
        for i in 0..PARTS {
            parts[i] *= up[i] / down[i];
        }
    }
    parts
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}
