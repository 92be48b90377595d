//! The joint law of the residuals, and that of their roughness.

use nalgebra::{DMatrix, DVector};
use vigil_robot::channel_model::channel::commands;
use vigil_robot::channel_model::directions::directions;
use vigil_robot::channel_model::law::BLOCKS;
use vigil_robot::channel_model::scatter::{Scatter, log_roughness};
use vigil_robot::channel_model::window::Window;
use vigil_robot::channel_model::{Model, Scales};

use super::noise::counts;
use super::record::Record;

/// Observations of a block that are not independent of the others are worth so much less.
const CORRELATED: f64 = 4.0;
/// Most of a channel's variance that the others may explain.
const SHARED_MAX: f64 = 0.9;
/// Blocks before a part in which a run's context is learned.
pub(super) const CONTEXT_BLOCKS: usize = 60;
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

/// Fits both laws to the residuals that `models` of the parts have on what they have not seen.
pub(super) fn fit(model: &mut Model, models: &[Model], records: &[Record], scales: &Scales) {
    let n = model.channel.len();
    let mut moments = Moments {
        n,
        products: vec![DMatrix::zeros(n, n); BLOCKS],
        counts: vec![DMatrix::zeros(n, n); BLOCKS],
        rough: Vec::new(),
        windows: 0.0,
    };
    for (fold, seen) in models.iter().enumerate() {
        let used = seen.channel.iter().cloned().enumerate().collect();
        let mut window = Window::new(used, scales.clone(), model.interval_s);
        moments.take_fold((&mut window, scales.lags), (seen, fold), records);
    }
    let independent = moments.windows / CORRELATED;
    let shrink = independent / (n as f64 + 1.0 + independent);
    let shrink = shrink.min(SHARED_MAX);
    let covariances: Vec<DMatrix<f64>> = (0..BLOCKS)
        .map(|lag| moments.covariance(lag, shrink, model.widened))
        .collect();
    model.direction = directions(&covariances);
    model.scatter = moments.scatter(shrink);
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
    fn take_fold(
        &mut self,
        (window, lags): (&mut Window, usize),
        (model, fold): (&Model, usize),
        records: &[Record],
    ) {
        let per_block = window.per_block();
        for record in records {
            let is_near = |k: usize| {
                let last = (k + CONTEXT_BLOCKS * per_block).min(record.folds.len() - 1);
                record.folds[k..=last].contains(&fold)
            };
            window.reset();
            let mut rough_in = 0;
            for (k, history) in record.histories.iter().enumerate() {
                if history.ago(lags).is_none() {
                    window.clear();
                    continue;
                }
                if !is_near(k) {
                    window.reset();
                    continue;
                }
                window.push(history, &commands(history), (model.widening(history), 0));
                if record.folds[k] != fold || !counts(history, lags) {
                    continue;
                }
                self.windows += 1.0 / per_block as f64;
                self.take_products(window);
                // Windows that hardly overlap.
                if rough_in == 0 {
                    rough_in = per_block * BLOCKS / 4;
                    let rough = window.roughness[..self.n].iter();
                    self.rough
                        .push(rough.map(|&found| log_roughness(found)).collect());
                }
                rough_in -= 1;
            }
        }
    }

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
