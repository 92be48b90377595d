//! E-detectors (Shin, Ramdas, Rinaldo, *E-detectors: a nonparametric framework for sequential
//! change detection*, 2024): the mean time between false alarms has a proof, not a calibration.
//!
//! **Theorem.** Let `E_t >= 0` be known after reading t, with
//!
//! ```text
//! E[E_t | F_(t-1)] <= 1    under every law of the null, after every past F_(t-1)       (1)
//! M_t = E_t (M_(t-1) + h_t),  M_0 = 0                                                  (2)
//! ```
//!
//! where `h_t` is the time since reading t - 1, known before reading t. The alarm rises at the
//! first t with `M_t >= H`. Then under every law of the null the mean time to it is at least H, and
//! the mean number of alarms within a time x, where M begins at 0 again after each, at most x / H.
//!
//! *Proof.* By (1) `E[M_t | F_(t-1)] <= M_(t-1) + h_t`: with `A_t = h_1 + .. + h_t`, the time so
//! far, `M_t - A_t` is a supermartingale that begins at 0. For the alarm T and any horizon n, by
//! optional stopping, `H P(T <= n) <= E[M at min(T, n)] <= E[A at min(T, n)] <= E[A_T]`; let n
//! grow. If T may never come, its mean is infinite. After an alarm the same holds given all that
//! was before, as (1) holds after every past. So each alarm before x pays H of the x. ∎
//!
//! A weighted mean of detectors with (2) has it too, as only expectations are summed: they may even
//! depend on each other. So many alternatives may stand side by side: each costs the logarithm of
//! its weight in delay, none costs a false alarm. All must know the *same* past: where one of them
//! takes its readings in blocks, it must say less in between ([`path`]). Lowering an `E_t` keeps
//! (1); what lies below a process with (2) may raise the alarm in its place.
//!
//! **E-values.** A ratio of two Bayes mixtures has (1) on average over its prior, not for each law.
//! Here each numerator is a Gaussian shift, and the denominator the law of the null that lies
//! nearest to it (the reverse projection): [`level`] for readings that each stand for themselves,
//! [`path`] for positions, whose drift shows over many readings, [`repeats`] for a sensor that
//! repeats itself. For noise e, given the past, with `E exp(x e) <= exp(x² s² / 2)` for all x
//! (Gaussian of a deviation of s or less, or any other that is *sub-Gaussian* with s), a context
//! that shifts the mean to u at most, and any tilt `θ >= 0`,
//!
//! ```text
//! E = exp(θ (r - u) / s - θ² / 2) <= exp(θ e / s - θ² / 2),  as r <= u + e             (3)
//! ```
//!
//! holds reading by reading, whatever the context does and whoever chooses it: it may know the
//! past. The right side has mean 1 or less. The deviation is bounded above alone: less noise is
//! allowed for free. The nearest law to a Gaussian about m > u with the deviation s has the mean u
//! and the same deviation, and the ratio of the two is (3) with `θ = (m - u) / s`: no other valid
//! E-value of this alternative grows faster.
//!
//! **What is not covered**: noise whose tails are heavier than those of a Gaussian with s, an
//! outlier, a context beyond its bound. Nothing is promised there, and nothing is learned of it:
//! there are no states that follow the ground, which a proof would have to follow too.

use vigil_checkpoint::CheckpointValue;

pub mod level;
pub mod path;
pub mod repeats;

/// Largest time that a detector holds, h. An alarm needs its promise over the detector's weight:
/// 1e4 h, the longest that settings take, and one of a thousand detectors. More is not held, so
/// that the end of a fault is seen within 18 nats; holding less breaks no promise.
const HOURS_MAX: f64 = 1e8;

/// One detector of the Shiryaev-Roberts kind: recurrence (2).
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub struct EDetector {
    hours: f64,
}

impl EDetector {
    /// M, h: an alarm at H hours or more has at least H hours to it in the mean.
    #[must_use]
    pub const fn hours(&self) -> f64 {
        self.hours
    }

    /// Takes the natural logarithm of an E-value and the time since the last one, h. What is no
    /// number says nothing, and counts no time.
    pub fn step(&mut self, log_e: f64, elapsed_h: f64) {
        let hours = log_e.exp() * (self.hours + elapsed_h);
        if hours >= 0.0 {
            self.hours = hours.min(HOURS_MAX);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_recurrence_is_the_sum_over_all_onsets() {
        let (log_e, hours) = ([0.4_f64, -1.2, 2.0, 0.3], [0.1, 0.2, 0.3, 0.4]);
        let mut detector = EDetector::default();
        for (log_e, hours) in log_e.into_iter().zip(hours) {
            detector.step(log_e, hours);
        }
        // By hand: the time before each onset, times all that came after it.
        let after = |onset: usize| log_e[onset..].iter().sum::<f64>().exp();
        let sum: f64 = (0..4).map(|onset| hours[onset] * after(onset)).sum();
        assert!((detector.hours() - sum).abs() < 1e-12);
    }

    #[test]
    fn fair_bets_alarm_no_sooner_than_promised() {
        // E is 2 or 0 with even odds: (1) with equality. M = 2 (M + 1) reaches 2^(k+1) - 2 after k
        // wins in a row, which take 2^(k+1) - 2 steps in the mean: the bound is met exactly.
        let mut expected = 0.0;
        let mut detector = EDetector::default();
        for _ in 0..10 {
            expected = 2.0 * (expected + 1.0);
            detector.step(2.0_f64.ln(), 1.0);
        }
        assert!((detector.hours() / expected - 1.0).abs() < 1e-12);
        assert_eq!(expected, 2046.0);
        detector.step(f64::NEG_INFINITY, 1.0);
        assert_eq!(detector.hours(), 0.0);
    }

    proptest! {
        #[test]
        fn no_input_breaks_it(
            steps in prop::collection::vec(prop::array::uniform2(any::<f64>()), 9),
        ) {
            let mut detector = EDetector::default();
            for [log_e, hours] in steps {
                detector.step(log_e, hours);
                prop_assert!((0.0..=HOURS_MAX).contains(&detector.hours()));
            }
        }
    }
}
