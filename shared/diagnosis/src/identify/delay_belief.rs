//! By how much an encoder is late: a probability for each of some delays.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;
use vigil_robot::learned::past_rates::{DELAYS_S, PastRates, Rates};
use vigil_robot::learned::wheels::ExpectedRate;

/// Probability with which a delay becomes any other from one observation to the next. Once in 1.4 h
/// of 50 ms: nothing is forgotten within a fault.
const CHANGES: f64 = 1e-5;
/// Prior probability of each delay.
const EVEN: f64 = 1.0 / DELAYS_S.len() as f64;

/// Probabilities of the delays, and the rates that the wheels had.
#[derive(Debug, Clone, CheckpointValue)]
pub struct DelayBelief {
    p: [[f64; DELAYS_S.len()]; WHEELS],
    rates: PastRates,
}

impl Default for DelayBelief {
    fn default() -> Self {
        Self {
            p: [[EVEN; DELAYS_S.len()]; WHEELS],
            rates: PastRates::default(),
        }
    }
}

impl DelayBelief {
    /// Forgets everything.
    pub const fn clear(&mut self) {
        self.p = [[EVEN; DELAYS_S.len()]; WHEELS];
        self.rates.clear();
    }

    /// Keeps the rates at `t_ns`.
    pub fn keep(&mut self, t_ns: u64, rates: Rates) {
        self.rates.keep(t_ns, rates);
    }

    /// What a wheel's readings say for a late encoder, `reads` being their log-likelihood about a
    /// rate, variance and tail; None if it reads what a timely one does. `begun`: share of delays
    /// that began before. Learned from unless the wheel `is_stuck`.
    pub fn take(
        &mut self,
        wheel: usize,
        tail: f64,
        begun: f64,
        is_stuck: bool,
        reads: impl Fn(ExpectedRate) -> f64,
    ) -> Option<f64> {
        let then = self.rates.then(wheel);
        if !then.iter().any(|then| self.rates.differs(wheel, then.0)) {
            return None;
        }
        let p = self.p[wheel].map(|p| {
            let held = (1.0 - CHANGES) * p + CHANGES * EVEN;
            begun * held + (1.0 - begun) * EVEN
        });
        let logs = then.map(|(mean_rad_s, variance)| {
            reads(ExpectedRate {
                mean_rad_s,
                variance,
                tail,
            })
        });
        let largest = logs.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let joint: [f64; DELAYS_S.len()] =
            std::array::from_fn(|i| p[i] * (logs[i] - largest).exp());
        let total: f64 = joint.iter().sum();
        // No delay makes the reading possible. It teaches nothing, and a late encoder is taken to
        // read as a timely one.
        if !(total > 0.0 && largest.is_finite()) {
            return None;
        }
        if !is_stuck {
            self.p[wheel] = joint.map(|joint| joint / total);
        }
        Some(largest + total.ln())
    }

    /// Expected delay of a wheel's encoder and its standard deviation, s.
    #[must_use]
    pub fn estimate(&self, wheel: usize) -> (f64, f64) {
        let all = || self.p[wheel].iter().zip(DELAYS_S);
        let mean: f64 = all().map(|(p, delay)| p * delay).sum();
        let square: f64 = all().map(|(p, delay)| p * delay * delay).sum();
        // Between two delays of the grid any is as good. Its steps are a third, so that a cell is
        // sqrt 1.33 - 1 / sqrt 1.33 of a delay wide.
        let cell = 0.28 * mean;
        let variance = (square - mean * mean).max(0.0) + cell * cell / 12.0;
        (mean, variance.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_inference::logspace::log_normal;

    const PERIOD_NS: u64 = 50_000_000;
    const SD: f64 = 0.05;

    /// The rate at an instant, s: a step every second.
    fn rate(t_s: f64) -> f64 {
        [1.5, 2.6, 1.9, 3.1][t_s.max(0.0) as usize % 4]
    }

    #[test]
    fn a_delay_on_the_grid_is_found_and_a_constant_rate_tells_nothing() {
        let mut late = DelayBelief::default();
        let mut sum = 0.0;
        for k in 0..120_u64 {
            let t_s = k as f64 * 0.05;
            late.keep(k * PERIOD_NS, [(rate(t_s), 1e-4); WHEELS]);
            let read = rate(t_s - 0.5);
            let said = late.take(0, 0.0, 1.0, false, |expected| {
                log_normal(read - expected.mean_rad_s, expected.variance + SD * SD)
            });
            sum += said.unwrap_or(0.0) - log_normal(read - rate(t_s), SD * SD + 1e-4);
        }
        let (delay_s, sd) = late.estimate(0);
        assert!((delay_s - 0.5).abs() < 0.02 && sd < 0.05, "{delay_s} {sd}");
        assert!(sum > 100.0);
        let mut late = DelayBelief::default();
        for k in 0..100_u64 {
            late.keep(k * PERIOD_NS, [(2.0, 1e-4); WHEELS]);
            assert_eq!(late.take(0, 0.0, 0.0, false, |_| 0.0), None);
        }
    }

    #[test]
    fn without_a_reading_every_delay_is_as_likely() {
        let (mean, sd) = DelayBelief::default().estimate(3);
        let n = DELAYS_S.len() as f64;
        let expected = DELAYS_S.iter().sum::<f64>() / n;
        let square = DELAYS_S.iter().map(|delay| delay * delay).sum::<f64>() / n;
        let cell = 0.28 * expected;
        let variance = square - expected * expected + cell * cell / 12.0;
        assert!((mean - expected).abs() < 1e-12 && (sd - variance.sqrt()).abs() < 1e-12);
    }
}
