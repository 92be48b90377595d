//! A mean with its interval.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};

use crate::quantile;

/// Resamples of a bootstrap.
const RESAMPLES: usize = 10_000;

/// Mean of `values`, with the ends of its 95 % interval by a bootstrap over them; NaN if there are
/// none.
#[must_use]
pub fn bootstrap(values: &[f64]) -> [f64; 3] {
    if values.is_empty() {
        return [f64::NAN; 3];
    }
    let count = values.len();
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut resample = || {
        (0..count)
            .map(|_| values[rng.random_range(0..count)])
            .sum::<f64>()
    };
    let mut means: Vec<f64> = (0..RESAMPLES).map(|_| resample() / count as f64).collect();
    let [low, high] = [0.025, 0.975].map(|q| quantile(&mut means, q));
    [values.iter().sum::<f64>() / count as f64, low, high]
}

/// A mean with the half width of its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Mean.
    pub mean: f64,
    /// Half width.
    pub half_width: f64,
}

impl Interval {
    /// The lower end.
    pub(crate) fn lower(self) -> f64 {
        self.mean - self.half_width
    }

    pub(crate) fn text(self, decimals: usize, is_difference: bool) -> String {
        let Self { mean, half_width } = self;
        match is_difference {
            true => format!("{mean:+.decimals$} ± {half_width:.decimals$}"),
            false => format!("{mean:.decimals$} ± {half_width:.decimals$}"),
        }
    }

    pub(crate) fn document(self) -> Value {
        json!({"mean": self.mean, "half_width_95": self.half_width})
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bootstrap_holds_the_mean_and_narrows_with_the_values() {
        let [mean, low, high] = bootstrap(&[1.0, 2.0, 3.0, 6.0]);
        assert!((mean - 3.0).abs() < 1e-12 && low < mean && mean < high);
        assert_eq!(bootstrap(&[2.0; 5]), [2.0; 3]);
        let many: Vec<f64> = (0..400).map(|k| f64::from(k % 4)).collect();
        let [_, low, high] = bootstrap(&many);
        assert!(high - low < 0.3, "{low} to {high}");
        assert!(bootstrap(&[])[0].is_nan());
    }
}
