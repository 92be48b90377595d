//! The size of a fault that is present: the gain or bias of a sensor, the offset of an actuator.
//!
//! A measurement is linear in the size and in a healthy offset beside it. So the belief about both
//! stays Gaussian, and the likelihood of a measurement integrates over it (Rao-Blackwell). Healthy
//! sizes have no prior mass: a normal prior truncated there gives a posterior truncated there. The
//! evidence under the truncated prior is that under the whole one, times the ratio of the masses
//! outside the healthy interval, posterior to prior. [`Size::log_material`] is the logarithm of the
//! posterior's mass.

use vigil_checkpoint::CheckpointValue;

use libm::erfc;

/// Least mass outside the healthy interval: a size that can return must not become impossible.
/// Chosen by hand: far below every prior, far above the smallest double.
const MASS_MIN: f64 = 1e-12;

/// The belief about a size and an offset before any measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Means of the size and of the offset beside it.
    pub mean: [f64; 2],
    /// Their standard deviations.
    pub sd: [f64; 2],
    /// Standard deviations of their random walk from one measurement to the next.
    pub wander: [f64; 2],
    /// Interval of healthy sizes, which no fault has.
    pub healthy: [f64; 2],
}

/// Gaussian belief about a size and an offset beside it.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Size {
    mean: [f64; 2],
    /// Variance of the size, covariance, variance of the offset.
    covariance: [f64; 3],
    log_material: f64,
}

impl Size {
    /// The belief before any measurement.
    #[must_use]
    pub fn new(prior: &Prior) -> Self {
        let [size, offset] = prior.sd.map(|sd| sd * sd);
        let mut this = Self {
            mean: prior.mean,
            covariance: [size, 0.0, offset],
            log_material: 0.0,
        };
        this.cut_off(prior);
        this
    }

    /// Expected size and its standard deviation.
    #[must_use]
    pub fn estimate(&self) -> (f64, f64) {
        (self.mean[0], self.covariance[0].max(0.0).sqrt())
    }

    /// Expected offset and its variance.
    #[must_use]
    pub const fn offset(&self) -> (f64, f64) {
        (self.mean[1], self.covariance[2])
    }

    /// Logarithm of the probability mass outside the healthy interval; see the module.
    #[must_use]
    pub const fn log_material(&self) -> f64 {
        self.log_material
    }

    /// Adds the size times `dt` to the offset (`dt` s where the size is a rate, else 0), and lets
    /// both wander.
    pub fn predict(&mut self, dt: f64, prior: &Prior) {
        self.mean[1] += dt * self.mean[0];
        let [size, both, offset] = self.covariance;
        let [wander, beside] = prior.wander.map(|sd| sd * sd);
        self.covariance = [
            // Nothing is less certain than before any measurement.
            (size + wander).min(prior.sd[0] * prior.sd[0]),
            both + dt * size,
            offset + dt * (2.0 * both + dt * size) + beside,
        ];
    }

    /// Mean and variance of `by[0]` times the size plus `by[1]` times the offset.
    #[must_use]
    pub fn expected(&self, by: [f64; 2]) -> (f64, f64) {
        let [size, both, offset] = self.covariance;
        (
            by[0] * self.mean[0] + by[1] * self.mean[1],
            by[0] * by[0] * size + 2.0 * by[0] * by[1] * both + by[1] * by[1] * offset,
        )
    }

    /// Takes a measurement of the quantity that [`Self::expected`] predicts, with the variance
    /// `noise`. One that is no number changes nothing.
    pub fn update(&mut self, by: [f64; 2], measured: f64, noise: f64, prior: &Prior) {
        let (expected, variance) = self.expected(by);
        let (innovation, total) = (measured - expected, variance + noise);
        if !(innovation.is_finite() && total > 0.0) {
            return;
        }
        let [size, both, offset] = self.covariance;
        let with = [by[0] * size + by[1] * both, by[0] * both + by[1] * offset];
        let gain = with.map(|with| with / total);
        self.mean = [
            self.mean[0] + gain[0] * innovation,
            self.mean[1] + gain[1] * innovation,
        ];
        self.covariance = [
            size - gain[0] * with[0],
            both - gain[0] * with[1],
            offset - gain[1] * with[1],
        ];
        self.cut_off(prior);
    }

    /// Moment-matched mixture: this belief with the weight `share`, `other` with the rest.
    #[must_use]
    pub fn mixed(&self, other: &Self, share: f64, prior: &Prior) -> Self {
        let rest = 1.0 - share;
        let [size, offset] = [self.mean[0] - other.mean[0], self.mean[1] - other.mean[1]];
        let spread = [size * size, size * offset, offset * offset];
        let mut this = Self {
            mean: std::array::from_fn(|i| share * self.mean[i] + rest * other.mean[i]),
            covariance: std::array::from_fn(|i| {
                share * self.covariance[i] + rest * other.covariance[i] + share * rest * spread[i]
            }),
            log_material: 0.0,
        };
        this.cut_off(prior);
        this
    }

    /// Computes the mass outside the healthy interval.
    fn cut_off(&mut self, prior: &Prior) {
        let (mean, sd) = self.estimate();
        let scale = sd.max(f64::MIN_POSITIVE) * std::f64::consts::SQRT_2;
        let [low, high] = prior.healthy.map(|bound| (bound - mean) / scale);
        let beyond = 0.5 * (erfc(-low) + erfc(high));
        self.log_material = beyond.clamp(MASS_MIN, 1.0).ln();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logspace::log_normal;

    const PRIOR: Prior = Prior {
        mean: [0.8, 0.0],
        sd: [0.5, 0.0],
        wander: [0.0, 0.0],
        healthy: [0.85, 1.15],
    };

    /// Evidence, mean and deviation of a gain by summing over a grid of gains.
    fn by_grid(rates: &[f64], readings: &[f64], noise: f64) -> (f64, f64, f64) {
        let (step, mut sums, mut prior) = (1e-4, [0.0; 3], 0.0);
        for i in -30_000..50_000 {
            let gain = (f64::from(i) + 0.5) * step;
            if (PRIOR.healthy[0]..=PRIOR.healthy[1]).contains(&gain) {
                continue;
            }
            let density = log_normal(gain - PRIOR.mean[0], PRIOR.sd[0] * PRIOR.sd[0]).exp();
            prior += density * step;
            let log: f64 = rates
                .iter()
                .zip(readings)
                .map(|(rate, read)| log_normal(read - gain * rate, noise))
                .sum();
            let p = density * log.exp() * step;
            for (sum, power) in sums.iter_mut().zip([1.0, gain, gain * gain]) {
                *sum += p * power;
            }
        }
        let [evidence, first, second] = sums;
        let mean = first / evidence;
        let variance = second / evidence - mean * mean;
        ((evidence / prior).ln(), mean, variance.sqrt())
    }

    #[test]
    fn evidence_and_size_are_those_of_a_grid_with_a_hole() {
        let (rates, noise) = ([2.0, 2.5, 1.5, 3.0, 2.2], 0.01);
        // A half, and a gain within what is healthy.
        for gain in [0.5, 1.05] {
            let readings = rates.map(|rate| gain * rate + 0.02 * (rate - 2.0));
            let mut size = Size::new(&PRIOR);
            let before = size.log_material();
            let mut evidence = 0.0;
            for (&rate, &read) in rates.iter().zip(&readings) {
                let (expected, variance) = size.expected([rate, 0.0]);
                evidence += log_normal(read - expected, variance + noise);
                size.update([rate, 0.0], read, noise, &PRIOR);
            }
            evidence += size.log_material() - before;
            let (by_grid, mean, sd) = by_grid(&rates, &readings, noise);
            assert!((evidence - by_grid).abs() < 2e-3, "{evidence} {by_grid}");
            if gain < 0.8 {
                let (found, deviation) = size.estimate();
                assert!((found - mean).abs() < 1e-4, "{found} {mean}");
                assert!((deviation - sd).abs() < 1e-4, "{deviation} {sd}");
            }
        }
    }

    #[test]
    fn a_slope_is_that_of_weighted_least_squares() {
        let prior = Prior {
            mean: [0.0; 2],
            sd: [1e3; 2],
            wander: [0.0; 2],
            healthy: [-1e-9, 1e-9],
        };
        let (dt, noise) = (0.05, 0.003);
        let read = |k: usize| 0.3 + 0.07 * dt * k as f64 + 0.04 * ((k * 7 % 5) as f64 - 2.0);
        let mut size = Size::new(&prior);
        let mut sums = [0.0; 4];
        for k in 0..60 {
            if k > 0 {
                size.predict(dt, &prior);
            }
            size.update([0.0, 1.0], read(k), noise, &prior);
            let t = dt * k as f64;
            for (sum, term) in sums.iter_mut().zip([t, t * t, read(k), t * read(k)]) {
                *sum += term;
            }
        }
        let [t, tt, y, ty] = sums.map(|sum| sum / 60.0);
        let slope = (ty - t * y) / (tt - t * t);
        let sd = (noise / (60.0 * (tt - t * t))).sqrt();
        let (found, deviation) = size.estimate();
        assert!((found - slope).abs() < 1e-5, "{found} {slope}");
        assert!((deviation - sd).abs() < 1e-5, "{deviation} {sd}");
    }

    #[test]
    fn a_mixture_has_the_moments_of_its_parts() {
        let (mut one, two) = (Size::new(&PRIOR), Size::new(&PRIOR));
        one.update([2.0, 0.0], 0.9, 0.04, &PRIOR);
        let ((a, sa), (b, sb)) = (one.estimate(), two.estimate());
        let mean = 0.3 * a + 0.7 * b;
        let second = 0.3 * (sa * sa + a * a) + 0.7 * (sb * sb + b * b);
        let (found, sd) = one.mixed(&two, 0.3, &PRIOR).estimate();
        assert!((found - mean).abs() < 1e-12);
        assert!((sd * sd - (second - mean * mean)).abs() < 1e-12);
    }

    #[test]
    fn an_offset_integrates_the_size_and_is_measured_with_it() {
        let prior = Prior {
            mean: [1.0, 2.0],
            sd: [0.5, 0.2],
            wander: [0.3, 0.1],
            healthy: [-0.1, 0.1],
        };
        let mut size = Size::new(&prior);
        size.predict(2.0, &prior);
        // Mean 2 + 2 x 1; covariance 2 x .25; variance .04 + 4 x .25 + .01; the size's is bounded.
        let (offset, variance) = size.offset();
        assert!((offset - 4.0).abs() < 1e-12 && (variance - 1.05).abs() < 1e-12);
        let (mean, variance) = size.expected([3.0, -1.0]);
        assert!((mean + 1.0).abs() < 1e-12, "{mean}");
        assert!((variance - (9.0 * 0.25 - 6.0 * 0.5 + 1.05)).abs() < 1e-12);
        // One measurement of the size alone, with the noise 0.25: half of the innovation.
        size.update([1.0, 0.0], 2.0, 0.25, &prior);
        let (mean, sd) = size.estimate();
        assert!((mean - 1.5).abs() < 1e-12 && (sd * sd - 0.125).abs() < 1e-12);
        let (offset, variance) = size.offset();
        assert!((offset - 5.0).abs() < 1e-12 && (variance - 0.55).abs() < 1e-12);
    }

    #[test]
    fn the_material_mass_lies_outside_the_healthy_interval() {
        let prior = |mean| Prior {
            mean: [mean, 0.0],
            sd: [0.5, 0.0],
            wander: [0.0; 2],
            healthy: [-1.0, 0.5],
        };
        // Below -1 lies beyond two deviations, above 0.5 beyond one.
        let expected: f64 = 0.158_655_253_931_457_05 + 0.022_750_131_948_179_21;
        let found = Size::new(&prior(0.0)).log_material();
        assert!((found - expected.ln()).abs() < 1e-12);
        assert!(Size::new(&prior(50.0)).log_material().abs() < 1e-12);
        let narrow = Prior {
            sd: [1e-3, 0.0],
            ..prior(0.0)
        };
        assert_eq!(Size::new(&narrow).log_material(), MASS_MIN.ln());
    }

    #[test]
    fn what_is_no_number_teaches_nothing() {
        let mut size = Size::new(&PRIOR);
        size.update([2.0, 0.0], f64::NAN, 0.04, &PRIOR);
        size.update([2.0, 0.0], f64::INFINITY, 0.04, &PRIOR);
        assert_eq!(size, Size::new(&PRIOR));
    }
}
