//! A scalar context that changes slowly along the path and stays within a tolerance, such as the
//! offset of a healthy channel.
//!
//! An Ornstein-Uhlenbeck process, estimated by a scalar Kalman filter. Its mean saturates at the
//! tolerance, so that a larger lasting offset is never learned away.

use vigil_checkpoint::CheckpointValue;

/// Bounds of a slow state.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Drift {
    /// Largest healthy magnitude: twice the stationary deviation.
    pub tolerance: f64,
    /// Length over which it changes, m.
    pub length_m: f64,
}

impl Drift {
    /// Stationary variance: the tolerance is two deviations, so that 95 % of healthy states lie
    /// within.
    fn variance(&self) -> f64 {
        0.25 * self.tolerance * self.tolerance
    }
}

/// The estimate.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub struct SlowState {
    /// Mean.
    pub mean: f64,
    /// Variance.
    pub variance: f64,
}

impl SlowState {
    /// The estimate before any measurement: the stationary distribution.
    #[must_use]
    pub fn new(drift: &Drift) -> Self {
        Self {
            mean: 0.0,
            variance: drift.variance(),
        }
    }

    /// Forgets over a travel of `travel_m`.
    pub fn fade(&mut self, travel_m: f64, drift: &Drift) {
        let fading = (-travel_m.abs() / drift.length_m).exp();
        self.mean *= fading;
        self.variance =
            self.variance * fading * fading + drift.variance() * (1.0 - fading * fading);
    }

    /// Takes a measurement of `scale` times the state, with the variance `noise`. One that is no
    /// number, or has no variance at all, changes nothing.
    pub fn learn(&mut self, measured: f64, scale: f64, noise: f64, drift: &Drift) {
        let spread = scale * scale * self.variance + noise;
        let gain = self.variance * scale / spread;
        let mean = self.mean + gain * (measured - scale * self.mean);
        if !(spread > 0.0 && mean.is_finite()) {
            return;
        }
        // Unlike `clamp` these accept a tolerance that is negative or no number.
        self.mean = mean.min(drift.tolerance).max(-drift.tolerance);
        self.variance *= 1.0 - gain * scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIFT: Drift = Drift {
        tolerance: 0.2,
        length_m: 4.0,
    };

    #[test]
    fn one_measurement_is_the_conjugate_normal() {
        let mut state = SlowState::new(&DRIFT);
        state.learn(0.3, 2.0, 0.05, &DRIFT);
        let precision = 1.0 / 0.01 + 4.0 / 0.05;
        assert!((state.variance - 1.0 / precision).abs() < 1e-15);
        assert!((state.mean - 2.0 * 0.3 / 0.05 / precision).abs() < 1e-15);
    }

    #[test]
    fn two_fadings_are_one_over_both_travels() {
        let mut at_once = SlowState::new(&DRIFT);
        at_once.learn(0.3, 2.0, 0.05, &DRIFT);
        let mut in_steps = at_once;
        at_once.fade(4.0, &DRIFT);
        in_steps.fade(1.0, &DRIFT);
        in_steps.fade(-3.0, &DRIFT);
        assert!((in_steps.mean - at_once.mean).abs() < 1e-15);
        assert!((in_steps.variance - at_once.variance).abs() < 1e-15);
    }

    #[test]
    fn it_fades_to_its_stationary_deviation_and_never_beyond_its_tolerance() {
        let mut state = SlowState::new(&DRIFT);
        for _ in 0..1000 {
            state.learn(5.0, 1.0, 1e-4, &DRIFT);
            assert!(state.mean <= 0.2 && state.variance < 0.01);
        }
        assert_eq!(state.mean, 0.2);
        state.fade(4.0, &DRIFT);
        assert!((state.mean - 0.2 * (-1.0_f64).exp()).abs() < 1e-15);
        state.fade(1e3, &DRIFT);
        assert!(state.mean.abs() < 1e-9 && (state.variance - 0.01).abs() < 1e-12);
    }

    #[test]
    fn a_mean_beyond_a_tolerance_saturates_on_both_sides() {
        for (measured, mean) in [(5.0, 0.2), (-5.0, -0.2), (0.1, 0.1)] {
            let mut state = SlowState::new(&DRIFT);
            state.learn(measured, 1.0, 0.0, &DRIFT);
            assert!((state.mean - mean).abs() < 1e-12 && state.variance.abs() < 1e-12);
        }
        let mut state = SlowState::new(&DRIFT);
        state.mean = 0.1;
        state.fade(-4.0, &DRIFT);
        assert!(
            (state.mean - 0.1 * (-1.0_f64).exp()).abs() < 1e-15,
            "backwards, too"
        );
    }

    #[test]
    fn no_tolerance_breaks_it() {
        for tolerance in [-1.0, f64::NAN] {
            let drift = Drift { tolerance, ..DRIFT };
            SlowState::new(&DRIFT).learn(0.1, 1.0, 1.0, &drift);
        }
    }

    #[test]
    fn no_measurement_breaks_it() {
        for (measured, noise) in [(f64::NAN, 1.0), (f64::INFINITY, 1.0), (0.1, f64::NAN)] {
            let mut state = SlowState::new(&DRIFT);
            state.learn(measured, 1.0, noise, &DRIFT);
            assert_eq!(state, SlowState::new(&DRIFT));
        }
    }
}
