//! Shares and rates with their bounds.

use serde_json::{Value, json};

/// Normal quantile of a two-sided 95 % interval.
const Z: f64 = 1.959_963_985;

/// So many of so many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Share {
    /// Those that are.
    pub hits: usize,
    /// All.
    pub of: usize,
}

impl Share {
    /// The share of `items` for which `is` holds.
    pub fn of<T>(items: impl IntoIterator<Item = T>, is: impl Fn(&T) -> bool) -> Self {
        let mut share = Self::default();
        for item in items {
            share.add(is(&item));
        }
        share
    }

    /// One more.
    pub fn add(&mut self, hit: bool) {
        self.of += 1;
        self.hits += usize::from(hit);
    }

    /// The share in %; NaN of none.
    #[must_use]
    pub fn percent(&self) -> f64 {
        100.0 * self.hits as f64 / self.of as f64
    }

    /// Wilson's 95 % interval, %.
    #[must_use]
    pub fn interval_percent(&self) -> [f64; 2] {
        let (n, p) = (self.of as f64, self.hits as f64 / self.of as f64);
        let centre = p + Z * Z / (2.0 * n);
        let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        [centre - half, centre + half]
            .map(|bound| (100.0 * bound / (1.0 + Z * Z / n)).clamp(0.0, 100.0))
    }

    /// `97.5 % (80)`, or `-` of none.
    #[must_use]
    pub fn short(&self) -> String {
        match self.of {
            0 => "-".to_owned(),
            n => format!("{:.1} % ({n})", self.percent()),
        }
    }

    /// `97.5 % of 80 (95 %: 91.3 to 99.3)`.
    #[must_use]
    pub fn long(&self) -> String {
        let [low, high] = self.interval_percent();
        format!(
            "{:.1} % of {} (95 %: {low:.1} to {high:.1})",
            self.percent(),
            self.of
        )
    }

    /// Raw data.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({ "hits": self.hits, "of": self.of, "interval_percent": self.interval_percent() })
    }
}

/// Upper 95 % bound of the mean of a Poisson count of which `count` were seen.
#[must_use]
pub fn poisson_upper(count: usize) -> f64 {
    let at_most = |mean: f64| {
        let (mut term, mut sum) = ((-mean).exp(), 0.0);
        for k in 0..=count {
            sum += term;
            term *= mean / (k + 1) as f64;
        }
        sum
    };
    let (mut low, mut high) = (count as f64, 3.0 * count as f64 + 10.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if at_most(middle) > 0.05 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_the_tabulated_ones() {
        let [low, high] = Share { hits: 81, of: 263 }.interval_percent();
        // Newcombe (1998), table I.
        assert!(
            (low - 25.53).abs() < 0.01 && (high - 36.62).abs() < 0.01,
            "{low} {high}"
        );
        let [low, high] = Share { hits: 0, of: 20 }.interval_percent();
        assert!(
            low.abs() < 1e-9 && (high - 16.11).abs() < 0.01,
            "{low} {high}"
        );
        for (count, upper) in [(0, 2.996), (1, 4.744), (5, 10.513)] {
            assert!((poisson_upper(count) - upper).abs() < 1e-3);
        }
    }
}
