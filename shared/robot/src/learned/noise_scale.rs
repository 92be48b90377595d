//! How much noisier the sensors are than the learned ones.

/// Normalised squares above this one say nothing about noise (a jump, a fault).
const CLIP: f64 = 9.0;
/// Mean of a squared standard normal clipped at [`CLIP`].
const CLIPPED_MEAN: f64 = 0.99;
/// Samples that the learned scale of 1 counts for.
const PRIOR: f64 = 60.0;
/// Samples over which the estimate forgets.
const MEMORY: f64 = 900.0;

/// How much noisier the sensors are than the learned ones, as ratios of standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseScales {
    /// The pose sensor.
    pub pose: f64,
    /// The wheels' encoders.
    pub wheels: f64,
}

impl Default for NoiseScales {
    fn default() -> Self {
        Self {
            pose: 1.0,
            wheels: 1.0,
        }
    }
}

/// Running estimate of the ratio of measurement variance to the learned variance, from differences
/// that no slow motion and no persistent fault affects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseScale {
    sum: f64,
    count: f64,
}

impl Default for NoiseScale {
    fn default() -> Self {
        Self {
            sum: PRIOR,
            count: PRIOR,
        }
    }
}

impl NoiseScale {
    /// Takes the square of a difference divided by its variance under the learned noise.
    pub fn push(&mut self, normalised_square: f64) {
        if normalised_square.is_nan() {
            return;
        }
        let fading = 1.0 - 1.0 / MEMORY;
        self.sum = self.sum * fading + normalised_square.clamp(0.0, CLIP) / CLIPPED_MEAN;
        self.count = self.count * fading + 1.0;
    }

    /// Ratio of the variances. It leans to the high side by its own uncertainty: false alarms come
    /// from noise taken as smaller than it is.
    #[must_use]
    pub fn variance_ratio(&self) -> f64 {
        let lean = 1.0 + 0.8 * (3.9 / self.count).sqrt();
        (self.sum / self.count * lean).clamp(0.25, 16.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    #[test]
    fn the_ratio_follows_the_noise_and_ignores_jumps() {
        for ratio in [0.5, 1.0, 2.0] {
            let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
            let mut scale = NoiseScale::default();
            for i in 0..3000 {
                let x: f64 = rng.sample(StandardNormal);
                scale.push(if i % 100 == 0 {
                    f64::INFINITY
                } else {
                    x * x * ratio
                });
            }
            let found = scale.variance_ratio();
            assert!(
                found > 0.95 * ratio && found < 1.3 * ratio,
                "{ratio}: {found}"
            );
        }
    }
}
