//! The joint law of the residuals, and that of their roughness.

use nalgebra::{DMatrix, DVector};
use vigil_robot::channel_model::directions::directions;
use vigil_robot::channel_model::law::BLOCKS;
use vigil_robot::channel_model::scatter::{Scatter, log_roughness};
use vigil_robot::channel_model::window::Window;
use vigil_robot::channel_model::{Model, Scales};

use super::noise::counts;
use super::record::Record;
use super::unseen;

/// Observations of a block that are not independent of the others are worth so much less.
const CORRELATED: f64 = 4.0;
/// Most of a channel's variance that the others may explain.
const SHARED_MAX: f64 = 0.9;
/// Least variance of a block's whitened mean.
const VARIANCE_MIN: f64 = 1e-6;
/// Least deviation of a logarithm of the roughness: no two grounds are equally rough.
const ROUGHNESS_SD_MIN: f64 = 0.25;

/// Sums of products.
struct Moments {
    n: usize,
    /// Of residuals, by lag in blocks, and how many.
    products: Vec<DMatrix<f64>>,
    counts: Vec<DMatrix<f64>>,
    /// Logarithms of the roughness, by channel.
    rough: Vec<Vec<Option<f64>>>,
    windows: f64,
}

/// Fits both laws to the residuals that `models` of the parts have on what they have not seen. All
/// take them.
pub(super) fn fit(model: &mut Model, models: &mut [Model], records: &[Record], scales: &Scales) {
    let n = model.channel.len();
    let mut moments = Moments {
        n,
        products: vec![DMatrix::zeros(n, n); BLOCKS],
        counts: vec![DMatrix::zeros(n, n); BLOCKS],
        rough: Vec::new(),
        windows: 0.0,
    };
    // Windows of the roughness hardly overlap, of one part of one record.
    let (mut rough_in, mut part) = (0, None);
    unseen::windows(models, records, scales, |sight| {
        let record = &records[sight.record];
        if !counts(&record.histories[sight.newest], scales.lags) {
            return;
        }
        let here = Some((record.folds[sight.newest], sight.record));
        let is_new = std::mem::replace(&mut part, here) != here;
        let per_block = sight.window.per_block();
        moments.windows += 1.0 / per_block as f64;
        moments.take_products(sight.window);
        if is_new || rough_in == 0 {
            rough_in = per_block * BLOCKS / 4;
            let rough = sight.window.roughness[..n].iter();
            let rough = rough.map(|&found| log_roughness(found)).collect();
            moments.rough.push(rough);
        }
        rough_in -= 1;
    });
    let independent = moments.windows / CORRELATED;
    let shrink = independent / (n as f64 + 1.0 + independent);
    let shrink = shrink.min(SHARED_MAX);
    let covariances: Vec<DMatrix<f64>> = (0..BLOCKS)
        .map(|lag| moments.covariance(lag, shrink, model.widened))
        .collect();
    model.direction = directions(&covariances);
    model.scatter = moments.scatter(shrink);
    for part in models {
        part.direction.clone_from(&model.direction);
        part.scatter.clone_from(&model.scatter);
    }
}

/// The covariance itself, or nearest to it one without a negative variance in any direction: sums
/// over pairs of channels may have one.
fn whole(covariance: DMatrix<f64>) -> DMatrix<f64> {
    let mut shrunk = covariance;
    while shrunk.clone().cholesky().is_none() {
        let diagonal = DMatrix::from_diagonal(&shrunk.diagonal());
        shrunk = 0.9 * &shrunk + 0.1 * diagonal;
    }
    shrunk
}

impl Moments {
    fn take_products(&mut self, window: &Window) {
        let n = self.n;
        for (lag, (products, counts)) in self.products.iter_mut().zip(&mut self.counts).enumerate()
        {
            for i in 0..n {
                let Some(now) = window.z[i][BLOCKS - 1] else {
                    continue;
                };
                for j in 0..n {
                    if let Some(then) = window.z[j][BLOCKS - 1 - lag] {
                        products[(i, j)] += now * then;
                        counts[(i, j)] += 1.0;
                    }
                }
            }
        }
    }

    fn covariance(&self, lag: usize, shrink: f64, widened: f64) -> DMatrix<f64> {
        let raw = self.products[lag].zip_map(&self.counts[lag], |sum, count| sum / count.max(1.0));
        let symmetric = (&raw + raw.transpose()) * 0.5;
        DMatrix::from_fn(self.n, self.n, |i, j| {
            let share = if i == j { 1.0 } else { shrink };
            let least = if i == j && lag == 0 {
                VARIANCE_MIN
            } else {
                0.0
            };
            widened * widened * share * symmetric[(i, j)] + least
        })
    }

    fn scatter(&self, shrink: f64) -> Scatter {
        let n = self.n;
        let found = |i: usize| self.rough.iter().filter_map(move |row| row[i]);
        let mean = DVector::from_fn(n, |i, _| {
            let (sum, count) = found(i).fold((0.0, 0.0), |(s, c), value| (s + value, c + 1.0));
            if count > 0.0 { sum / count } else { 0.0 }
        });
        let covariance = DMatrix::from_fn(n, n, |i, j| {
            let pairs = self.rough.iter().filter_map(|row| Some((row[i]?, row[j]?)));
            let (sum, count) = pairs.fold((0.0, 0.0), |(sum, count), (a, b)| {
                (sum + (a - mean[i]) * (b - mean[j]), count + 1.0)
            });
            let found = sum / f64::max(count, 1.0);
            match i == j {
                true => found + ROUGHNESS_SD_MIN * ROUGHNESS_SD_MIN,
                false => shrink * found,
            }
        });
        let covariance = whole(covariance);
        let rows = (0..n).map(|i| covariance.row(i).iter().copied().collect());
        Scatter {
            mean: mean.iter().copied().collect(),
            covariance: rows.collect(),
        }
    }
}
