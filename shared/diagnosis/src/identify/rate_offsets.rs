//! By how much more than expected dragging wheels change the others' rates: learned on the way.
//!
//! One drags otherwise on another ground, and of several together nothing was learned: the expected
//! rates are wrong by more than noise, and always alike. Taken as noise it would count again in
//! every observation. A true pair would lose to a dead encoder with time; and one stuck wheel
//! beside a dead encoder would lose to a pair that learns.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;
use vigil_robot::learned::wheel_context::FAR_SD;
use vigil_robot::learned::wheel_evidence::{DRAG_SD, WheelDrag};
use vigil_robot::learned::{Model, Observation, WheelEvidence};

/// Deviation by which the offset drifts from one observation to the next: the ground changes. It
/// reaches [`DRAG_SD`] in 1600 of them, 80 s: a tolerance's length, 8 m, at 0.1 m/s.
const DRIFT_SD: f64 = 0.01;

/// Gaussian beliefs about the offsets in units of [`WheelDrag::unit_rad_s`], one per wheel: a
/// scalar Kalman filter each. Relative, as the change follows the command.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct RateOffsets {
    mean: [f64; WHEELS],
    variance: [f64; WHEELS],
}

impl Default for RateOffsets {
    fn default() -> Self {
        Self {
            mean: [0.0; WHEELS],
            variance: [DRAG_SD * DRAG_SD; WHEELS],
        }
    }
}

impl RateOffsets {
    /// Natural log-likelihood of a dragged wheel's readings.
    #[must_use]
    pub fn log_likelihood(
        &self,
        model: &Model,
        observation: &Observation,
        evidence: &WheelEvidence,
        wheel: usize,
        dragged: &WheelDrag,
    ) -> f64 {
        let (rate_rad_s, variance) = self.expected(wheel, dragged);
        evidence.turning(model, observation, wheel, rate_rad_s, variance)
    }

    /// Learns from a dragged wheel's readings, if there are any.
    pub fn learn(
        &mut self,
        observation: &Observation,
        evidence: &WheelEvidence,
        wheel: usize,
        dragged: &WheelDrag,
    ) {
        let reading = &observation.wheels[wheel];
        if reading.plain > 0 {
            let noise = evidence.sample_variance(wheel, reading.plain);
            self.update(wheel, dragged, reading.mean, noise);
        }
    }

    /// Rate (rad/s) and variance at which a wheel is expected, the offset included.
    fn expected(&self, wheel: usize, dragged: &WheelDrag) -> (f64, f64) {
        let change = dragged.unit_rad_s;
        (
            dragged.rate_rad_s + self.mean[wheel] * change,
            dragged.variance + self.variance[wheel] * change * change,
        )
    }

    /// Takes a rate as read, rad/s, with the variance of its noise.
    fn update(&mut self, wheel: usize, dragged: &WheelDrag, rate: f64, noise: f64) {
        let (expected, variance) = self.expected(wheel, dragged);
        let (residual, total) = (rate - expected, variance + noise);
        if residual * residual <= FAR_SD * FAR_SD * total {
            let gain = self.variance[wheel] * dragged.unit_rad_s / total;
            self.mean[wheel] += gain * residual;
            self.variance[wheel] *= 1.0 - gain * dragged.unit_rad_s;
        }
        let drifted = self.variance[wheel] + DRIFT_SD * DRIFT_SD;
        self.variance[wheel] = drifted.min(DRAG_SD * DRAG_SD);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dragged(change_rad_s: f64) -> WheelDrag {
        WheelDrag {
            rate_rad_s: 2.0 + change_rad_s,
            change_rad_s,
            unit_rad_s: change_rad_s,
            variance: 0.001,
        }
    }

    #[test]
    fn the_factor_is_learned_whatever_the_command_makes_of_it() {
        // Really 1.5 times the expected change, in turns to and fro.
        let mut offsets = RateOffsets::default();
        for k in 0..200 {
            let expected = dragged(if k % 40 < 20 { -0.3 } else { 0.2 });
            let rate = 2.0 + 1.5 * expected.change_rad_s;
            offsets.update(3, &expected, rate, 0.001);
        }
        for change in [-0.3, 0.2, 0.1] {
            let (rate, variance) = offsets.expected(3, &dragged(change));
            assert!((rate - (2.0 + 1.5 * change)).abs() < 0.01, "{rate}");
            assert!(variance < 0.002, "{variance}");
        }
        let prior = DRAG_SD * DRAG_SD * 0.09 + 0.001;
        let (rate, variance) = offsets.expected(2, &dragged(-0.3));
        assert!((rate - 1.7).abs() < 1e-12 && (variance - prior).abs() < 1e-12);
    }

    #[test]
    fn one_reading_is_the_conjugate_normal() {
        let mut offsets = RateOffsets::default();
        offsets.update(0, &dragged(0.5), 2.9, 0.02);
        let (prior, reading) = (1.0 / (DRAG_SD * DRAG_SD), 0.25 / 0.021);
        let mean = reading * 0.8 / (prior + reading);
        let variance = 1.0 / (prior + reading) + DRIFT_SD * DRIFT_SD;
        let (rate, total) = offsets.expected(0, &dragged(0.5));
        assert!((rate - (2.5 + 0.5 * mean)).abs() < 1e-12);
        assert!((total - (0.001 + 0.25 * variance)).abs() < 1e-12);
    }

    #[test]
    fn what_is_far_off_or_no_number_teaches_nothing() {
        let mut offsets = RateOffsets::default();
        for rate in [9.0, f64::NAN, f64::INFINITY] {
            offsets.update(0, &dragged(0.5), rate, 0.02);
        }
        assert_eq!(offsets, RateOffsets::default());
    }
}
