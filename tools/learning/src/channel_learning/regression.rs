//! Ridge regression with Huber weights.

use nalgebra::{DMatrix, DVector};
use vigil_robot::channel_model::channel::commands;
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
        for (history, fold) in record.histories.iter().zip(&record.folds) {
            let value = history.ago(0).and_then(|now| now.values[place]);
            let Some(value) =
                value.filter(|_| Some(*fold) != left_out && counts(history, scales.lags))
            else {
                continue;
            };
            let commands = commands(history);
            rows.extend(
                channel
                    .terms
                    .iter()
                    .map(|term| term.value(&commands, scales)),
            );
            values.push(value);
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
    let matrix = DMatrix::from_row_slice(values.len(), terms, &rows);
    let values = DVector::from_vec(values);
    let penalised: Vec<bool> = channel.terms.iter().map(is_penalised).collect();
    if let Some(weights) = solve(&matrix, &values, &penalised) {
        channel.weights = weights.iter().copied().collect();
    }
    Ok(())
}

/// A channel's constant may be of any size.
fn is_penalised(term: &Term) -> bool {
    term.of != Regressor::Constant
}

fn solve(matrix: &DMatrix<f64>, values: &DVector<f64>, penalised: &[bool]) -> Option<DVector<f64>> {
    let count = values.len() as f64;
    let scale: Vec<f64> = matrix
        .column_iter()
        .map(|column| (column.norm_squared() / count).sqrt().max(SIZE_MIN))
        .collect();
    let mut scaled = matrix.clone();
    for (mut column, scale) in scaled.column_iter_mut().zip(&scale) {
        column /= *scale;
    }
    let mut trust = DVector::from_element(values.len(), 1.0);
    let mut solution = DVector::zeros(scale.len());
    for _ in 0..ROUNDS {
        let mut weighted = scaled.clone();
        for (mut row, trust) in weighted.row_iter_mut().zip(trust.iter()) {
            row *= *trust;
        }
        let mut normal = scaled.tr_mul(&weighted);
        for (i, _) in penalised.iter().enumerate().filter(|(_, is)| **is) {
            normal[(i, i)] += RIDGE * count;
        }
        solution = normal.cholesky()?.solve(&weighted.tr_mul(values));
        let residual = values - &scaled * &solution;
        let mut sizes: Vec<f64> = residual.iter().map(|value| value.abs()).collect();
        let middle = sizes.len() / 2;
        let deviation = 1.4826 * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 + 1e-12;
        trust = residual.map(|value| 1.0 / (value.abs() / deviation / HUBER).max(1.0));
    }
    for (value, scale) in solution.iter_mut().zip(&scale) {
        *value /= scale;
    }
    solution
        .iter()
        .all(|value| value.is_finite())
        .then_some(solution)
}
