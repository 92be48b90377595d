//! Means with intervals, and paired differences.

use statrs::distribution::{ContinuousCDF, StudentsT};

/// Of what many missions brought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// Mean.
    pub mean: f64,
    /// The mean's 95 % interval is `mean` +- this (Student); not finite for fewer than two values.
    pub half_width: f64,
    /// Median.
    pub median: f64,
    /// One in twenty is at most this: the 5 % quantile, a value that occurred.
    pub worst_5_percent: f64,
}

impl Summary {
    /// Sorts `values`. All fields are NaN without any.
    #[must_use]
    pub fn new(values: &mut [f64]) -> Self {
        let (mean, half_width) = mean_and_half_width(values);
        values.sort_unstable_by(f64::total_cmp);
        let count = values.len();
        let at = |index: usize| values.get(index).copied().unwrap_or(f64::NAN);
        Self {
            mean,
            half_width,
            median: (at(count / 2) + at(count.saturating_sub(1) / 2)) / 2.0,
            worst_5_percent: at(count.div_ceil(20).saturating_sub(1)),
        }
    }
}

/// Of the differences between two agents, mission by mission.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairedDifference {
    /// Mean of the differences.
    pub difference: f64,
    /// Its 95 % interval is `difference` +- this (Student).
    pub half_width: f64,
    /// Probability of a difference as far from 0, either way, were there none (paired t-test); 1
    /// if all differences are 0.
    pub p: f64,
}

impl PairedDifference {
    /// `ours` minus `theirs`, of the same missions in the same order.
    #[must_use]
    pub fn new(ours: &[f64], theirs: &[f64]) -> Self {
        let differences: Vec<f64> = ours.iter().zip(theirs).map(|(a, b)| a - b).collect();
        let (difference, half_width) = mean_and_half_width(&differences);
        let error = standard_error(&differences, difference);
        let t = (difference / error).abs();
        let p = if t.is_nan() {
            1.0
        } else if t.is_infinite() {
            0.0
        } else {
            student(differences.len()).map_or(f64::NAN, |student| 2.0 * student.sf(t))
        };
        Self {
            difference,
            half_width,
            p,
        }
    }
}

fn mean_and_half_width(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let quantile = student(values.len()).map_or(f64::NAN, |student| student.inverse_cdf(0.975));
    (mean, quantile * standard_error(values, mean))
}

fn standard_error(values: &[f64], mean: f64) -> f64 {
    let count = values.len() as f64;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (squares / (count - 1.0) / count).sqrt()
}

fn student(count: usize) -> Option<StudentsT> {
    StudentsT::new(0.0, 1.0, count as f64 - 1.0).ok()
}
