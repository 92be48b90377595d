//! Ridge regression with Huber weights.

use nalgebra::{DMatrix, DVector};
use vigil_robot::channel_model::channel::commands;
use vigil_robot::channel_model::level::{Followed, Trend};
use vigil_robot::channel_model::observation::History;
use vigil_robot::channel_model::{Channel, Regressor, Scales, Term};

use super::LogError;
use super::noise::counts;
use super::record::Record;

/// Ridge, per observation, on standardised terms: keeps terms that move together from growing
/// against each other.
const RIDGE: f64 = 1e-4;
/// Least root mean square by which a term is standardised; all terms are within -1 and 1. A product
/// that a part of the log does not excite, but for rounding, keeps a weight of about zero.
const SIZE_MIN: f64 = 0.01;
/// Residuals beyond so many robust deviations get less weight.
const HUBER: f64 = 3.0;
/// Rounds of reweighting.
const ROUNDS: usize = 4;
/// Observations per weight.
const PER_WEIGHT: usize = 3;

/// Fits the channel's weights to all parts of the log but `left_out`.
pub(super) fn fit(
    channel: &mut Channel,
    place: usize,
    records: &[Record],
    left_out: Option<usize>,
    scales: &Scales,
) -> Result<(), LogError> {
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for record in records {
        let mut trends = Trends::default();
        for (history, fold) in record.histories.iter().zip(&record.folds) {
            if Some(*fold) == left_out {
                trends = Trends::default();
                continue;
            }
            let is_counted = counts(history, scales.lags);
            // What counts for little is followed nevertheless.
            let is_used = is_counted || channel.drifts && history.ago(scales.lags).is_some();
            let value = history.ago(0).and_then(|now| now.values[place]);
            let Some(value) = value.filter(|_| is_used) else {
                continue;
            };
            let commands = scales.scaled(&commands(history));
            let terms = channel.terms.iter();
            let row: Vec<f64> = terms.map(|term| term.value(&commands, scales)).collect();
            let found = match channel.drifts {
                true => trends.apart(channel, row, value, history),
                false => Some((row, value)),
            };
            if let Some((row, value)) = found.filter(|_| is_counted) {
                rows.extend(row);
                values.push(value);
            }
        }
    }
    let terms = channel.terms.len();
    if values.len() < PER_WEIGHT * terms {
        return Err(LogError::Few {
            channel: channel.name.clone(),
            found: values.len(),
            needed: PER_WEIGHT * terms,
        });
    }
    let penalised: Vec<bool> = channel.terms.iter().map(is_penalised).collect();
    if let Some(weights) = solve(&mut rows, &values, &penalised) {
        channel.weights = weights;
    }
    Ok(())
}

/// What the level of a drifting channel follows: it is linear in the channel's value and in what
/// predicts it, so that the trend of each is left out of it.
#[derive(Debug, Default)]
struct Trends {
    followed: Followed,
    of_row: Vec<Trend>,
    of_value: Trend,
}

impl Trends {
    /// How far a row and its value lie from the trends before them; none of the first.
    fn apart(
        &mut self,
        channel: &Channel,
        mut row: Vec<f64>,
        value: f64,
        history: &History,
    ) -> Option<(Vec<f64>, f64)> {
        let dt_s = history.ago(0)?.dt_s;
        let gains = self.followed.gains(dt_s);
        let is_first = self.of_row.is_empty();
        let follow = |trend: &mut Trend, value: f64| {
            if is_first {
                trend.value = value;
            }
            trend.advance(dt_s);
            let apart = value - trend.value;
            trend.correct(apart, gains);
            apart
        };
        self.of_row.resize(row.len(), Trend::default());
        let apart = follow(&mut self.of_value, value);
        let all = row.iter_mut().zip(&mut self.of_row).zip(&channel.terms);
        for ((x, trend), term) in all {
            let apart = follow(trend, *x);
            // The level takes any constant; one of zero is as good as another.
            if is_penalised(term) {
                *x = apart;
            }
        }
        (!is_first).then_some((row, apart))
    }
}

/// A channel's constant may be of any size.
fn is_penalised(term: &Term) -> bool {
    term.of != Regressor::Constant
}

/// The weights of `values` on `rows`, one after the other, each with a value per term. The rows are
/// standardised in place. None if the terms do not determine their weights.
fn solve(rows: &mut [f64], values: &[f64], penalised: &[bool]) -> Option<Vec<f64>> {
    let count = values.len() as f64;
    let scale = standardise(rows, penalised.len(), count);
    let mut trust = vec![1.0; values.len()];
    let mut solution = DVector::zeros(scale.len());
    for _ in 0..ROUNDS {
        let (mut normal, vector) = normal_equations(rows, values, &trust, scale.len());
        for (i, _) in penalised.iter().enumerate().filter(|(_, is)| **is) {
            normal[(i, i)] += RIDGE * count;
        }
        solution = normal.cholesky()?.solve(&vector);
        let residuals = rows.chunks_exact(scale.len()).zip(values);
        let residuals = residuals.map(|(row, value)| {
            let predicted: f64 = row
                .iter()
                .zip(&solution)
                .map(|(x, weight)| x * weight)
                .sum();
            (value - predicted).abs()
        });
        let residuals: Vec<f64> = residuals.collect();
        let mut sizes = residuals.clone();
        let middle = sizes.len() / 2;
        let deviation = 1.4826 * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 + 1e-12;
        for (trust, residual) in trust.iter_mut().zip(residuals) {
            *trust = 1.0 / (residual / deviation / HUBER).max(1.0);
        }
    }
    let weights = solution.iter().zip(&scale);
    let weights: Vec<f64> = weights.map(|(weight, scale)| weight / scale).collect();
    let are_finite = weights.iter().all(|weight| weight.is_finite());
    are_finite.then_some(weights)
}

/// Divides each term by its root mean square, which is returned.
fn standardise(rows: &mut [f64], terms: usize, count: f64) -> Vec<f64> {
    let mut scale = vec![0.0; terms];
    for row in rows.chunks_exact(terms) {
        for (sum, x) in scale.iter_mut().zip(row) {
            *sum += x * x;
        }
    }
    for sum in &mut scale {
        *sum = (*sum / count).sqrt().max(SIZE_MIN);
    }
    for row in rows.chunks_exact_mut(terms) {
        for (x, scale) in row.iter_mut().zip(&scale) {
            *x /= scale;
        }
    }
    scale
}

/// Weighted sums of products of the terms, of which the lower triangle is filled, and of the terms
/// and the values. All pairs are taken from a row while it is at hand: a long log is read once.
fn normal_equations(
    rows: &[f64],
    values: &[f64],
    trust: &[f64],
    terms: usize,
) -> (DMatrix<f64>, DVector<f64>) {
    let mut normal = DMatrix::zeros(terms, terms);
    let mut vector = DVector::zeros(terms);
    for ((row, value), trust) in rows.chunks_exact(terms).zip(values).zip(trust) {
        for (i, x) in row.iter().enumerate() {
            let weighted = trust * x;
            vector[i] += weighted * value;
            let sums = &mut normal.as_mut_slice()[i * terms + i..(i + 1) * terms];
            for (sum, other) in sums.iter_mut().zip(&row[i..]) {
                *sum += weighted * other;
            }
        }
    }
    (normal, vector)
}
