//! The paper's constant likelihood (Verma, Fernandez, Simmons 2002) on overlapping windows.
//!
//! The last W whitened residuals, summed and divided by √W, are white again when nominal, but a
//! constant bias with squared size λ has the size Wλ there. The blind spot of [`crate::constant`]
//! shrinks from `λ <= τ² - d` to `λ <= (τ² - d) / W`; a large fault is detected up to W steps
//! later. Every residual lies in W windows, so that each window counts as the W-th part of its
//! evidence: a step adds `(|r_W|² - τ²) / 2W`.

use nalgebra::SVector;
use vigil_checkpoint::CheckpointValue;

use crate::constant::Constant;

/// Two states with a constant likelihood over windows of W whitened residuals of D dimensions.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Windowed<const D: usize, const W: usize> {
    /// The last residuals, by step modulo W.
    residuals: [SVector<f64, D>; W],
    next: usize,
    count: usize,
    states: Constant,
}

impl<const D: usize, const W: usize> Default for Windowed<D, W> {
    fn default() -> Self {
        const { assert!(W > 0, "a window holds a residual") };
        Self {
            residuals: [SVector::zeros(); W],
            next: 0,
            count: 0,
            states: Constant::default(),
        }
    }
}

impl<const D: usize, const W: usize> Windowed<D, W> {
    /// Natural log-odds of the fault state.
    #[must_use]
    pub const fn log_odds(&self) -> f64 {
        self.states.log_odds()
    }

    /// See [`Constant::gain`].
    #[must_use]
    pub const fn gain(&self) -> f64 {
        self.states.gain()
    }

    /// One step with the whitened residual; the other arguments as in [`Constant::step`]. Until W
    /// residuals have come, the window holds those that have. A residual that is not finite is no
    /// evidence and enters no window.
    pub fn step(&mut self, residual: &SVector<f64, D>, tau_squared: f64, birth: f64, death: f64) {
        if !residual.norm_squared().is_finite() {
            return;
        }
        self.residuals[self.next] = *residual;
        self.next = (self.next + 1) % W;
        self.count = (self.count + 1).min(W);
        // Summed anew: a running sum would keep the rounding of a huge residual for ever.
        let sum: SVector<f64, D> = self.residuals.iter().sum();
        let norm_squared = (sum.norm_squared() / self.count as f64).min(f64::MAX);
        let evidence = 0.5 * (norm_squared - tau_squared) / W as f64;
        self.states.take(evidence, birth, death);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn windows_of_three_match_the_sums_by_hand() {
        let mut filter = Windowed::<2, 3>::default();
        let residuals = [[1.0, 2.0], [3.0, 0.0], [-1.0, 1.0], [2.0, 2.0], [0.0, -4.0]];
        // |r_W|²: 5/1, (16+4)/2, (9+9)/3, (16+9)/3, (1+1)/3.
        let norms = [5.0, 10.0, 6.0, 25.0 / 3.0, 2.0 / 3.0];
        let mut odds = 0.0_f64;
        for (residual, norm) in residuals.iter().zip(norms) {
            filter.step(&SVector::from(*residual), 4.0, 0.1, 0.2);
            let ratio = ((norm - 4.0) / 6.0_f64).exp();
            odds = (odds * 0.8 + 0.1) / (0.9 + odds * 0.2) * ratio;
            assert!((filter.log_odds() - odds.ln()).abs() < 1e-12);
        }
    }

    #[test]
    fn a_window_of_one_is_the_constant_form() {
        let (mut windowed, mut constant) = (Windowed::<1, 1>::default(), Constant::default());
        for i in 0..50 {
            let residual = f64::from(i * 7 % 5) - 2.0;
            windowed.step(&SVector::from([residual]), 1.6, 1e-3, 1e-4);
            constant.step(residual * residual, 1.6, 1e-3, 1e-4);
            assert_eq!(windowed.log_odds().to_bits(), constant.log_odds().to_bits());
        }
    }

    #[test]
    fn the_blind_spot_is_a_window_smaller() {
        // A bias alone, λ = 1 in one dimension: below τ² = 5 for one step, above it for ten.
        let bias = SVector::from([1.0]);
        let (mut one, mut ten) = (Windowed::<1, 1>::default(), Windowed::<1, 10>::default());
        for _ in 0..200 {
            one.step(&bias, 5.0, 1e-6, 1e-6);
            ten.step(&bias, 5.0, 1e-6, 1e-6);
        }
        assert!(one.log_odds() < -13.0);
        assert!(ten.log_odds() > 10.0);
    }

    proptest! {
        #[test]
        fn no_residual_breaks_the_filter(values in prop::collection::vec(any::<f64>(), 1..60)) {
            let mut filter = Windowed::<1, 4>::default();
            for value in values {
                filter.step(&SVector::from([value]), 1.6, 1e-6, 1e-6);
                prop_assert!(!filter.log_odds().is_nan() && filter.log_odds() <= 40.0);
            }
            // Nothing stays of it once it has left the window.
            for _ in 0..4 {
                filter.step(&SVector::from([0.5]), 1.6, 1e-6, 1e-6);
            }
            let sum: f64 = filter.residuals.iter().map(|residual| residual[0]).sum();
            prop_assert_eq!(sum, 2.0);
        }
    }
}
