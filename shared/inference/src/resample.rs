//! Resampling: which particles go on, and how often.
//!
//! Every scheme is unbiased: particle `i` has `n·W_i` offspring in the mean, `n` the number of
//! ancestors asked for. They differ in the variance around it; systematic resampling has the
//! least and is the default. See Douc, Cappé and Moulines, *Comparison of Resampling Schemes for
//! Particle Filtering* (2005).

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// How offspring are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scheme {
    /// One uniform draw shifts an even comb over the cumulative weights.
    #[default]
    Systematic,
    /// One uniform draw in each tooth's interval.
    Stratified,
    /// `floor(n·W)` copies of each; the rest drawn by stratified resampling of what is left over.
    Residual,
    /// Independent draws: the most variance, for comparison.
    Multinomial,
}

/// When to resample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resampling {
    /// How.
    pub scheme: Scheme,
    /// Resample when the effective sample size falls below this share of the particles, 0 to 1;
    /// 1 resamples in every step.
    pub threshold: f64,
}

impl Default for Resampling {
    fn default() -> Self {
        Self {
            scheme: Scheme::Systematic,
            // The customary one: resampling adds noise, too.
            threshold: 0.5,
        }
    }
}

impl Resampling {
    /// Systematic, in every step.
    pub const EVERY_STEP: Self = Self {
        scheme: Scheme::Systematic,
        threshold: 1.0,
    };
}

impl Scheme {
    /// Fills `ancestors` with indices into `weights`, in ascending order; their number may differ
    /// from that of the weights. `spare` is room for `weights.len()` numbers.
    ///
    /// Weights are non-negative and need not be normalised. Exactly as many offspring as asked
    /// for, never out of range, whatever the rounding. False, with `ancestors[i] = i` modulo the
    /// number of weights, if their sum is not finite and positive.
    pub fn resample(
        self,
        weights: &[f64],
        spare: &mut [f64],
        ancestors: &mut [u32],
        rng: &mut Pcg64Mcg,
    ) -> bool {
        match self {
            Self::Systematic => systematic(weights, rng.random(), ancestors),
            Self::Stratified => comb(weights, ancestors, |i| i as f64 + rng.random::<f64>()),
            Self::Residual => residual(weights, spare, ancestors, rng),
            Self::Multinomial => {
                // Ordered uniforms without sorting: each is the least of those that are left.
                let count = ancestors.len() as f64;
                let mut at = 0.0;
                comb(weights, ancestors, |i| {
                    let left = count - i as f64;
                    let gap = 1.0 - rng.random::<f64>().powf(1.0 / left);
                    at += (count - at) * gap;
                    at
                })
            }
        }
    }
}

/// Systematic resampling with the uniform draw `u` in [0, 1): particle `i` occurs
/// `ceil(n·C_i - u) - ceil(n·C_{i-1} - u)` times, `C` the cumulative normalised weights: each count
/// is within one of `n·W_i`. See [`Scheme::resample`].
pub fn systematic(weights: &[f64], u: f64, ancestors: &mut [u32]) -> bool {
    let count = ancestors.len();
    let total: f64 = weights.iter().sum();
    if !(total.is_finite() && total > 0.0) {
        return keep(weights.len(), ancestors);
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
    ancestors[next..].fill(last as u32);
    true
}

/// Places ancestor `i` where the ascending `position(i)`, 0 to n, falls in the cumulative weights.
fn comb(weights: &[f64], ancestors: &mut [u32], mut position: impl FnMut(usize) -> f64) -> bool {
    let total: f64 = weights.iter().sum();
    if !(total.is_finite() && total > 0.0) {
        return keep(weights.len(), ancestors);
    }
    let scale = ancestors.len() as f64 / total;
    let (mut j, mut last) = (0, 0);
    let mut sum = 0.0;
    for (i, ancestor) in ancestors.iter_mut().enumerate() {
        let at = position(i);
        while j < weights.len() && sum <= at {
            sum += weights[j].max(0.0) * scale;
            if weights[j] > 0.0 {
                last = j;
            }
            j += 1;
        }
        *ancestor = last as u32;
    }
    true
}

fn residual(weights: &[f64], spare: &mut [f64], ancestors: &mut [u32], rng: &mut Pcg64Mcg) -> bool {
    let total: f64 = weights.iter().sum();
    let count = ancestors.len();
    if !(total.is_finite() && total > 0.0) || spare.len() < weights.len() {
        return keep(weights.len(), ancestors);
    }
    let scale = count as f64 / total;
    let mut next = 0;
    for (i, (weight, left)) in weights.iter().zip(spare.iter_mut()).enumerate() {
        let share = weight.max(0.0) * scale;
        let whole = (share.floor() as usize).min(count - next);
        ancestors[next..next + whole].fill(i as u32);
        next += whole;
        *left = share - share.floor();
    }
    let first = ancestors.first().copied().unwrap_or(0);
    let rest = &mut ancestors[next..];
    let position = |i: usize| i as f64 + rng.random::<f64>();
    if !rest.is_empty() && !comb(&spare[..weights.len()], rest, position) {
        // Rounding alone kept the shares from adding up.
        rest.fill(first);
    }
    ancestors.sort_unstable();
    true
}

fn keep(count: usize, ancestors: &mut [u32]) -> bool {
    for (i, ancestor) in ancestors.iter_mut().enumerate() {
        *ancestor = (i % count.max(1)) as u32;
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::SeedableRng;

    const SCHEMES: [Scheme; 4] = [
        Scheme::Systematic,
        Scheme::Stratified,
        Scheme::Residual,
        Scheme::Multinomial,
    ];

    #[test]
    fn systematic_counts_are_exact() {
        // n C = .4, 2, 2, 3.2, 4 with u = .5: ceil(n C - u) = 0, 2, 2, 3, 4.
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
    fn impossible_weights_keep_every_particle() {
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        for scheme in SCHEMES {
            for weights in [[0.0; 3], [f64::NAN, 1.0, 1.0], [f64::INFINITY, 1.0, 1.0]] {
                let mut ancestors = [9; 3];
                assert!(!scheme.resample(&weights, &mut [0.0; 3], &mut ancestors, &mut rng));
                assert_eq!(ancestors, [0, 1, 2]);
            }
        }
    }

    #[test]
    fn every_scheme_is_unbiased_and_systematic_has_the_least_variance() {
        let weights = [0.03, 0.0, 0.33, 0.17, 0.47];
        let (count, rounds) = (20, 20_000);
        let mut variance = [0.0; 4];
        for (scheme, variance) in SCHEMES.into_iter().zip(&mut variance) {
            let mut rng = Pcg64Mcg::seed_from_u64(3);
            let mut sums = [[0.0; 2]; 5];
            let mut ancestors = vec![0; count];
            for _ in 0..rounds {
                assert!(scheme.resample(&weights, &mut [0.0; 5], &mut ancestors, &mut rng));
                for (i, sum) in sums.iter_mut().enumerate() {
                    let n = ancestors.iter().filter(|&&a| a as usize == i).count() as f64;
                    (sum[0], sum[1]) = (sum[0] + n, sum[1] + n * n);
                }
            }
            for (sum, weight) in sums.iter().zip(weights) {
                let (mean, square) = (sum[0] / f64::from(rounds), sum[1] / f64::from(rounds));
                let expected = weight * count as f64;
                assert!(
                    (mean - expected).abs() < 0.06,
                    "{scheme:?}: {mean} not {expected}"
                );
                *variance += square - mean * mean;
            }
        }
        let [systematic, stratified, residual, multinomial] = variance;
        assert!(
            systematic < stratified && stratified < multinomial,
            "{variance:?}"
        );
        // Systematic: each count is one of two neighbours.
        assert!((systematic - 0.96).abs() < 0.02 && (stratified - 1.28).abs() < 0.03);
        assert!(residual < multinomial);
        // Multinomial: n W (1 - W) summed.
        let expected: f64 = weights.iter().map(|w| 20.0 * w * (1.0 - w)).sum();
        assert!((multinomial / expected - 1.0).abs() < 0.03);
    }

    proptest! {
        #[test]
        fn systematic_offspring_are_within_one_of_their_share(
            weights in prop::collection::vec(0.0..1.0_f64, 1..200), u in 0.0..1.0_f64,
        ) {
            prop_assume!(weights.iter().sum::<f64>() > 0.0);
            let n = weights.len();
            let mut ancestors = vec![u32::MAX; n];
            prop_assert!(systematic(&weights, u, &mut ancestors));
            let total: f64 = weights.iter().sum();
            for (i, weight) in weights.iter().enumerate() {
                let count = ancestors.iter().filter(|&&a| a as usize == i).count() as f64;
                prop_assert!((count - weight / total * n as f64).abs() <= 1.0 + 1e-9);
            }
            prop_assert!(ancestors.iter().all(|&a| (a as usize) < n));
        }

        #[test]
        fn no_scheme_leaves_the_range_or_gives_offspring_to_the_impossible(
            weights in prop::collection::vec(prop_oneof![Just(0.0), 1e-300..1.0_f64], 1..60),
            count in 1_usize..80, seed in any::<u64>(),
        ) {
            prop_assume!(weights.iter().sum::<f64>() > 0.0);
            let mut rng = Pcg64Mcg::seed_from_u64(seed);
            let mut spare = vec![0.0; weights.len()];
            for scheme in SCHEMES {
                let mut ancestors = vec![u32::MAX; count];
                prop_assert!(scheme.resample(&weights, &mut spare, &mut ancestors, &mut rng));
                for ancestor in &ancestors {
                    prop_assert!(weights[*ancestor as usize] > 0.0, "{scheme:?}");
                }
                prop_assert!(ancestors.is_sorted());
            }
        }
    }
}
