//! How rough the residuals are: the logarithm of the mean square of their changes over a window.
//! Of a healthy robot it is jointly Gaussian over the channels, with a scale that is not known.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use vigil_checkpoint::Checkpoint;

use super::CHANNELS_MAX;

/// Degrees of freedom, as of the joint law.
const FREEDOM: f64 = 30.0;
/// Deviation of the logarithm by which a fault raises the roughness. Chosen: from a factor of 2 in
/// the deviation on, most faults show.
const RISE: f64 = 2.0;
/// Added to a mean square, so that its logarithm is bounded.
const LEAST: f64 = 1e-3;
/// Fewest changes in a window that say anything.
const CHANGES_MIN: usize = 12;

/// Fewest changes in the last second that say anything.
const STILL_CHANGES_MIN: usize = 4;
/// The most that they say, nats.
pub const STILL_MAX: f64 = 20.0;

/// Mean and covariance of the logarithms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct Scatter {
    /// Mean by channel.
    pub mean: Vec<f64>,
    /// Covariance, by rows.
    pub covariance: Vec<Vec<f64>>,
}

/// The logarithm of a mean square; none of too few changes.
#[must_use]
pub fn log_roughness((mean_square, count): (f64, usize)) -> Option<f64> {
    (count >= CHANGES_MIN).then(|| (mean_square + LEAST).ln())
}

/// The law at work.
#[derive(Debug, Clone, Checkpoint)]
pub struct ScatterLaw {
    #[checkpoint(fixed)]
    channels: usize,
    #[checkpoint(fixed)]
    mean: [f64; CHANNELS_MAX],
    #[checkpoint(fixed)]
    variance: [f64; CHANNELS_MAX],
    #[checkpoint(fixed)]
    precision: Vec<f64>,
    apart: [f64; CHANNELS_MAX],
    gradient: [f64; CHANNELS_MAX],
    square: f64,
    found: usize,
}

impl ScatterLaw {
    /// Of the channels at these places of `scatter`; none if it has no covariance.
    #[must_use]
    pub fn new(scatter: &Scatter, places: &[usize]) -> Option<Self> {
        let n = places.len();
        let entry = |i: usize, j: usize| scatter.covariance.get(places[i])?.get(places[j]).copied();
        let all: Option<Vec<f64>> = (0..n * n).map(|k| entry(k / n, k % n)).collect();
        let precision = DMatrix::from_row_slice(n, n, &all?).cholesky()?.inverse();
        let mut mean = [0.0; CHANNELS_MAX];
        for (slot, place) in mean.iter_mut().zip(places) {
            *slot = *scatter.mean.get(*place)?;
        }
        Some(Self {
            channels: n,
            mean,
            variance: std::array::from_fn(|i| match places.get(i) {
                Some(&place) => scatter.covariance[place][place],
                None => 1.0,
            }),
            precision: precision.iter().copied().collect(),
            apart: [0.0; CHANNELS_MAX],
            gradient: [0.0; CHANNELS_MAX],
            square: 0.0,
            found: 0,
        })
    }

    /// Takes the roughness of all channels; those that have none count as usual.
    pub fn take(&mut self, roughness: &[(f64, usize)]) {
        let n = self.channels;
        self.found = 0;
        for i in 0..n {
            let found = roughness.get(i).copied().and_then(log_roughness);
            self.found += usize::from(found.is_some());
            self.apart[i] = found.map_or(0.0, |value| value - self.mean[i]);
        }
        self.square = 0.0;
        for i in 0..n {
            let row = &self.precision[i * n..(i + 1) * n];
            self.gradient[i] = row.iter().zip(&self.apart).map(|(k, x)| k * x).sum();
            self.square += self.gradient[i] * self.apart[i];
        }
    }

    /// Logarithm of how much more likely the roughness is if that of several channels has risen, by
    /// deviations larger by `factor`; those that are less rough than usual count as usual.
    #[must_use]
    pub fn any(&self, factor: f64) -> f64 {
        let n = self.channels;
        let risen = self.apart.map(|x| x.max(0.0));
        let rows = self.precision.chunks_exact(n).zip(risen);
        let square: f64 = rows
            .map(|(row, x)| x * row.iter().zip(risen).map(|(k, y)| k * y).sum::<f64>())
            .sum();
        let half = 0.5 * (FREEDOM + n as f64);
        half * ((FREEDOM + square) / (FREEDOM + square / (factor * factor))).ln()
            - n as f64 * factor.ln()
    }

    /// Logarithm of how much more likely the roughness of the last second is if a sensor adds none
    /// of its own, and only the prediction changes.
    #[must_use]
    pub fn still(&self, channel: usize, [read, predicted]: [(f64, usize); 2]) -> f64 {
        if read.1 < STILL_CHANGES_MIN {
            return 0.0;
        }
        let read_count = read.1 as f64;
        let [read, predicted] = [read, predicted].map(|(square, _)| (square + LEAST).ln());
        let variance = self.variance[channel] + 2.0 / read_count;
        let healthy = read - self.mean[channel];
        let still = read - predicted;
        let ratio = 0.5 * (healthy * healthy / variance + variance.ln() - still * still);
        ratio.clamp(-STILL_MAX, STILL_MAX)
    }

    /// Logarithm of how much more likely it all is if the roughness of these channels has risen by
    /// one factor, and that factor of the deviation, with its own deviation.
    #[must_use]
    pub fn rise(&self, risen: impl Fn(usize) -> bool) -> (f64, f64, f64) {
        let n = self.channels;
        let (mut b, mut a) = (0.0, 0.0);
        for i in (0..n).filter(|&i| risen(i)) {
            b += self.gradient[i];
            let row = &self.precision[i * n..(i + 1) * n];
            a += row
                .iter()
                .enumerate()
                .filter(|&(j, _)| risen(j))
                .map(|(_, k)| k)
                .sum::<f64>();
        }
        if self.found == 0 || a <= 0.0 {
            return (0.0, 1.0, 0.0);
        }
        let precision = a + 1.0 / (RISE * RISE);
        let rise = (b / precision).max(0.0);
        let less = rise * b;
        let penalty = 0.5 * (1.0 + RISE * RISE * a).ln();
        let half = 0.5 * (FREEDOM + n as f64);
        let ratio = (FREEDOM + self.square) / (FREEDOM + (self.square - less).max(0.0));
        let factor = (0.5 * rise).exp();
        (
            half * ratio.ln() - penalty,
            factor,
            0.5 * factor / precision.sqrt(),
        )
    }
}
