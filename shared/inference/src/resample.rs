//! Systematic resampling.

/// Fills `ancestors` so that particle `i` occurs `ceil(N·C_i - u) - ceil(N·C_{i-1} - u)` times, `C`
/// the cumulative normalised weights and `u` in `[0, 1)` one uniform draw: each count is within one
/// of `N·W_i`.
///
/// `weights` and `ancestors` have the same length N; weights are non-negative and need not be
/// normalised. Exactly N offspring, never out of range, whatever the rounding. Returns false and
/// leaves each particle its own ancestor if the sum of the weights is not finite and positive.
pub fn systematic(weights: &[f64], u: f64, ancestors: &mut [u32]) -> bool {
    let count = weights.len().min(ancestors.len());
    let total: f64 = weights[..count].iter().sum();
    if !(total.is_finite() && total > 0.0) {
        for (i, ancestor) in ancestors.iter_mut().enumerate() {
            *ancestor = i as u32;
        }
        return false;
    }
    let scale = count as f64 / total;
    let (mut sum, mut next, mut last) = (0.0, 0, 0);
    for (i, weight) in weights[..count].iter().enumerate() {
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::systematic;
    use proptest::prelude::*;

    #[test]
    fn counts_are_exact() {
        // N C = .4, 2, 2, 3.2, 4 with u = .5: ceil(N C - u) = 0, 2, 2, 3, 4.
        let mut ancestors = [9; 4];
        assert!(systematic(&[0.1, 0.4, 0.3, 0.2], 0.5, &mut ancestors));
        assert_eq!(ancestors, [1, 1, 2, 3]);
        assert!(systematic(&[0.0, 0.0, 5.0, 0.0], 0.999, &mut ancestors));
        assert_eq!(ancestors, [2; 4]);
    }

    #[test]
    fn impossible_weights_keep_every_particle() {
        let mut ancestors = [9; 3];
        for weights in [[0.0; 3], [f64::NAN, 1.0, 1.0], [f64::INFINITY, 1.0, 1.0]] {
            assert!(!systematic(&weights, 0.5, &mut ancestors));
            assert_eq!(ancestors, [0, 1, 2]);
        }
    }

    proptest! {
        #[test]
        fn offspring_are_within_one_of_their_share(
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
    }
}
