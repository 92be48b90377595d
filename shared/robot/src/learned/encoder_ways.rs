//! In which way a broken encoder is broken, and by how much better that fits than a whole one.

use vigil_checkpoint::CheckpointValue;
use vigil_inference::alternative::Alternatives;

/// Probability that an encoder is broken in each other way from an observation on. Chosen: it
/// counts by its logarithm, 7 nats once; each observation without a change costs 0.003 nats.
const CHANGES: f64 = 0.001;

/// Log-likelihoods of an observation for each way to be broken, over that of a whole encoder.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Fits {
    /// Off by a bias that is learned.
    pub biased: f64,
    /// It reads anything.
    pub any: f64,
    /// It is late; None where a delay would not have shown.
    pub late: Option<f64>,
    /// It repeats itself.
    pub repeats: f64,
}

/// The ways of one encoder.
#[derive(Debug, Clone, Copy, CheckpointValue)]
pub(super) struct EncoderWays(Alternatives<4>);

impl Default for EncoderWays {
    fn default() -> Self {
        Self(Alternatives::new([0.25; 4]))
    }
}

impl EncoderWays {
    /// Takes an observation; the log-likelihood of all ways together, over that of a whole encoder.
    pub fn step(&mut self, fits: &Fits) -> f64 {
        // Where a delay would not show a late one reads right: whatever has ended would be taken
        // for it.
        let late = fits.late.map_or(0.0, |_| CHANGES);
        let log_ratios = [
            fits.biased,
            fits.any,
            fits.late.unwrap_or(0.0),
            fits.repeats,
        ];
        self.0.step(log_ratios, [CHANGES, CHANGES, late, CHANGES])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By how much two seconds of whole readings speak against a small bias that was seen before:
    /// for a second while the command changed, and for another while it did not.
    fn lost_after(late: Option<f64>) -> f64 {
        let mut ways = EncoderWays::default();
        let fits = |biased, any, late| Fits {
            biased,
            any,
            late,
            repeats: -4.6,
        };
        for k in 0..40 {
            ways.step(&fits(1.0, 0.5, (k < 20).then_some(-0.5)));
        }
        (0..40).map(|_| ways.step(&fits(-1.5, -2.3, late))).sum()
    }

    #[test]
    fn an_encoder_that_reads_right_again_is_whole_whether_a_delay_would_show_or_not() {
        for late in [Some(-0.5), None] {
            let lost = lost_after(late);
            assert!(lost < -18.0, "{late:?}: {lost}");
        }
    }

    #[test]
    fn a_late_encoder_stays_late_while_a_delay_does_not_show() {
        let mut ways = EncoderWays::default();
        let fits = |late| Fits {
            biased: -5.0,
            any: -2.0,
            late,
            repeats: -4.6,
        };
        for _ in 0..20 {
            ways.step(&fits(Some(6.0)));
        }
        let lost: f64 = (0..200).map(|_| ways.step(&fits(None))).sum();
        assert!(lost > -6.0, "{lost}");
    }
}
