//! Alternative explanations of a series of measurements: a Markov chain over which one holds.
//!
//! A mixture drawn anew for every measurement would charge the true explanation the logarithm of
//! its share each time. Here, where explanations last, it is charged once.

use vigil_checkpoint::CheckpointValue;

use crate::filter::SUM_TOLERANCE;
use crate::logspace::log_sum_exp;

/// Probabilities of N explanations.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Alternatives<const N: usize> {
    p: [f64; N],
}

impl<const N: usize> Alternatives<N> {
    /// Explanations that hold with these probabilities before any measurement.
    #[must_use]
    pub const fn new(p: [f64; N]) -> Self {
        Self { p }
    }

    /// Takes a measurement with its log-likelihood under each explanation; all may be relative to
    /// one common reference. Before it each explanation replaces another with the probability
    /// `enters`, which is 0 where the measurement could not show it. Returns the log-likelihood
    /// under all together. A log-likelihood that is no number counts as impossible.
    pub fn step(&mut self, log_likelihoods: [f64; N], enters: [f64; N]) -> f64 {
        let enters = enters.map(|p| p.clamp(0.0, 1.0 / N as f64));
        let all: f64 = enters.iter().sum();
        let joint: [f64; N] = std::array::from_fn(|i| {
            let before = self.p[i] * (1.0 - all) + enters[i];
            // Bounded, so that differences stay finite.
            let joint = before.ln() + log_likelihoods[i].clamp(-1e300, 1e300);
            if joint.is_nan() {
                f64::NEG_INFINITY
            } else {
                joint
            }
        });
        let total = log_sum_exp(&joint);
        if total == f64::NEG_INFINITY {
            return 0.0;
        }
        self.p = joint.map(|joint| (joint - total).exp());
        let sum: f64 = self.p.iter().sum();
        if (sum - 1.0).abs() > SUM_TOLERANCE {
            // Beyond 1e10 nats the rounding of `total` exceeds the logarithm of a share.
            self.p = self.p.map(|p| p / sum);
        }
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHANGES: f64 = 1e-5;

    fn gained(ways: &mut Alternatives<2>, log_ratio: f64, count: usize) -> f64 {
        (0..count)
            .map(|_| ways.step([0.0, log_ratio], [CHANGES; 2]))
            .sum()
    }

    #[test]
    fn the_explanation_that_holds_costs_its_share_once_however_long_it_lasts() {
        let mut ways = Alternatives::new([0.8, 0.2]);
        let cost = gained(&mut ways, -3.0, 10_000);
        assert!((cost - 0.8_f64.ln()).abs() < 0.2, "{cost}");
        let mut ways = Alternatives::new([0.8, 0.2]);
        let gain = gained(&mut ways, 5.0, 100);
        assert!((gain - 500.0 - 0.2_f64.ln()).abs() < 0.2, "{gain}");
        // .. and a change costs its own probability once.
        let cost = gained(&mut ways, -3.0, 10_000);
        assert!((cost - CHANGES.ln()).abs() < 4.0, "{cost}");
    }

    #[test]
    fn the_chain_is_the_bayes_filter() {
        let mut ways = Alternatives::new([1.0 / 3.0; 3]);
        let mut p = [1.0 / 3.0; 3];
        let mut gained = 0.0;
        for reading in [
            [1.0, 0.0, -2.0],
            [-2.0, 0.5, 0.1],
            [0.5, -1.0, 3.0],
            [-1.0_f64, 3.0, 0.0],
        ] {
            gained += ways.step(reading, [0.1; 3]);
            let [a, b, c] = p;
            p = [
                0.8 * a + 0.1 * (b + c),
                0.8 * b + 0.1 * (a + c),
                0.8 * c + 0.1 * (a + b),
            ];
            p.iter_mut()
                .zip(reading)
                .for_each(|(p, log)| *p *= log.exp());
            assert!((gained - f64::ln(p.iter().sum())).abs() < 1e-12);
        }
    }

    #[test]
    fn an_explanation_that_nothing_would_show_is_no_refuge() {
        let lost = |enters| {
            let mut ways = Alternatives::new([1.0, 0.0]);
            (0..50).map(|_| ways.step([-3.0, 0.0], enters)).sum::<f64>()
        };
        // The second says the same as health: what enters it is never lost.
        assert!(lost([1e-3; 2]) > -10.0);
        assert!((lost([1e-3, 0.0]) + 150.0).abs() < 1e-9);
    }

    #[test]
    fn explanations_that_are_both_beyond_rounding_share_the_belief() {
        let mut ways = Alternatives::new([0.5; 2]);
        ways.step([1e300; 2], [0.0; 2]);
        assert_eq!(ways.p, [0.5; 2]);
    }

    #[test]
    fn no_measurement_makes_it_less_than_a_number() {
        for ratio in [f64::NAN, 1e300, -1e300, f64::INFINITY, f64::NEG_INFINITY] {
            let mut ways = Alternatives::new([0.5; 2]);
            for _ in 0..10 {
                assert!(!ways.step([0.0, ratio], [1e-3; 2]).is_nan());
                assert!(crate::filter::is_distribution(&ways.p));
            }
            assert!(ways.step([0.0; 2], [1e-3; 2]).is_finite());
            assert_eq!(ways.step([f64::NAN; 2], [1e-3; 2]), 0.0);
        }
    }
}
