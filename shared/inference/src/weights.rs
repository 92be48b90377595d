//! Weights of particles, kept as normalised logarithms.

/// Normalised weights: the logarithms and their exponentials.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    log: Vec<f64>,
    linear: Vec<f64>,
    effective: f64,
}

impl Weights {
    /// `count` equal weights, at least 1.
    #[must_use]
    pub fn equal(count: usize) -> Self {
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
    pub fn level(&mut self, count: usize) {
        let share = 1.0 / count as f64;
        self.log.resize(count, 0.0);
        self.linear.resize(count, 0.0);
        self.log.fill(share.ln());
        self.linear.fill(share);
        self.effective = count as f64;
    }

    /// Multiplies each weight by `exp(increment)` and normalises; returns the logarithm of the sum
    /// before: with log-likelihoods as increments the estimate of the evidence, whether or not the
    /// particles were resampled in the step before. None, unchanged, if nothing is left. What is
    /// not a number counts as impossible.
    pub fn absorb(&mut self, increments: &[f64]) -> Option<f64> {
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
        Some(evidence)
    }

    /// The normalised weights.
    #[must_use]
    pub fn linear(&self) -> &[f64] {
        &self.linear
    }

    /// Their logarithms.
    #[must_use]
    pub fn log(&self) -> &[f64] {
        &self.log
    }

    /// `1 / Σ W²`.
    #[must_use]
    pub const fn effective_sample_size(&self) -> f64 {
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
