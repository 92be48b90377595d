//! Principal directions of residuals from their covariances at each lag.

use nalgebra::{DMatrix, DVector};

use super::law::{BLOCKS, Direction};

/// Least variance of a direction over the largest: below, rounding decides.
const LEAST: f64 = 1e-4;
/// Factor on all correlations while they are none of a process.
const SHRINK: f64 = 0.97;
/// Most often that is done: then all are below a hundred thousandth.
const SHRINKS_MAX: usize = 400;
/// Share of a block's variance that no other block explains. Chosen: with less the law takes a
/// healthy robot's transients for faults.
const OWN: f64 = 0.3;
/// Largest correlation with the block before: a slower process is constant within a window.
const SLOWEST: f64 = 0.98;

/// The principal directions of covariances by lag, in blocks; the first is that of one block.
#[must_use]
pub fn directions(covariances: &[DMatrix<f64>]) -> Vec<Direction> {
    let Some(now) = covariances.first() else {
        return Vec::new();
    };
    if now.is_empty() {
        return Vec::new();
    }
    let symmetric = (now + now.transpose()) * 0.5;
    let eigen = symmetric.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let along = |(j, variance): (usize, &f64)| {
        let vector: DVector<f64> = eigen.eigenvectors.column(j).into_owned();
        let variance = variance.max(LEAST * largest).max(1e-12);
        let mut direction = Direction {
            vector: vector.iter().copied().collect(),
            variance,
            correlation: std::array::from_fn(|lag| {
                let covariance = covariances.get(lag + 1);
                let found = covariance.map_or(0.0, |c| vector.dot(&(c * &vector)) / variance);
                found.clamp(-SLOWEST, SLOWEST)
            }),
        };
        for _ in 0..SHRINKS_MAX {
            if is_process(&direction) {
                return direction;
            }
            direction.correlation = direction.correlation.map(|value| SHRINK * value);
        }
        direction.correlation = [0.0; BLOCKS - 1];
        direction
    };
    eigen.eigenvalues.iter().enumerate().map(along).collect()
}

/// True if every block keeps its own share of the variance.
fn is_process(direction: &Direction) -> bool {
    let mut floored = direction.covariance();
    for (i, row) in floored.iter_mut().enumerate() {
        row[i] -= OWN * direction.variance;
    }
    let matrix = DMatrix::from_fn(BLOCKS, BLOCKS, |i, j| floored[i][j]);
    matrix.cholesky().is_some()
}

/// Covariances by lag of channels of which some have nothing to do with the others: these then have
/// the covariances that they have alone.
#[must_use]
pub fn parted(covariances: &[DMatrix<f64>], is_apart: impl Fn(usize) -> bool) -> Vec<DMatrix<f64>> {
    let of_lag = |whole: &DMatrix<f64>| {
        DMatrix::from_fn(whole.nrows(), whole.ncols(), |i, j| {
            match is_apart(i) == is_apart(j) {
                true => whole[(i, j)],
                false => 0.0,
            }
        })
    };
    covariances.iter().map(of_lag).collect()
}

/// The covariances by lag of the channels at `places`, of which these are the directions.
#[must_use]
pub fn covariances(directions: &[Direction], places: &[usize]) -> Vec<DMatrix<f64>> {
    let n = places.len();
    let at = |lag: usize| {
        let mut sum = DMatrix::zeros(n, n);
        for direction in directions {
            let along = |i: usize| direction.vector.get(places[i]).copied().unwrap_or(0.0);
            let part = match lag {
                0 => direction.variance,
                lag => direction.variance * direction.correlation[lag - 1],
            };
            sum += DMatrix::from_fn(n, n, |i, j| part * along(i) * along(j));
        }
        sum
    };
    (0..BLOCKS).map(at).collect()
}
