//! Systematic resampling: which particles go on, and how often.
//!
//! Particle `i` has `n·W_i` offspring in the mean, `n` the number of ancestors asked for. Of the
//! usual schemes this one has the least variance around that mean (Douc, Cappé and Moulines,
//! *Comparison of Resampling Schemes for Particle Filtering*, 2005).

/// When to resample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resampling {
    /// Resample when the effective sample size falls below this share of the particles, 0 to 1;
    /// 1 resamples in every step.
    pub threshold: f64,
}

impl Default for Resampling {
    /// Below half of the particles: the customary threshold (Doucet and Johansen, *A Tutorial on
    /// Particle Filtering and Smoothing*, 2009). Resampling itself adds noise.
    fn default() -> Self {
        Self { threshold: 0.5 }
    }
}

impl Resampling {
    /// Resample in every step.
    pub const EVERY_STEP: Self = Self { threshold: 1.0 };

    /// True if `count` particles with this effective sample size are to be resampled.
    pub(crate) fn is_due(self, effective_sample_size: f64, count: usize) -> bool {
        // Equal weights are not below the threshold of 1, which resamples them all the same.
        effective_sample_size < self.threshold * count as f64 || self.threshold >= 1.0
    }
}

/// Fills `ancestors` with indices into `weights`, in ascending order, by the uniform draw `u` in
/// [0, 1). Particle `i` occurs `ceil(n·C_i - u) - ceil(n·C_{i-1} - u)` times, `C` the cumulative
/// normalised weights: each count is within one of `n·W_i`.
///
/// Weights need not be normalised. False, and `ancestors` unchanged, if their sum is not finite and
/// positive.
pub(crate) fn systematic(weights: &[f64], u: f64, ancestors: &mut [u32]) -> bool {
    let count = ancestors.len();
    let total: f64 = weights.iter().sum();
    if !(total.is_finite() && total > 0.0) {
        return false;
    }
    let scale = count as f64 / total;
    let (mut sum, mut next, mut last) = (0.0, 0, 0);
    for (i, weight) in weights.iter().enumerate() {
        sum += weight.max(0.0);
        let boundary = ((sum * scale - u).ceil().max(0.0) as usize).min(count);
        if boundary > next {
            ancestors[next..boundary].fill(i as u32);
            (next, last) = (boundary, i);
        }
    }
    // Rounding may leave the last boundary below the count.
    ancestors[next..].fill(last as u32);
    assert_sound(ancestors, weights.len());
    true
}

fn assert_sound(ancestors: &[u32], particles: usize) {
    let is_in_range = ancestors.last().is_none_or(|&i| (i as usize) < particles);
    assert!(
        is_in_range && ancestors.is_sorted(),
        "ancestors are particles, in ascending order"
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn counts_are_exact() {
        // n C = .4, 2, 3.2, 4 with u = .5: ceil(n C - u) = 0, 2, 3, 4.
        let mut ancestors = [9; 4];
        assert!(systematic(&[0.1, 0.4, 0.3, 0.2], 0.5, &mut ancestors));
        assert_eq!(ancestors, [1, 1, 2, 3]);
        assert!(systematic(&[0.0, 0.0, 5.0, 0.0], 0.999, &mut ancestors));
        assert_eq!(ancestors, [2; 4]);
        let mut more = [9; 8];
        assert!(systematic(&[0.25, 0.75], 0.5, &mut more));
        assert_eq!(more, [0, 0, 1, 1, 1, 1, 1, 1]);
    }

    #[test]
    fn impossible_weights_change_nothing() {
        for weights in [[0.0; 3], [f64::NAN, 1.0, 1.0], [f64::INFINITY, 1.0, 1.0]] {
            let mut ancestors = [9; 3];
            assert!(!systematic(&weights, 0.5, &mut ancestors));
            assert_eq!(ancestors, [9; 3]);
        }
    }

    #[test]
    fn it_is_due_below_the_threshold_or_in_every_step() {
        assert!(Resampling::default().is_due(49.9, 100));
        assert!(!Resampling::default().is_due(50.0, 100));
        assert!(Resampling::EVERY_STEP.is_due(100.0, 100));
        assert!(!Resampling { threshold: 0.99 }.is_due(100.0, 100));
    }

    #[test]
    fn it_is_unbiased_and_each_count_is_one_of_two_neighbours() {
        let weights = [0.03, 0.0, 0.33, 0.17, 0.47];
        let rounds = 20_000;
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        let (mut sums, mut squares) = ([0.0; 5], [0.0; 5]);
        let mut ancestors = [0; 20];
        for _ in 0..rounds {
            assert!(systematic(&weights, rng.random(), &mut ancestors));
            for i in 0..5 {
                let n = ancestors.iter().filter(|&&a| a as usize == i).count() as f64;
                (sums[i], squares[i]) = (sums[i] + n, squares[i] + n * n);
            }
        }
        for i in 0..5 {
            let mean = sums[i] / f64::from(rounds);
            let expected = 20.0 * weights[i];
            assert!((mean - expected).abs() < 0.06, "{mean}, not {expected}");
            // Two neighbours with the mean between them: f (1 - f), f its fraction.
            let variance = squares[i] / f64::from(rounds) - mean * mean;
            let fraction = expected - expected.floor();
            assert!((variance - fraction * (1.0 - fraction)).abs() < 0.02);
        }
    }

    #[test]
    #[should_panic(expected = "ancestors are particles, in ascending order")]
    fn an_ancestor_that_is_no_particle_is_caught() {
        assert_sound(&[0, 1, 3], 3);
    }

    #[test]
    #[should_panic(expected = "ancestors are particles, in ascending order")]
    fn ancestors_out_of_order_are_caught() {
        assert_sound(&[1, 0, 2], 3);
    }

    proptest! {
        #[test]
        fn offspring_are_within_one_of_their_share_and_none_of_the_impossible(
            weights in prop::collection::vec(prop_oneof![Just(0.0), 1e-300..1.0_f64], 1..60),
            count in 1_usize..80,
            u in 0.0..1.0_f64,
        ) {
            let total: f64 = weights.iter().sum();
            prop_assume!(total > 0.0);
            let mut ancestors = vec![u32::MAX; count];
            prop_assert!(systematic(&weights, u, &mut ancestors));
            for (i, weight) in weights.iter().enumerate() {
                let found = ancestors.iter().filter(|&&a| a as usize == i).count();
                let share = weight / total * count as f64;
                prop_assert!((found as f64 - share).abs() <= 1.0 + 1e-9);
                prop_assert!(found == 0 || *weight > 0.0);
            }
        }
    }
}
