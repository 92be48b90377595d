//! The Kalman filter on a Gaussian of fixed dimension.

use nalgebra::{Cholesky, SMatrix, SVector};
use vigil_checkpoint::CheckpointValue;

/// A Gaussian over N variables.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Gaussian<const N: usize> {
    /// Mean.
    pub mean: SVector<f64, N>,
    /// Covariance.
    pub covariance: SMatrix<f64, N, N>,
}

impl<const N: usize> Gaussian<N> {
    /// Prediction by `x' = transition x + shift + N(0, noise)`.
    pub fn predict(
        &mut self,
        transition: &SMatrix<f64, N, N>,
        shift: &SVector<f64, N>,
        noise: &SMatrix<f64, N, N>,
    ) {
        self.mean = transition * self.mean + shift;
        self.covariance = transition * self.covariance * transition.transpose() + noise;
    }

    /// Conditions on `z = observe x + N(0, noise)`, given `innovation = z - observe mean` (so that
    /// angles can be wrapped by the caller). Returns `ln p(z)`, or None, unchanged, when the
    /// innovation's covariance is not positive definite or a value is not finite.
    pub fn update<const M: usize>(
        &mut self,
        innovation: &SVector<f64, M>,
        observe: &SMatrix<f64, M, N>,
        noise: &SMatrix<f64, M, M>,
    ) -> Option<f64> {
        let cross = self.covariance * observe.transpose();
        let spread = observe * cross + noise;
        let (log_likelihood, factor) = log_density(innovation, spread)?;
        let gain = factor.solve(&cross.transpose()).transpose();
        self.mean += gain * innovation;
        let covariance = self.covariance - gain * cross.transpose();
        // Rounding makes the two triangles differ; their mean keeps later factors well-defined.
        self.covariance = 0.5 * (covariance + covariance.transpose());
        assert_symmetric(&self.covariance);
        Some(log_likelihood)
    }
}

fn assert_symmetric<const N: usize>(covariance: &SMatrix<f64, N, N>) {
    let is_equal = |a: f64, b: f64| a == b || a.is_nan() && b.is_nan();
    let is_symmetric =
        (0..N).all(|i| (0..i).all(|j| is_equal(covariance[(i, j)], covariance[(j, i)])));
    assert!(is_symmetric, "a covariance is symmetric after an update");
}

/// `ln N(residual; 0, covariance)` and the covariance's Cholesky factor; None when it is not
/// positive definite or the result is not finite.
pub fn log_density<const M: usize>(
    residual: &SVector<f64, M>,
    covariance: SMatrix<f64, M, M>,
) -> Option<(f64, Cholesky<f64, nalgebra::Const<M>>)> {
    let factor = Cholesky::new(covariance)?;
    let whitened = factor.l_dirty().solve_lower_triangular(residual)?;
    let log_determinant: f64 = (0..M).map(|i| factor.l_dirty()[(i, i)].ln()).sum();
    let constant = 0.5 * M as f64 * std::f64::consts::TAU.ln();
    let value = -0.5 * whitened.norm_squared() - log_determinant - constant;
    value.is_finite().then_some((value, factor))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_dimension_matches_the_textbook() {
        let mut state = Gaussian {
            mean: SVector::from([1.0]),
            covariance: SMatrix::from([[4.0]]),
        };
        let identity = SMatrix::from([[1.0]]);
        state.predict(&SMatrix::from([[2.0]]), &SVector::from([0.5]), &identity);
        assert_eq!((state.mean[0], state.covariance[0]), (2.5, 17.0));
        let innovation = SVector::from([4.0 - 2.5]);
        let log_likelihood = state
            .update(&innovation, &identity, &SMatrix::from([[3.0]]))
            .unwrap();
        assert!((log_likelihood - crate::logspace::log_normal(1.5, 20.0)).abs() < 1e-14);
        assert!((state.mean[0] - (2.5 + 17.0 / 20.0 * 1.5)).abs() < 1e-14);
        assert!((state.covariance[0] - 17.0 * 3.0 / 20.0).abs() < 1e-14);
    }

    #[test]
    #[should_panic(expected = "a covariance is symmetric after an update")]
    fn a_covariance_that_is_not_symmetric_is_caught() {
        assert_symmetric(&SMatrix::from([[1.0, 0.1], [0.2, 1.0]]));
    }

    #[test]
    fn two_dimensions_observed_in_one_match_the_conditional_distribution() {
        let mut state = Gaussian {
            mean: SVector::from([1.0, 2.0]),
            covariance: SMatrix::from([[4.0, 1.0], [1.0, 3.0]]),
        };
        let observe = SMatrix::<f64, 1, 2>::new(1.0, 0.0);
        let found = state.update(&SVector::from([0.5]), &observe, &SMatrix::from([[1.0]]));
        // Spread 5: gains 4/5 and 1/5.
        assert!((found.unwrap() - crate::logspace::log_normal(0.5, 5.0)).abs() < 1e-14);
        assert!((state.mean - SVector::from([1.4, 2.1])).abs().max() < 1e-14);
        let expected = SMatrix::from([[0.8, 0.2], [0.2, 2.8]]);
        assert!((state.covariance - expected).abs().max() < 1e-14);
    }

    #[test]
    fn impossible_input_changes_nothing() {
        let before = Gaussian {
            mean: SVector::from([1.0]),
            covariance: SMatrix::from([[4.0]]),
        };
        let identity = SMatrix::from([[1.0]]);
        for (innovation, noise) in [(f64::NAN, 1.0), (0.0, -9.0), (f64::INFINITY, 1.0)] {
            let mut state = before;
            let noise = SMatrix::from([[noise]]);
            assert!(
                state
                    .update(&SVector::from([innovation]), &identity, &noise)
                    .is_none()
            );
            assert_eq!(state, before);
        }
    }
}
