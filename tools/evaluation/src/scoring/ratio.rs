//! Shares of runs and spreads of times.

use schemars::JsonSchema;
use serde::Serialize;

use super::bounds::{self, Bounds};

/// Cases that were right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, JsonSchema)]
#[serde(into = "WrittenRatio")]
pub struct Ratio {
    /// Cases that count.
    pub n: usize,
    /// Cases that were right.
    pub right: usize,
}

/// How a ratio is written.
#[derive(Serialize, JsonSchema)]
struct WrittenRatio {
    /// Cases that count.
    n: usize,
    /// Cases that were right.
    right: usize,
    /// `right` over `n`; null without a case.
    fraction: Option<f64>,
    /// Lower end of exact 95 % bounds on the fraction; null without a case.
    lower_95: Option<f64>,
    /// Upper end of the same bounds; null without a case.
    upper_95: Option<f64>,
}

impl Ratio {
    pub(super) fn add(&mut self, right: bool) {
        self.n += 1;
        self.right += usize::from(right);
    }

    /// `right / n`; `None` without a case.
    #[must_use]
    pub fn fraction(self) -> Option<f64> {
        (self.n > 0).then(|| self.right as f64 / self.n as f64)
    }

    /// Exact 95 % bounds on the fraction (Clopper and Pearson); `None` without a case.
    #[must_use]
    pub fn bounds_95(self) -> Option<Bounds> {
        bounds::binomial(self.right, self.n)
    }
}

impl From<Ratio> for WrittenRatio {
    fn from(ratio: Ratio) -> Self {
        let bounds = ratio.bounds_95();
        Self {
            n: ratio.n,
            right: ratio.right,
            fraction: ratio.fraction(),
            lower_95: bounds.map(|bounds| bounds.lower),
            upper_95: bounds.map(|bounds| bounds.upper),
        }
    }
}

/// Percentiles (nearest rank) of times, s; null without a value.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, JsonSchema)]
pub struct Spread {
    /// Number of values.
    pub n: usize,
    /// Median, s; null without a value.
    pub p50_s: Option<f64>,
    /// 90th percentile, s; null without a value.
    pub p90_s: Option<f64>,
    /// Largest, s; null without a value.
    pub max_s: Option<f64>,
}

impl Spread {
    pub(super) fn new(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let rank = |q: f64| {
            let rank = (q * values.len() as f64).ceil() as usize;
            values.get(rank.saturating_sub(1)).copied()
        };
        Self {
            n: values.len(),
            p50_s: rank(0.5),
            p90_s: rank(0.9),
            max_s: rank(1.0),
        }
    }
}
