//! A change of several channels at once, each by an amount of its own.
//!
//! With `s_i` the shift of channel `i` by one unit, `P` the precision of the law and `z` the
//! window, the amounts `x ~ N(0, D)` lessen the square of the window by `bᵀM⁻¹b`, at a price of
//! `½ ln det(DM)`, where `b_i = s_iᵀPz`, `a_ij = s_iᵀPs_j` and `M = A + D⁻¹`: the marginal
//! likelihood of a linear model with Gaussian amounts.

use nalgebra::{SMatrix, SVector};

use super::law::{BLOCKS, Law, Row, Square};
use crate::fault_table::SHOWN_MAX;

/// Smallest variance of an amount.
const VARIANCE_MIN: f64 = 1e-300;

/// What a window says of such a change.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Shift {
    /// By how much it lessens the square of the window.
    pub less: f64,
    /// Its price, nats.
    pub penalty: f64,
}

/// The part of a law that such a change needs.
#[derive(Debug, Clone)]
pub struct ShiftLaw {
    /// Channels that shift.
    channels: Vec<usize>,
    /// Precision between each two of them, by rows.
    between: Vec<Square>,
}

impl ShiftLaw {
    /// For shifts of these channels of a law, at most [`SHOWN_MAX`].
    #[must_use]
    pub fn new(law: &Law, channels: &[usize]) -> Self {
        let channels = channels[..channels.len().min(SHOWN_MAX)].to_vec();
        let row = |&i: &usize| channels.iter().map(move |&j| law.between(i, j));
        Self {
            between: channels.iter().flat_map(row).collect(),
            channels,
        }
    }

    /// What the window of `law` says of a shift from block `first` on; for each of the channels:
    /// the change by one unit, and the deviation of the amount.
    #[must_use]
    pub fn weigh(&self, law: &Law, first: usize, shift: impl Fn(usize) -> (Row, f64)) -> Shift {
        let n = self.channels.len();
        let mut rows = [[0.0; BLOCKS]; SHOWN_MAX];
        let mut precision = SMatrix::<f64, SHOWN_MAX, SHOWN_MAX>::identity();
        let mut b = SVector::<f64, SHOWN_MAX>::zeros();
        let mut log_variances = 0.0;
        for (i, &channel) in self.channels.iter().enumerate() {
            let (row, sd) = shift(channel);
            rows[i] = law.masked(channel, &row);
            rows[i][..first].fill(0.0);
            let variance = (sd * sd).max(VARIANCE_MIN);
            precision[(i, i)] = 1.0 / variance;
            log_variances += variance.ln();
            let gradient = law.gradient(channel);
            b[i] = rows[i].iter().zip(gradient).map(|(s, g)| s * g).sum();
        }
        for i in 0..n {
            for j in 0..n {
                let square = &self.between[i * n + j];
                let along = |k: usize| rows[i][k] * dot(&square[k], &rows[j]);
                precision[(i, j)] += (first..BLOCKS).map(along).sum::<f64>();
            }
        }
        let Some(cholesky) = precision.cholesky() else {
            return Shift::default();
        };
        let diagonal = cholesky.l_dirty().diagonal();
        let log_determinant: f64 = 2.0 * diagonal.map(f64::ln).sum();
        Shift {
            less: b.dot(&cholesky.solve(&b)),
            penalty: 0.5 * (log_determinant + log_variances),
        }
    }
}

fn dot(a: &Row, b: &Row) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel_model::law::Direction;

    /// Two channels that share nothing, of unit variance and no correlation in time.
    fn law(first: usize) -> Law {
        let direction = |vector: [f64; 2]| Direction {
            vector: vector.to_vec(),
            variance: 1.0,
            correlation: [0.0; BLOCKS - 1],
        };
        Law::new(&[direction([1.0, 0.0]), direction([0.0, 1.0])], 2, first).unwrap()
    }

    #[test]
    fn independent_channels_add_what_each_says() {
        let mut law = law(0);
        law.take(&[[Some(2.0); BLOCKS], [Some(-1.0); BLOCKS]]);
        let shift = ShiftLaw::new(&law, &[0, 1]);
        let found = shift.weigh(&law, 4, |channel| ([1.0; BLOCKS], [3.0, 0.5][channel]));
        // Of a mean of n values with an amount of variance v: n² z² / (n + 1/v), ½ ln(1 + n v).
        let (n, v) = (4.0_f64, [9.0_f64, 0.25]);
        let less = n * n * (4.0 / (n + 1.0 / v[0]) + 1.0 / (n + 1.0 / v[1]));
        let penalty = 0.5 * ((1.0 + n * v[0]).ln() + (1.0 + n * v[1]).ln());
        assert!((found.less - less).abs() < 1e-9, "{found:?}");
        assert!((found.penalty - penalty).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn one_channel_is_the_change_of_that_channel() {
        let mut law = law(2);
        let z = std::array::from_fn(|block| Some(0.3 * block as f64 - 1.0));
        law.take(&[z, [None; BLOCKS]]);
        let row: Row = std::array::from_fn(|block| 1.0 + 0.1 * block as f64);
        let change = law.change(0, &law.own_row(0, &row))[3];
        let found = ShiftLaw::new(&law, &[0]).weigh(&law, 3, |_| (row, 2.0));
        let precision = change.a + 0.25;
        assert!((found.less - change.b * change.b / precision).abs() < 1e-9);
        assert!((found.penalty - 0.5 * (precision / 0.25).ln()).abs() < 1e-9);
    }

    #[test]
    fn what_was_not_measured_says_nothing() {
        let mut law = law(0);
        law.take(&[[Some(5.0); BLOCKS], [None; BLOCKS]]);
        let found = ShiftLaw::new(&law, &[1]).weigh(&law, 0, |_| ([1.0; BLOCKS], 1.0));
        assert!(found.less.abs() < 1e-12 && found.penalty.abs() < 1e-12);
    }
}
