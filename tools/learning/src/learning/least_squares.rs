//! Weighted linear least squares of a few terms.

use nalgebra::{Cholesky, SMatrix, SVector};

/// Relative size of the ridge that keeps a term without data at zero.
const RIDGE: f64 = 1e-9;

/// Normal equations of N terms.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquares<const N: usize> {
    matrix: SMatrix<f64, N, N>,
    right: SVector<f64, N>,
    count: usize,
}

impl<const N: usize> Default for LeastSquares<N> {
    fn default() -> Self {
        Self {
            matrix: SMatrix::zeros(),
            right: SVector::zeros(),
            count: 0,
        }
    }
}

impl<const N: usize> LeastSquares<N> {
    /// Adds one observation of `Σ c_i basis_i`.
    pub fn push(&mut self, basis: [f64; N], value: f64, weight: f64) {
        let basis = SVector::from(basis);
        self.matrix += basis * basis.transpose() * weight;
        self.right += basis * (value * weight);
        self.count += 1;
    }

    /// The coefficients; None if there are fewer observations than terms or nothing is finite.
    #[must_use]
    pub fn solve(&self) -> Option<[f64; N]> {
        if self.count < N {
            return None;
        }
        let ridge = self.matrix.trace() * RIDGE;
        let matrix = self.matrix + SMatrix::identity() * ridge;
        let solution = Cholesky::new(matrix)?.solve(&self.right);
        solution
            .iter()
            .all(|value| value.is_finite())
            .then(|| solution.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_recovered() {
        let mut fit = LeastSquares::<3>::default();
        for i in -3..=3 {
            let x = f64::from(i);
            fit.push([1.0, x, x * x], 2.0 - x + 0.5 * x * x, 1.0 + x * x);
        }
        let c = fit.solve().unwrap();
        for (found, expected) in c.iter().zip([2.0, -1.0, 0.5]) {
            assert!((found - expected).abs() < 1e-5);
        }
        assert!(LeastSquares::<3>::default().solve().is_none());
    }
}
