//! Which combinations of the command's axes a log covers.

use nalgebra::DMatrix;
use vigil_robot::channel_model::coverage::{product, scaled};
use vigil_robot::channel_model::{AXES, Combinations, Range, Term};

use super::record::Record;
use super::told::is_settled;

/// Highest order of a product.
const ORDER_MAX: u8 = 2;
/// Added to each product's mean square, of at most one: a direction in which nothing was driven.
const RIDGE: f64 = 1e-6;

/// The products of a command whose combinations are looked at: of one axis those that the log
/// tells, since between the values that were driven a [`vigil_robot::channel_model::Range`] has
/// gaps, of several axes all.
pub(super) fn products(terms: &[Term], untold: &[Term]) -> Vec<[u8; AXES]> {
    let looked_at = |term: &&Term| {
        let axes = term.powers.iter().filter(|&&power| power > 0).count();
        let order: u8 = term.powers.iter().sum();
        order <= ORDER_MAX && (axes > 1 || !untold.contains(term))
    };
    terms
        .iter()
        .filter(looked_at)
        .map(|term| term.powers)
        .collect()
}

/// The combinations of all parts of the log but `left_out`, of what was kept up: a mean over a step
/// of the command tells of no combination.
pub(super) fn combinations(
    records: &[Record],
    left_out: Option<usize>,
    powers: &[[u8; AXES]],
    ranges: &[Range],
) -> Combinations {
    let n = powers.len();
    let (mut sums, mut count) = (DMatrix::zeros(n, n), 0.0);
    for record in records {
        for (history, fold) in record.histories.iter().zip(&record.folds) {
            let Some(now) = history.ago(0).filter(|now| now.moving) else {
                continue;
            };
            if Some(*fold) == left_out || !is_settled(history, ranges) {
                continue;
            }
            let command = scaled(&now.command, ranges);
            let values: Vec<f64> = powers.iter().map(|of| product(of, &command)).collect();
            sums += DMatrix::from_fn(n, n, |i, j| values[i] * values[j]);
            count += 1.0;
        }
    }
    let mean = sums / f64::max(count, 1.0) + DMatrix::identity(n, n) * RIDGE;
    let Some(precision) = mean.cholesky().map(|of| of.inverse()) else {
        return Combinations::default();
    };
    let rows = (0..n).map(|i| precision.row(i).iter().copied().collect());
    Combinations {
        precision: rows.collect(),
        powers: powers.to_vec(),
    }
}
