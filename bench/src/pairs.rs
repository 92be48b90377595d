//! Runs in interleaved pairs, one with and one without, and what their ratio is.

/// Median of the ratios of pairs and its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MedianRatio {
    /// Median.
    pub median: f64,
    /// Ends of the interval, between two of the ratios in order.
    pub interval: [f64; 2],
    /// Its confidence, at least 0.95 where there are enough pairs.
    pub confidence: f64,
}

/// Confidence asked for.
const CONFIDENCE: f64 = 0.95;

/// Median of these ratios with the distribution-free interval between order statistics: the number
/// of ratios below the true median is binomial with one half (David and Nagaraja, *Order
/// Statistics*, section 7.1). NaN without ratios.
#[must_use]
pub fn median_ratio(ratios: &[f64]) -> MedianRatio {
    let mut sorted = ratios.to_vec();
    let median = crate::quantile(&mut sorted, 0.5);
    let n = sorted.len();
    if n == 0 {
        return MedianRatio {
            median: f64::NAN,
            interval: [f64::NAN; 2],
            confidence: 0.0,
        };
    }
    let median = if n.is_multiple_of(2) {
        f64::midpoint(sorted[n / 2 - 1], sorted[n / 2])
    } else {
        median
    };
    // Probability that fewer than k + 1 of n lie below the median.
    let mut below = 0.5_f64.powi(i32::try_from(n).unwrap_or(i32::MAX));
    let mut term = below;
    let mut confidence = 1.0 - 2.0 * below;
    let mut k = 0;
    while k + 1 < n / 2 {
        term *= (n - k) as f64 / (k + 1) as f64;
        let narrower = 1.0 - 2.0 * (below + term);
        if narrower < CONFIDENCE {
            break;
        }
        below += term;
        confidence = narrower;
        k += 1;
    }
    MedianRatio {
        median,
        interval: [sorted[k], sorted[n - 1 - k]],
        confidence,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_ten_lies_between_the_second_and_the_ninth() {
        let ratios: Vec<f64> = (1..=10).rev().map(f64::from).collect();
        let found = median_ratio(&ratios);
        assert_eq!((found.median, found.interval), (5.5, [2.0, 9.0]));
        // 1 - 2 (1 + 10) / 1024, as tables of the sign test have it.
        assert!((found.confidence - 0.978_515_625).abs() < 1e-12);
        let five = median_ratio(&[3.0, 1.0, 2.0, 5.0, 4.0]);
        assert_eq!((five.median, five.interval), (3.0, [1.0, 5.0]));
        assert!((five.confidence - 0.9375).abs() < 1e-12);
    }
}
