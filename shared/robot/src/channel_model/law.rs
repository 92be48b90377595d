//! The joint law of all channels over the last few seconds.
//!
//! Whitened residuals, averaged over blocks of half a second, are jointly Gaussian with a scale
//! that is not known (a Student law): along each principal direction of their covariance they have
//! a correlation in time of its own. What a healthy robot does slowly (its ground, its battery) and
//! what it does in several channels at once is so no evidence for a fault; what no direction of its
//! own explains is.
//!
//! With `P` the precision of the law and `z` the residuals, a change by `x·s` is weighed by
//! `b = sᵀPz` and `a = sᵀPs`: it lessens `zᵀPz` by `b²/a`.

mod joint_signature;
mod likelihoods;
mod own_row;

use serde::{Deserialize, Serialize};
use vigil_checkpoint::Checkpoint;
use vigil_inference::logspace::log_sum_exp;

use super::CHANNELS_MAX;
pub use super::square::{BLOCKS, Row, Square};
use super::square::{
    along, by_block, dot, inverse, lower, product, sums_from, whitening, whitening_backwards,
};

pub use joint_signature::JointSignature;
pub use likelihoods::Likelihoods;
pub use own_row::OwnRow;

/// Length of each, s.
pub const BLOCK_S: f64 = 0.5;
/// Degrees of freedom of the law. Chosen on logs of a Husky, a Robotino and a Kobuki: with 4 a
/// large fault of one sensor passes for a rough moment of all, with 100 rough moments pass for
/// faults.
const FREEDOM: f64 = 30.0;
/// Deviations of a robot with which something is wrong that no single fault explains, relative to
/// those of a healthy one: with one factor a gross fault would say hardly more than a small one.
const UNKNOWN: [f64; 5] = [2.0, 4.0, 8.0, 16.0, 32.0];
/// Blocks of the window from which on it may be so: what has just begun is a small part of it.
const UNKNOWN_ONSETS: [usize; 4] = [0, 4, 6, 7];
/// Sweeps over channels that were not measured, by which each gets the mean that the others give.
const SWEEPS: usize = 3;

/// A principal direction of the residuals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Direction {
    /// Unit vector over the channels.
    pub vector: Vec<f64>,
    /// Variance of a block's mean along it.
    pub variance: f64,
    /// Correlation with the blocks before, nearest first.
    pub correlation: [f64; BLOCKS - 1],
}

impl Direction {
    /// Covariance of its values in time.
    #[must_use]
    pub fn covariance(&self) -> Square {
        let at = |lag: usize| match lag {
            0 => self.variance,
            lag => self.variance * self.correlation[lag - 1],
        };
        std::array::from_fn(|i| std::array::from_fn(|j| at(i.abs_diff(j))))
    }
}

/// What a window `z`, whose precision matrix is `P`, says of a change `s`: the square of `z - x s`
/// is that of `z` less `2 x b - x^2 a`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// `s' P z`.
    pub b: f64,
    /// `s' P s`.
    pub a: f64,
}

impl Change {
    /// By how much the square lessens if the change is there in full.
    #[must_use]
    pub fn less(&self) -> f64 {
        2.0 * self.b - self.a
    }
}

/// The law at work: what the last window says.
#[derive(Debug, Clone, Checkpoint)]
pub struct Law {
    #[checkpoint(fixed)]
    channels: usize,
    /// The first block of the window that is there.
    #[checkpoint(fixed)]
    first: usize,
    #[checkpoint(fixed)]
    directions: Vec<Direction>,
    #[checkpoint(fixed)]
    precision: Vec<Square>,
    /// Its part on and below the diagonal, which counts half.
    #[checkpoint(fixed)]
    lower: Vec<Square>,
    /// What makes the values along each direction independent, the oldest first, by columns.
    #[checkpoint(fixed)]
    whitening: Vec<Square>,
    /// Inverse of the covariance of one block, by rows.
    #[checkpoint(fixed)]
    spatial: Vec<f64>,
    /// Precision of each channel's blocks given all others: its part on and below the diagonal,
    /// which counts half, and what makes values of that covariance independent, the newest first.
    #[checkpoint(fixed)]
    own_lower: Vec<Square>,
    #[checkpoint(fixed)]
    own_whitening: Vec<Square>,
    /// The window, completed: residuals by channel, and `Pz`.
    z: [Row; CHANNELS_MAX],
    /// One where a reading is there, else zero.
    read: [Row; CHANNELS_MAX],
    gradient: [Row; CHANNELS_MAX],
    /// Part of each block in the square, given the blocks before it.
    parts: Row,
    square: f64,
}

impl Law {
    /// A law of so many channels for windows that begin with block `first`; none if the directions
    /// are none of a covariance.
    #[must_use]
    pub fn new(directions: &[Direction], channels: usize, first: usize) -> Option<Self> {
        let fits = (1..=CHANNELS_MAX).contains(&channels) && first < BLOCKS;
        if !fits || directions.len() != channels {
            return None;
        }
        let whole = |d: &Direction| d.vector.len() == channels && d.variance > 0.0;
        if !directions.iter().all(whole) {
            return None;
        }
        let of_each = |of: fn(&Square, usize) -> Option<Square>| {
            let found = directions.iter().map(|d| of(&d.covariance(), first));
            found.collect::<Option<Vec<Square>>>()
        };
        let (precision, whitening) = (of_each(inverse)?, of_each(whitening)?);
        let mut spatial = vec![0.0; channels * channels];
        let mut own = vec![[[0.0; BLOCKS]; BLOCKS]; channels];
        for (direction, precision) in directions.iter().zip(&precision) {
            for i in 0..channels {
                let share = direction.vector[i] * direction.vector[i];
                for (row, from) in own[i].iter_mut().zip(precision) {
                    row.iter_mut().zip(from).for_each(|(a, b)| *a += share * b);
                }
                for j in 0..channels {
                    spatial[i * channels + j] +=
                        direction.vector[i] * direction.vector[j] / direction.variance;
                }
            }
        }
        let own_whitening = own.iter().map(|own| whitening_backwards(own, first));
        Some(Self {
            channels,
            first,
            directions: directions.to_vec(),
            lower: precision.iter().map(lower).collect(),
            precision,
            whitening,
            spatial,
            own_lower: own.iter().map(lower).collect(),
            own_whitening: own_whitening.collect::<Option<_>>()?,
            z: [[0.0; BLOCKS]; CHANNELS_MAX],
            read: [[0.0; BLOCKS]; CHANNELS_MAX],
            gradient: [[0.0; BLOCKS]; CHANNELS_MAX],
            parts: [0.0; BLOCKS],
            square: 0.0,
        })
    }

    /// Its principal directions.
    #[must_use]
    pub fn directions(&self) -> &[Direction] {
        &self.directions
    }

    /// Takes a window. What was not measured takes the value that the other channels of its block
    /// give, where there are any, and none else.
    pub fn take(&mut self, window: &[[Option<f64>; BLOCKS]]) {
        let n = self.channels;
        for (i, values) in window.iter().enumerate().take(n) {
            self.z[i] = values.map(|value| value.unwrap_or(0.0));
            self.read[i] = values.map(|value| f64::from(u8::from(value.is_some())));
        }
        for block in 0..BLOCKS {
            let missing = |i: usize| window.get(i).is_none_or(|row| row[block].is_none());
            if (0..n).all(missing) || !(0..n).any(missing) {
                continue;
            }
            for _ in 0..SWEEPS {
                for i in (0..n).filter(|&i| missing(i)) {
                    let row = &self.spatial[i * n..(i + 1) * n];
                    let others = row.iter().zip(&self.z).enumerate();
                    let others = others.filter(|&(j, _)| j != i);
                    let sum: f64 = others.map(|(_, (k, z))| k * z[block]).sum();
                    self.z[i][block] = -sum / row[i];
                }
            }
        }
        self.gradient = [[0.0; BLOCKS]; CHANNELS_MAX];
        self.parts = [0.0; BLOCKS];
        let laws = self.precision.iter().zip(&self.whitening);
        for (direction, (precision, whitening)) in self.directions.iter().zip(laws) {
            let along = along(&direction.vector, &self.z);
            let weighed = product(precision, &along);
            let parts = self.parts.iter_mut().zip(product(whitening, &along));
            parts.for_each(|(part, value)| *part += value * value);
            for (share, row) in direction.vector.iter().zip(&mut self.gradient) {
                row.iter_mut()
                    .zip(weighed)
                    .for_each(|(a, b)| *a += share * b);
            }
        }
        self.square = self.parts.iter().sum();
        // What was not measured speaks for nothing.
        for (row, read) in self.gradient.iter_mut().zip(&self.read) {
            *row = by_block(row, read);
        }
    }

    /// Forgets the window.
    pub fn clear(&mut self) {
        self.z = [[0.0; BLOCKS]; CHANNELS_MAX];
        self.read = [[0.0; BLOCKS]; CHANNELS_MAX];
        self.gradient = [[0.0; BLOCKS]; CHANNELS_MAX];
        (self.parts, self.square) = ([0.0; BLOCKS], 0.0);
    }

    /// The residuals of a channel, completed.
    #[must_use]
    pub fn row(&self, channel: usize) -> &Row {
        &self.z[channel]
    }

    /// Precision between the blocks of two channels.
    #[must_use]
    pub fn between(&self, one: usize, other: usize) -> Square {
        let mut out = [[0.0; BLOCKS]; BLOCKS];
        for (direction, precision) in self.directions.iter().zip(&self.precision) {
            let share = direction.vector[one] * direction.vector[other];
            for (row, from) in out.iter_mut().zip(precision) {
                row.iter_mut().zip(from).for_each(|(a, b)| *a += share * b);
            }
        }
        out
    }

    /// `Pz` at a channel; zero where nothing was measured.
    #[must_use]
    pub fn gradient(&self, channel: usize) -> &Row {
        &self.gradient[channel]
    }

    /// A change of a channel, where it was measured.
    #[must_use]
    pub fn masked(&self, channel: usize, row: &Row) -> Row {
        by_block(row, &self.read[channel])
    }

    /// Square of the window under the law: its expectation is the number of its values.
    #[must_use]
    pub const fn square(&self) -> f64 {
        self.square
    }

    /// Number of values of a window.
    #[must_use]
    pub const fn values(&self) -> usize {
        self.channels * (BLOCKS - self.first)
    }

    /// Blocks of a window from `from` on.
    #[must_use]
    pub fn blocks(&self, from: usize) -> usize {
        BLOCKS - from.max(self.first)
    }

    /// A row of a channel under its law given all other readings.
    #[must_use]
    pub fn own_row(&self, channel: usize, row: &Row) -> OwnRow {
        OwnRow {
            row: *row,
            later: product(&self.own_lower[channel], row),
        }
    }

    /// What a window says of a change of one channel, from each block on. The
    /// signature is zero where nothing was measured.
    #[must_use]
    pub fn change(&self, channel: usize, signature: &OwnRow) -> [Change; BLOCKS] {
        let b = sums_from(by_block(&signature.row, &self.gradient[channel]));
        let a = signature.square();
        std::array::from_fn(|first| Change {
            b: b[first],
            a: a[first],
        })
    }

    /// `P s` of a signature, by channel. Its product with another one says how alike both are.
    #[must_use]
    pub fn weighed(&self, signature: &[Row]) -> Vec<Row> {
        let mut out = vec![[0.0; BLOCKS]; self.channels];
        for (direction, precision) in self.directions.iter().zip(&self.precision) {
            let weighed = product(precision, &along(&direction.vector, signature));
            for (share, row) in direction.vector.iter().zip(&mut out) {
                let values = row.iter_mut().zip(weighed);
                values.for_each(|(sum, value)| *sum += share * value);
            }
        }
        out
    }

    /// What a channel's readings from `first` on say of two signatures that are `weighed`: so much
    /// less is their product if they say nothing.
    #[must_use]
    pub fn hidden(&self, channel: usize, first: usize, [one, other]: [&Row; 2]) -> f64 {
        let [one, other] = [one, other].map(|row| product(&self.own_whitening[channel], row));
        sums_from(by_block(&one, &other))[first]
    }

    /// What a channel whose readings say nothing from `first` on adds to a signature that is
    /// `weighed`, so that the signature says nothing of these readings either.
    #[must_use]
    pub fn completion(&self, channel: usize, first: usize, weighed: &Row) -> Row {
        let whitening = &self.own_whitening[channel];
        let mut whitened = product(whitening, weighed);
        whitened[..first].fill(0.0);
        whitening.map(|row| -dot(&row, &whitened))
    }

    /// By how much the square lessens if a channel's readings from each block on say nothing.
    #[must_use]
    pub fn silenced(&self, channel: usize) -> Row {
        let whitened = product(&self.own_whitening[channel], &self.gradient[channel]);
        sums_from(by_block(&whitened, &whitened))
    }

    /// Natural logarithm of how much more likely the window is if its square were less by `less`
    /// and its density lower by the exponent of `penalty`.
    #[must_use]
    pub fn log_ratio(&self, less: f64, penalty: f64) -> f64 {
        self.log_ratio_at(self.square, less) - penalty
    }

    /// The same of a window with this square, without a penalty.
    #[must_use]
    pub fn log_ratio_at(&self, square: f64, less: f64) -> f64 {
        let least = square - less.min(square);
        let half = 0.5 * (FREEDOM + self.values() as f64);
        half * ((FREEDOM + square) / (FREEDOM + least)).ln()
    }

    /// Square that a change leaves which makes the window so much more likely: at most, as what
    /// the change costs is in that.
    #[must_use]
    pub fn left(&self, log_ratio: f64) -> f64 {
        let half = 0.5 * (FREEDOM + self.values() as f64);
        let left = (FREEDOM + self.square) * (-log_ratio.max(0.0) / half).exp();
        (left - FREEDOM).max(0.0)
    }

    /// Part of each block in the square, given the blocks before it.
    #[must_use]
    pub const fn parts(&self) -> &Row {
        &self.parts
    }

    /// Natural logarithm of how much more likely a window with this square is if something is wrong
    /// that no single fault explains: from some block on all deviations are larger by one of a few
    /// factors. `parts`: of the blocks in the square, as far as they are known; from the first that
    /// is not, no onset is tried.
    #[must_use]
    pub fn log_ratio_unknown(&self, square: f64, parts: &[f64]) -> f64 {
        let tried = UNKNOWN_ONSETS.map(|first| {
            let Some(before) = parts.get(..first) else {
                return f64::NEG_INFINITY;
            };
            let later = square - before.iter().sum::<f64>();
            let larger = UNKNOWN.map(|factor| {
                let less = later * (1.0 - 1.0 / (factor * factor));
                let values = (self.channels * self.blocks(first)) as f64;
                self.log_ratio_at(square, less) - values * factor.ln()
            });
            log_sum_exp(&larger) - (UNKNOWN.len() as f64).ln()
        });
        log_sum_exp(&tried) - (UNKNOWN_ONSETS.len() as f64).ln()
    }

    /// Natural logarithm of how much more likely a window with this square is if all its deviations
    /// are larger by this factor.
    #[must_use]
    pub fn log_ratio_larger(&self, square: f64, factor: f64) -> f64 {
        let less = square * (1.0 - 1.0 / (factor * factor));
        self.log_ratio_at(square, less) - self.values() as f64 * factor.ln()
    }

    /// Scale of the variances that the rest of the window shows, with a square less by `less`.
    #[must_use]
    pub fn variance_scale(&self, less: f64) -> f64 {
        let least = self.square - less.min(self.square);
        (FREEDOM + least) / (FREEDOM + self.values() as f64)
    }
}
