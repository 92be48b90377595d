//! Probabilities as natural logarithms.

/// `ln Σ exp(x)`. Minus infinity for an empty slice or when every term is minus infinity.
#[must_use]
pub fn log_sum_exp(values: &[f64]) -> f64 {
    let max = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !max.is_finite() {
        return max;
    }
    max + values
        .iter()
        .map(|value| (value - max).exp())
        .sum::<f64>()
        .ln()
}

/// `ln(exp(a) + exp(b))`.
#[must_use]
pub fn log_add(a: f64, b: f64) -> f64 {
    let (high, low) = if a >= b { (a, b) } else { (b, a) };
    if high.is_finite() {
        high + (low - high).exp().ln_1p()
    } else {
        high
    }
}

/// Probability behind natural log-odds.
#[must_use]
pub fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

/// Natural log-density of a normal distribution.
#[must_use]
pub fn log_normal(residual: f64, variance: f64) -> f64 {
    -0.5 * (residual * residual / variance + (std::f64::consts::TAU * variance).ln())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_survive_where_plain_exponentials_do_not() {
        let two = log_sum_exp(&[-2000.0, -2000.0]);
        assert!((two - (-2000.0 + 2.0_f64.ln())).abs() < 1e-12);
        assert_eq!(log_sum_exp(&[]), f64::NEG_INFINITY);
        assert_eq!(log_sum_exp(&[f64::NEG_INFINITY; 2]), f64::NEG_INFINITY);
        assert!((log_add(0.0, 3.0_f64.ln()) - 4.0_f64.ln()).abs() < 1e-15);
        assert_eq!(log_add(f64::NEG_INFINITY, 1.0), 1.0);
    }

    #[test]
    fn odds_and_densities_match_their_definitions() {
        assert!((probability(3.0_f64.ln()) - 0.75).abs() < 1e-15);
        assert!((probability(800.0) - 1.0).abs() < 1e-15);
        assert!((log_normal(0.0, 1.0) + 0.918_938_533_204_672_7).abs() < 1e-15);
    }
}
