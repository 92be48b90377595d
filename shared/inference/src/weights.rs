//! Weights of particles, kept as normalised logarithms.

use vigil_checkpoint::CheckpointValue;

use crate::filter::is_distribution;

/// Normalised weights: the logarithms and their exponentials.
#[derive(Debug, Clone, PartialEq, CheckpointValue)]
pub(crate) struct Weights {
    log: Vec<f64>,
    linear: Vec<f64>,
    effective: f64,
}

impl Weights {
    /// `count` equal weights, at least 1.
    pub(crate) fn equal(count: usize) -> Self {
        let count = count.max(1);
        let mut weights = Self {
            log: vec![0.0; count],
            linear: vec![0.0; count],
            effective: 0.0,
        };
        weights.level(count);
        weights
    }

    /// Makes `count` weights equal; allocates nothing up to the number of the start.
    pub(crate) fn level(&mut self, count: usize) {
        let share = 1.0 / count as f64;
        self.log.resize(count, 0.0);
        self.linear.resize(count, 0.0);
        self.log.fill(share.ln());
        self.linear.fill(share);
        self.effective = count as f64;
    }

    /// Multiplies each weight by `exp(increment)` and normalises; returns the logarithm of the sum
    /// before. With log-likelihoods as increments that is the estimate of the evidence, whether or
    /// not the particles were resampled in the step before. None, unchanged, if nothing is left.
    /// An increment that is not a number counts as impossible.
    pub(crate) fn absorb(&mut self, increments: &[f64]) -> Option<f64> {
        assert!(
            increments.len() == self.log.len(),
            "each particle's weight has one increment"
        );
        let mut highest = f64::NEG_INFINITY;
        for (log, increment) in self.log.iter().zip(increments) {
            // Not a number is never the maximum.
            highest = highest.max(log + increment);
        }
        if !highest.is_finite() {
            return None;
        }
        let mut sum = 0.0;
        for ((linear, log), increment) in self.linear.iter_mut().zip(&self.log).zip(increments) {
            let weight = (log + increment - highest).exp();
            *linear = if weight.is_nan() { 0.0 } else { weight };
            sum += *linear;
        }
        let evidence = highest + sum.ln();
        let mut squares = 0.0;
        for (log, linear) in self.log.iter_mut().zip(&mut self.linear) {
            *linear /= sum;
            *log = linear.ln();
            squares += *linear * *linear;
        }
        self.effective = 1.0 / squares;
        assert!(
            is_distribution(&self.linear),
            "weights are positive and sum to one"
        );
        Some(evidence)
    }

    /// The normalised weights.
    pub(crate) fn linear(&self) -> &[f64] {
        &self.linear
    }

    /// Their logarithms.
    pub(crate) fn log(&self) -> &[f64] {
        &self.log
    }

    /// `1 / Σ W²`.
    pub(crate) const fn effective_sample_size(&self) -> f64 {
        self.effective
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_evidence_is_the_weighted_mean_of_the_likelihoods() {
        let mut weights = Weights::equal(4);
        let likelihood = [0.1_f64, 0.2, 0.3, 0.4].map(f64::ln);
        assert!((weights.absorb(&likelihood).unwrap() - 0.25_f64.ln()).abs() < 1e-14);
        // Not resampled: the second mean is weighted by the first likelihoods.
        let second: f64 = (1..=4)
            .map(|i| f64::from(i * i) / 1000.0 / 0.25 / 4.0 * 10.0)
            .sum();
        assert!((weights.absorb(&likelihood).unwrap() - second.ln()).abs() < 1e-14);
        let sixteenths: f64 = (1..=4).map(|i| f64::from(i).powi(4)).sum();
        let fourths: f64 = (1..=4).map(|i| f64::from(i).powi(2)).sum();
        let expected = fourths * fourths / sixteenths;
        assert!((weights.effective_sample_size() - expected).abs() < 1e-12);
    }

    #[test]
    #[should_panic(expected = "weights are positive and sum to one")]
    fn a_weight_that_was_left_out_is_caught() {
        let mut weights = Weights::equal(3);
        weights.linear.push(0.5);
        weights.absorb(&[-1.0, -2.0, -3.0]);
    }

    #[test]
    #[should_panic(expected = "each particle's weight has one increment")]
    fn a_missing_increment_is_caught() {
        Weights::equal(3).absorb(&[-1.0, -2.0]);
    }

    #[test]
    fn levelled_weights_are_equal() {
        let mut weights = Weights::equal(0);
        assert_eq!(weights.linear(), [1.0]);
        weights.absorb(&[-5.0]);
        weights.level(4);
        assert_eq!(weights.linear(), [0.25; 4]);
        assert_eq!(weights.log(), [0.25_f64.ln(); 4]);
        assert_eq!(weights.effective_sample_size(), 4.0);
    }

    proptest! {
        #[test]
        fn weights_stay_finite_and_sum_to_one(
            steps in prop::collection::vec(prop::collection::vec(any::<f64>(), 5), 1..8)
        ) {
            let mut weights = Weights::equal(5);
            for increments in steps {
                let before = weights.clone();
                if weights.absorb(&increments).is_none() {
                    prop_assert_eq!(&weights, &before);
                }
                let sum: f64 = weights.linear().iter().sum();
                prop_assert!((sum - 1.0).abs() < 1e-12, "{sum}");
                prop_assert!((1.0 - 1e-9..5.0 + 1e-9).contains(&weights.effective_sample_size()));
            }
        }
    }
}
