//! Ridge regression with Huber weights.

use nalgebra::{DMatrix, DVector};
use vigil_robot::nominal::AXES;
use vigil_robot::nominal::Channel;

use super::NominalError;
use super::noise::counts;
use super::record::Part;

/// Ridge, per observation, on standardised terms: keeps terms that move together from growing
/// against each other.
const RIDGE: f64 = 1e-4;
/// Residuals beyond so many robust deviations get less weight.
const HUBER: f64 = 3.0;
/// Rounds of reweighting.
const ROUNDS: usize = 6;
/// Observations per weight.
const PER_WEIGHT: usize = 3;

/// Fits the channel's weights.
pub(super) fn fit(
    channel: &mut Channel,
    records: &[Part<'_>],
    sizes: &[f64; AXES],
    name: &str,
) -> Result<(), NominalError> {
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for history in records
        .iter()
        .flat_map(|part| part.histories.iter().copied())
    {
        if !counts(history, channel) {
            continue;
        }
        let value = history.ago(0).and_then(|now| channel.target.value(now));
        let row: Option<Vec<f64>> = channel
            .terms
            .iter()
            .map(|t| t.value(history, 0, sizes))
            .collect();
        if let (Some(value), Some(row)) = (value, row) {
            rows.extend(row);
            values.push(value);
        }
    }
    let terms = channel.terms.len();
    if values.len() < PER_WEIGHT * terms {
        return Err(NominalError::Few {
            channel: name.to_owned(),
            found: values.len(),
            needed: PER_WEIGHT * terms,
        });
    }
    let matrix = DMatrix::from_row_slice(values.len(), terms, &rows);
    let values = DVector::from_vec(values);
    if let Some(weights) = solve(&matrix, &values) {
        channel.weights = weights.iter().copied().collect();
    }
    Ok(())
}

fn solve(matrix: &DMatrix<f64>, values: &DVector<f64>) -> Option<DVector<f64>> {
    let count = values.len() as f64;
    let scale: Vec<f64> = matrix
        .column_iter()
        .map(|column| (column.norm_squared() / count).sqrt().max(1e-9))
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
        let mut normal = scaled.transpose() * &weighted;
        for i in 0..scale.len() {
            normal[(i, i)] += RIDGE * count;
        }
        solution = normal.cholesky()?.solve(&(weighted.transpose() * values));
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
