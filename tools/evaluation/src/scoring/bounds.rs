//! How far a figure from so many runs can be trusted: exact 95 % bounds.
//!
//! Counts over a time have Poisson bounds (Garwood 1936), shares of runs binomial ones (Clopper
//! and Pearson 1934): both cover the truth in at least 95 % of all repetitions, also with no
//! event or no failure at all, where approximations by a normal distribution fail.

use schemars::JsonSchema;
use serde::Serialize;
use statrs::distribution::{Beta, ContinuousCDF, Gamma, StudentsT};

/// Probability outside on either side.
const TAIL: f64 = 0.025;

/// An interval that covers the true value with at least 95 %, in the unit of the value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

/// Bounds on the expected number of events where `events` were seen (Garwood: quantiles of the
/// gamma distribution, which are half those of the chi-square one).
#[must_use]
pub fn poisson(events: usize) -> Bounds {
    let quantile =
        |shape: f64, p: f64| Gamma::new(shape, 1.0).map_or(f64::NAN, |gamma| gamma.inverse_cdf(p));
    let k = events as f64;
    Bounds {
        lower: if events == 0 { 0.0 } else { quantile(k, TAIL) },
        upper: quantile(k + 1.0, 1.0 - TAIL),
    }
}

/// Bounds on a probability of which `right` of `n` were seen (Clopper and Pearson); `None`
/// without a case.
#[must_use]
pub fn binomial(right: usize, n: usize) -> Option<Bounds> {
    if n == 0 || right > n {
        return None;
    }
    let quantile =
        |a: f64, b: f64, p: f64| Beta::new(a, b).map_or(f64::NAN, |beta| beta.inverse_cdf(p));
    let (k, rest) = (right as f64, (n - right) as f64);
    Some(Bounds {
        lower: if right == 0 {
            0.0
        } else {
            quantile(k, rest + 1.0, TAIL)
        },
        upper: if right == n {
            1.0
        } else {
            quantile(k + 1.0, rest, 1.0 - TAIL)
        },
    })
}

/// A difference between two filters over the same runs, with 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Difference {
    /// Runs that count for both.
    pub n: usize,
    /// Mean difference, in the unit of the values.
    pub mean: f64,
    /// Lower bound of the mean difference.
    pub lower_95: f64,
    /// Upper bound of the mean difference.
    pub upper_95: f64,
}

impl Difference {
    /// Of shares of runs: `gained` were right with the first filter alone, `lost` with the second
    /// alone, of `n`. Bounds after Agresti and Min (2005): half a run is added to each cell of the
    /// two-by-two table, so that filters which agree in every run have an interval too. `None`
    /// without a run.
    #[must_use]
    pub fn of_shares(gained: usize, lost: usize, n: usize) -> Option<Self> {
        if n == 0 {
            return None;
        }
        let (gained, lost) = (gained as f64, lost as f64);
        let (more, fewer, of) = (gained + 0.5, lost + 0.5, n as f64 + 2.0);
        let centre = (more - fewer) / of;
        let variance = (more + fewer - (more - fewer) * (more - fewer) / of) / of;
        let half = 1.959_963_984_540_054 * (variance / of).sqrt();
        Some(Self {
            n,
            mean: (gained - lost) / n as f64,
            lower_95: (centre - half).max(-1.0),
            upper_95: (centre + half).min(1.0),
        })
    }

    /// Of numbers: mean of the differences of pairs, bounds by Student's distribution. `None` with
    /// fewer than two pairs.
    #[must_use]
    pub fn of_numbers(pairs: &[f64]) -> Option<Self> {
        if pairs.len() < 2 {
            return None;
        }
        let n = pairs.len() as f64;
        let mean = pairs.iter().sum::<f64>() / n;
        let squares: f64 = pairs.iter().map(|d| (d - mean) * (d - mean)).sum();
        let student = StudentsT::new(0.0, 1.0, n - 1.0).ok()?;
        let half = student.inverse_cdf(1.0 - TAIL) * (squares / (n - 1.0) / n).sqrt();
        Some(Self {
            n: pairs.len(),
            mean,
            lower_95: mean - half,
            upper_95: mean + half,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: f64, wanted: f64, slack: f64) {
        assert!((found - wanted).abs() <= slack, "{found} is not {wanted}");
    }

    #[test]
    fn counts_have_the_bounds_of_the_printed_tables() {
        // Garwood's limits, as in Pearson and Hartley, Biometrika Tables I, table 40.
        for (events, lower, upper) in [
            (0, 0.0, 3.689),
            (1, 0.0253, 5.572),
            (2, 0.242, 7.225),
            (5, 1.623, 11.668),
            (10, 4.795, 18.390),
            (20, 12.217, 30.888),
            (50, 37.11, 65.92),
        ] {
            let found = poisson(events);
            let slack = if events == 50 { 5e-3 } else { 5.1e-4 };
            near(found.lower, lower, slack);
            near(found.upper, upper, slack);
        }
        // Without an event the upper limit is -ln 0.025.
        near(poisson(0).upper, -TAIL.ln(), 1e-8);
    }

    #[test]
    fn shares_have_the_bounds_of_clopper_and_pearson() {
        // All or none of n: 0.025^(1/n).
        for n in [1, 10, 120, 100_000] {
            let all = binomial(n, n).unwrap();
            near(all.lower, TAIL.powf(1.0 / n as f64), 1e-8);
            assert!((all.upper - 1.0).abs() < f64::EPSILON);
            let none = binomial(0, n).unwrap();
            near(none.upper, 1.0 - TAIL.powf(1.0 / n as f64), 1e-8);
            assert!(none.lower.abs() < f64::EPSILON);
        }
        // Printed tables: 1 of 10, 5 of 10, 10 of 100.
        for (right, n, lower, upper) in [
            (1, 10, 0.0025, 0.4450),
            (5, 10, 0.1871, 0.8129),
            (10, 100, 0.0490, 0.1762),
        ] {
            let found = binomial(right, n).unwrap();
            near(found.lower, lower, 5.1e-5);
            near(found.upper, upper, 5.1e-5);
        }
        assert!(binomial(0, 0).is_none() && binomial(2, 1).is_none());
    }

    #[test]
    fn bounds_cover_the_truth_often_enough() {
        // The definition: at the lower bound, so many or more have 2.5 %; at the upper, so many or
        // fewer.
        let (right, n) = (131_usize, 138_usize);
        let bounds = binomial(right, n).unwrap();
        let weight = |p: f64, range: std::ops::RangeInclusive<usize>| {
            let term = |k: usize| {
                let choose: f64 = (1..=k).map(|i| ((n - k + i) as f64 / i as f64).ln()).sum();
                (choose + k as f64 * p.ln() + (n - k) as f64 * (1.0 - p).ln()).exp()
            };
            range.map(term).sum::<f64>()
        };
        near(weight(bounds.lower, right..=n), TAIL, 1e-7);
        near(weight(bounds.upper, 0..=right), TAIL, 1e-7);
    }

    #[test]
    fn differences_are_those_of_pairs() {
        // 8 gained, 2 lost, of 100: Agresti and Min by hand.
        let found = Difference::of_shares(8, 2, 100).unwrap();
        near(found.mean, 0.06, 1e-12);
        let half = 1.959_964 * ((11.0 - 36.0 / 102.0) / 102.0_f64.powi(2)).sqrt();
        near(found.lower_95, 6.0 / 102.0 - half, 1e-6);
        near(found.upper_95, 6.0 / 102.0 + half, 1e-6);
        let equal = Difference::of_shares(0, 0, 138).unwrap();
        assert!(equal.lower_95 < 0.0 && equal.upper_95 > 0.0);
        assert!(Difference::of_shares(0, 0, 0).is_none());

        // Student's 97.5 % quantile of 4 degrees of freedom is 2.776.
        let found = Difference::of_numbers(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        near(found.mean, 3.0, 1e-12);
        near(found.upper_95 - 3.0, 2.776_445 * 0.5_f64.sqrt(), 1e-5);
        assert!(Difference::of_numbers(&[1.0]).is_none());
    }
}
