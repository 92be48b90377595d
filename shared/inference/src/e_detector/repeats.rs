//! E-values of a sensor that repeats its last reading exactly, as a frozen one does.
//!
//! Null: whatever the past, a reading repeats the one before with a probability of at most p. With
//! `q > p` the E-value is `q / p` for a repeat and `(1 - q) / (1 - p)` for another reading. Its
//! mean grows with the true probability, as the first is larger than the second, and is 1 at p.

/// Probability with which a frozen sensor repeats itself. Chosen: one that does not costs 4.6 nats.
const FROZEN: f64 = 0.99;

/// Natural logarithm of the E-value of so many repeats among other readings; `rate_max`: the
/// largest probability of a repeat in health, between 0 and 0.5.
#[must_use]
pub fn log_e(repeats: u32, others: u32, rate_max: f64) -> f64 {
    let rate = rate_max.clamp(1e-9, 0.5);
    f64::from(repeats) * (FROZEN / rate).ln()
        + f64::from(others) * ((1.0 - FROZEN) / (1.0 - rate)).ln()
}

#[cfg(test)]
mod tests {
    use super::log_e;

    #[test]
    fn the_mean_is_one_at_the_largest_rate_and_less_below_it() {
        let [repeat, other] = [(1, 0), (0, 1)].map(|(is, not)| log_e(is, not, 2e-3).exp());
        let mean = |rate: f64| rate * repeat + (1.0 - rate) * other;
        assert!((mean(2e-3) - 1.0).abs() < 1e-12);
        assert!(mean(1e-3) < 0.6 && mean(0.0) < 0.02 && mean(3e-3) > 1.4);
        assert!((log_e(3, 2, 2e-3).exp() / (repeat.powi(3) * other.powi(2)) - 1.0).abs() < 1e-9);
    }
}
