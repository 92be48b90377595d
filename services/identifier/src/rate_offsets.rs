//! What the turning wheels' rates are off by while two wheels drag: constant in a run, and learned.
//!
//! Nothing was learned of two wheels together, so that the expected rates are wrong by more than
//! noise, and always by the same. Taken as noise it would count again in every observation, and a
//! true pair would lose to a dead encoder with time.

use vigil_blocks::WHEELS;
use vigil_robot::learned::wheel_evidence::Dragged;

/// A reading this many standard deviations off says nothing about the offset.
const FAR_SD: f64 = 4.0;

/// Gaussian beliefs about the offsets, one per wheel, rad/s; a scalar Kalman filter each.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RateOffsets {
    mean: [f64; WHEELS],
    /// Of the readings taken, (s/rad)²; the prior comes with [`Dragged`] and follows the command.
    information: [f64; WHEELS],
}

impl RateOffsets {
    /// Rate (rad/s) and variance at which a wheel is expected, the offset included.
    #[must_use]
    pub fn expected(&self, wheel: usize, dragged: &Dragged) -> (f64, f64) {
        let variance = self.variance(wheel, dragged);
        (dragged.rate + self.mean[wheel], dragged.variance + variance)
    }

    fn variance(&self, wheel: usize, dragged: &Dragged) -> f64 {
        let prior = dragged.offset_variance;
        prior / (1.0 + prior * self.information[wheel])
    }

    /// Takes a rate as read, rad/s, with the variance of its noise.
    pub fn update(&mut self, wheel: usize, dragged: &Dragged, rate: f64, noise: f64) {
        let (expected, variance) = self.expected(wheel, dragged);
        let (apart, total) = (rate - expected, variance + noise);
        if apart * apart <= FAR_SD * FAR_SD * total {
            self.mean[wheel] += self.variance(wheel, dragged) / total * apart;
            self.information[wheel] += 1.0 / (dragged.variance + noise);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAGGED: Dragged = Dragged {
        rate: 2.0,
        variance: 0.01,
        offset_variance: 0.04,
    };

    #[test]
    fn a_constant_offset_is_learned_as_by_the_mean_of_all_readings() {
        let mut offsets = RateOffsets::default();
        assert_eq!(offsets.expected(3, &DRAGGED), (2.0, 0.05));
        let rates = [2.2, 2.4, 2.1, 2.3];
        for rate in rates {
            offsets.update(3, &DRAGGED, rate, 0.02);
        }
        // Conjugate normal: precision 1/0.04 at 0, and four readings of precision 1/0.03.
        let (prior, each) = (1.0 / 0.04, 1.0 / 0.03);
        let precision = prior + 4.0 * each;
        let mean = 2.0 + each * rates.iter().map(|rate| rate - 2.0).sum::<f64>() / precision;
        let (rate, variance) = offsets.expected(3, &DRAGGED);
        assert!((rate - mean).abs() < 1e-12);
        assert!((variance - (0.01 + 1.0 / precision)).abs() < 1e-12);
        assert_eq!(offsets.expected(2, &DRAGGED), (2.0, 0.05));
    }

    #[test]
    fn what_is_far_off_or_no_number_teaches_nothing() {
        let mut offsets = RateOffsets::default();
        for rate in [9.0, f64::NAN, f64::INFINITY] {
            offsets.update(0, &DRAGGED, rate, 0.02);
        }
        assert_eq!(offsets, RateOffsets::default());
    }
}
