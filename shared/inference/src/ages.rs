//! Detection without a blind spot: nominal against nominal plus an unknown constant bias.
//!
//! A constant likelihood never accumulates evidence for a fault whose residual is small in every
//! step. Here the fault state learns the bias of the whitened residual `r`: components sorted by
//! age (about 1, 2, 4 .. steps since the onset) each carry a log-weight, a mean bias and a scalar
//! variance; per step a fraction of each component grows older, a newborn enters, and each
//! component is conditioned on `r`. The log-odds are the logarithm of the summed weights.

use nalgebra::SVector;

use crate::logspace::{log_add, log_sum_exp};

/// Components: ages 1, 2, 4 .. 256 steps.
const AGES: usize = 9;
/// Log-odds beyond which more evidence changes nothing.
const LOG_ODDS_MAX: f64 = 700.0;

/// Learned-bias detection filter over a whitened residual of D dimensions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ages<const D: usize> {
    log_weight: [f64; AGES],
    bias: [SVector<f64, D>; AGES],
    variance: [f64; AGES],
    prior_variance: f64,
}

impl<const D: usize> Ages<D> {
    /// No fault yet; a newborn fault's bias has the standard deviation `bias_sd` in units of the
    /// residual's.
    #[must_use]
    pub fn new(bias_sd: f64) -> Self {
        let prior_variance = bias_sd * bias_sd;
        Self {
            log_weight: [f64::NEG_INFINITY; AGES],
            bias: [SVector::zeros(); AGES],
            variance: [prior_variance; AGES],
            prior_variance,
        }
    }

    /// Natural log-odds of the fault state.
    #[must_use]
    pub fn log_odds(&self) -> f64 {
        log_sum_exp(&self.log_weight).clamp(-LOG_ODDS_MAX, LOG_ODDS_MAX)
    }

    /// One step with the whitened residual and the probability `birth` that a fault appears in it.
    /// A residual that is not finite is no evidence.
    pub fn step(&mut self, residual: &SVector<f64, D>, birth: f64) {
        let nominal = residual.norm_squared();
        if !nominal.is_finite() {
            return;
        }
        for j in (0..AGES - 1).rev() {
            self.grow_older(j);
        }
        self.merge(0, birth.ln(), SVector::zeros(), self.prior_variance);
        let mut highest = f64::NEG_INFINITY;
        for j in 0..AGES {
            let spread = 1.0 + self.variance[j];
            let deviation = residual - self.bias[j];
            self.log_weight[j] += 0.5 * (nominal - deviation.norm_squared() / spread)
                - 0.5 * D as f64 * spread.ln()
                - (1.0 - birth).ln();
            let gain = self.variance[j] / spread;
            self.bias[j] += gain * deviation;
            self.variance[j] *= 1.0 - gain;
            highest = highest.max(self.log_weight[j]);
        }
        let excess = highest - LOG_ODDS_MAX;
        if excess > 0.0 {
            self.log_weight = self.log_weight.map(|log_weight| log_weight - excess);
        }
    }

    /// Moves the fraction 2^-j of component j into component j + 1.
    fn grow_older(&mut self, j: usize) {
        if self.log_weight[j] == f64::NEG_INFINITY {
            return;
        }
        let fraction = 0.5_f64.powi(j as i32);
        let moved = self.log_weight[j] + fraction.ln();
        self.merge(j + 1, moved, self.bias[j], self.variance[j]);
        self.log_weight[j] = if j == 0 {
            f64::NEG_INFINITY
        } else {
            self.log_weight[j] + (1.0 - fraction).ln()
        };
    }

    /// Adds a component's weight to component j, matching the first two moments.
    fn merge(&mut self, j: usize, log_weight: f64, bias: SVector<f64, D>, variance: f64) {
        let total = log_add(self.log_weight[j], log_weight);
        if total == f64::NEG_INFINITY {
            return;
        }
        let (old, new) = (
            (self.log_weight[j] - total).exp(),
            (log_weight - total).exp(),
        );
        let apart = (self.bias[j] - bias).norm_squared() / D as f64;
        self.variance[j] = old * self.variance[j] + new * variance + old * new * apart;
        self.bias[j] = self.bias[j] * old + bias * new;
        self.log_weight[j] = total;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    /// Mean number of steps until the log-odds exceed `alarm`, over `runs` seeded runs.
    fn delay(lambda: f64, alarm: f64, runs: u64, steps_max: usize) -> f64 {
        let mut total = 0;
        for seed in 0..runs {
            let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
            let mut filter = Ages::<3>::new(1.0);
            let bias = SVector::from([lambda.sqrt(), 0.0, 0.0]);
            total += 1
                + (0..steps_max)
                    .position(|_| {
                        let noise = SVector::<f64, 3>::from_fn(|_, _| rng.sample(StandardNormal));
                        filter.step(&(noise + bias), 1e-3);
                        filter.log_odds() > alarm
                    })
                    .unwrap_or(steps_max);
        }
        total as f64 / runs as f64
    }

    #[test]
    fn delays_match_the_published_table_at_one_false_alarm_in_ten_thousand_steps() {
        // A threshold near this one gives 1e4 steps between false alarms at birth 1e-3.
        let alarm = 1.6;
        let between_alarms = delay(0.0, alarm, 60, 60_000);
        assert!((4e3..3e4).contains(&between_alarms), "{between_alarms}");
        for (lambda, expected) in [(0.25, 78.0), (1.0, 19.0), (5.0, 5.0), (20.0, 2.0)] {
            let mean = delay(lambda, alarm, 300, 2000);
            let allowed = 0.3 * expected + 0.7;
            assert!(
                (mean - expected).abs() < allowed,
                "{lambda}: {mean} steps, not {expected}"
            );
        }
    }

    #[test]
    fn the_first_step_is_the_marginal_likelihood_ratio() {
        let mut filter = Ages::<1>::new(2.0);
        filter.step(&SVector::from([3.0]), 0.01);
        let ratio = crate::logspace::log_normal(3.0, 5.0) - crate::logspace::log_normal(3.0, 1.0);
        assert!((filter.log_odds() - (ratio + (0.01_f64 / 0.99).ln())).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn no_residual_breaks_the_filter(values in prop::collection::vec(any::<f64>(), 1..60)) {
            let mut filter = Ages::<1>::new(1.0);
            for value in values {
                filter.step(&SVector::from([value]), 1e-6);
                prop_assert!(filter.log_odds().is_finite());
            }
        }
    }
}
