//! Contaminated noise: normal, but for rare outliers.
//!
//! With a small probability the noise of a measurement has [`SPREAD`] times the standard deviation
//! (the contaminated normal distribution of Tukey, 1960). An outlier under every hypothesis is
//! evidence for none of them.

use vigil_checkpoint::CheckpointValue;

use crate::logspace::{log_add, log_normal, probability};
use crate::track::Track;

/// Ratio of an outlier's standard deviation to the noise's. Chosen by hand: beyond three of its
/// deviations, thirty of the noise, a measurement is evidence again; a smaller ratio takes large
/// outliers for evidence, a larger one hides small faults longer.
pub const SPREAD: f64 = 10.0;

/// Log-densities of a residual, each with the logarithm of its prior probability.
#[derive(Debug, Clone, Copy)]
struct LogDensities {
    usual: f64,
    outlier: f64,
}

/// Of a residual of variance `spread`, `noise` of it the sensor's, where outliers have the
/// probability `rate`.
fn log_densities(residual: f64, spread: f64, noise: f64, rate: f64) -> LogDensities {
    let wide = spread + (SPREAD * SPREAD - 1.0) * noise;
    LogDensities {
        usual: (-rate).ln_1p() + log_normal(residual, spread),
        outlier: rate.ln() + log_normal(residual, wide),
    }
}

/// The whitened residual whose normal log-density, relative to the peak, is the one that `whitened`
/// has where outliers have the probability `rate`.
#[must_use]
pub fn tempered(whitened: f64, rate: f64) -> f64 {
    if whitened.is_nan() {
        return whitened;
    }
    let log_density = |residual: f64| {
        let body = (-rate).ln_1p() + log_normal(residual, 1.0);
        log_add(body, rate.ln() + log_normal(residual, SPREAD * SPREAD))
    };
    let square = 2.0 * (log_density(0.0) - log_density(whitened));
    square.max(0.0).sqrt().copysign(whitened)
}

/// Least probability that an outlier follows an outlier: disturbances of a sensor last. Chosen by
/// hand: smaller takes the second sample of a disturbance for a departure; larger delays the
/// acceptance of a jump.
const AGAIN: f64 = 0.01;
/// Probability below which a streak of outliers is a jump of the pose. Chosen by hand, between
/// three in a row and four at a rate of 1e-5: smaller delays the acceptance of a jump, larger takes
/// disturbances for jumps.
const FLUKE: f64 = 5e-10;
/// Log-odds of an outlier under the most probable hypothesis below which the measurement is taken
/// as usual. Chosen by hand: one in 1,100 changes no belief, and the others need not be asked; a
/// higher bound lets outliers in.
const UNLIKELY: f64 = -7.0;

/// Variances of the first pose of a track. Whether it is an outlier cannot be known yet, so its
/// noise is taken between that of a usual pose and that of an outlier: the next pose can correct
/// it.
#[must_use]
pub fn unvouched(variance: [f64; 3]) -> [f64; 3] {
    variance.map(|variance| SPREAD * variance)
}

/// Detection of outliers in a measured pose, axis by axis (x, y, yaw).
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub struct Trust {
    /// Outliers in a row.
    streak: [i32; 3],
}

impl Trust {
    /// Variances of a measured pose under hypotheses with log-weights. That of an axis grows, up to
    /// its squared residual, by the probability that it is an outlier; `rates` are the priors. A
    /// streak of outliers that is too improbable is a jump: then the variances stay.
    pub fn variance<'a>(
        &mut self,
        hypotheses: impl Iterator<Item = (&'a Track, f64)> + Clone,
        pose: [f64; 3],
        variance: [f64; 3],
        rates: [f64; 3],
    ) -> [f64; 3] {
        let again: [f64; 3] = std::array::from_fn(|i| match self.streak[i] {
            0 => rates[i],
            _ => rates[i].max(AGAIN),
        });
        let densities = |track: &Track| -> [(f64, LogDensities); 3] {
            let (innovation, spread) = track.innovation(pose, variance);
            std::array::from_fn(|i| {
                let residual = innovation[i];
                let log = log_densities(residual, spread[(i, i)], variance[i], again[i]);
                (residual * residual, log)
            })
        };
        let likeliest = hypotheses.clone().max_by(|(_, a), (_, b)| a.total_cmp(b));
        let is_usual = likeliest.is_none_or(|(track, _)| {
            let mut axes = densities(track).into_iter();
            axes.all(|(_, log)| log.outlier - log.usual < UNLIKELY)
        });
        if is_usual {
            self.streak = [0; 3];
            return variance;
        }
        let (mut usual, mut far) = ([f64::NEG_INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let mut nearest = [f64::INFINITY; 3];
        for (track, log_weight) in hypotheses {
            for (i, (square, log)) in densities(track).into_iter().enumerate() {
                // The best hypothesis of each kind stands for all.
                usual[i] = usual[i].max(log_weight + log.usual);
                far[i] = far[i].max(log_weight + log.outlier);
                nearest[i] = nearest[i].min(square);
            }
        }
        std::array::from_fn(|i| {
            let is_fluke = rates[i] * rates[i].max(AGAIN).powi(self.streak[i]) < FLUKE;
            // Without a likelihood no outlier can be shown.
            let p = match far[i].is_finite() {
                true => probability(far[i] - usual[i]),
                false => 0.0,
            };
            self.streak[i] = match p > 0.5 {
                true => self.streak[i].saturating_add(1),
                false => 0,
            };
            let p = if is_fluke { 0.0 } else { p };
            // An outlier has no largest size: a farther one is noisier, not less probable.
            let wide = (nearest[i] / variance[i]).max(SPREAD * SPREAD);
            match wide.is_finite() {
                true => variance[i] / precision(p, wide),
                false => variance[i],
            }
        })
    }
}

/// Mean precision, relative to the usual one, of a measurement that has `wide` times the variance
/// with the probability `p`.
fn precision(p: f64, wide: f64) -> f64 {
    let precision = 1.0 - p + p / wide;
    assert!(
        precision > 0.0 && precision <= 1.0,
        "an outlier is less precise than a usual measurement, and not worthless"
    );
    precision
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::MotionNoise;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn a_precision_is_the_mean_of_both() {
        assert_eq!(precision(0.0, 100.0), 1.0);
        assert_eq!(precision(1.0, 100.0), 0.01);
        assert!((precision(0.25, 100.0) - 0.7525).abs() < 1e-15);
    }

    #[test]
    #[should_panic(expected = "an outlier is less precise than a usual measurement")]
    fn a_probability_above_one_is_caught() {
        precision(1.5, 100.0);
    }

    #[test]
    fn log_densities_are_those_of_two_normals() {
        let found = log_densities(3.0, 5.0, 2.0, 0.1);
        assert!((found.usual - 0.9_f64.ln() - log_normal(3.0, 5.0)).abs() < 1e-14);
        assert!((found.outlier - 0.1_f64.ln() - log_normal(3.0, 203.0)).abs() < 1e-14);
        assert_eq!(unvouched([1.0, 2.0, 3.0]), [10.0, 20.0, 30.0]);
    }

    #[test]
    fn small_residuals_stay_and_large_ones_say_little_more_than_the_rate() {
        for rate in [1e-8, 1e-4, 0.01] {
            assert!((tempered(1.0, rate) - 1.0).abs() < 0.02, "{rate}");
            assert_eq!(tempered(-2.5, rate), -tempered(2.5, rate));
            let (bound, twelve) = (-2.0 * (rate / SPREAD).ln(), tempered(12.0, rate));
            assert!((twelve * twelve - bound - 1.44).abs() < 0.1, "{twelve}");
        }
        assert_eq!(tempered(f64::INFINITY, 0.01), f64::INFINITY);
    }

    #[test]
    fn a_pose_is_trusted_as_far_as_one_hypothesis_explains_it() {
        let (near, far) = (at(0.0), at(0.1));
        let (pose, variance, rates) = ([0.1, 0.0, 0.0], [1e-4; 3], [0.01; 3]);
        let trusted = |tracks: &[Track], pose| {
            let equal = tracks.iter().map(|track| (track, 0.0));
            Trust::default().variance(equal, pose, variance, rates)
        };
        let alone = trusted(&[near], pose);
        assert!(alone[0] > 50.0 * 1e-4 && alone[1] < 1.1e-4, "{alone:?}");
        let both = trusted(&[near, far], pose);
        assert!(both[0] < 1.1e-4, "{both:?}");
        // What is hardly believed excuses nothing.
        let unbelieved = [(&near, 0.0), (&far, -14.0)].into_iter();
        let doubted = Trust::default().variance(unbelieved, pose, variance, rates);
        assert!(doubted[0] > 50.0 * 1e-4, "{doubted:?}");
        assert_eq!(trusted(&[], pose), variance);
        let nothing = trusted(&[near], [f64::NAN; 3]);
        assert_eq!(nothing, variance);
        // A sensor that never had an outlier has none; one that has some has few in a row.
        for (rate, believed_after) in [(1e-10, 0), (1e-5, 3), (0.01, 4)] {
            let mut trust = Trust::default();
            let doubted = (0..20).filter(|_| {
                let alone = std::iter::once((&near, 0.0));
                let [x, ..] = trust.variance(alone, [1.0, 0.0, 0.0], variance, [rate; 3]);
                x > 50.0 * 1e-4
            });
            assert_eq!(doubted.count(), believed_after, "{rate}");
        }
    }

    /// A track on the x axis, known exactly.
    fn at(x: f64) -> Track {
        let noise = MotionNoise {
            offset: Matrix3::zeros(),
            deviation: Matrix3::zeros(),
            length_m: 1.0,
            white: Vector3::zeros(),
            drift: Vector3::zeros(),
            bound: Vector3::repeat(f64::INFINITY),
            changes_1_m: 0.0,
        };
        Track::new(Vector3::new(x, 0.0, 0.0), Matrix3::zeros(), &noise)
    }

    #[test]
    fn a_variance_grows_by_the_probability_of_an_outlier() {
        let (track, rate) = (at(0.0), 0.01);
        let residuals = [0.035, 0.0, -0.12];
        let alone = std::iter::once((&track, 0.0));
        let found = Trust::default().variance(alone, residuals, [1e-4; 3], [rate; 3]);
        let normal = |residual: f64, variance: f64| {
            (-0.5 * residual * residual / variance).exp()
                / (std::f64::consts::TAU * variance).sqrt()
        };
        for (found, residual) in found.into_iter().zip(residuals) {
            let usual = (1.0 - rate) * normal(residual, 1e-4);
            let outlier = rate * normal(residual, 1e-2);
            let p = outlier / (usual + outlier);
            let wide = (residual * residual / 1e-4).max(100.0);
            let expected = 1e-4 / (1.0 - p + p / wide);
            assert!((found / expected - 1.0).abs() < 1e-9, "{residual}: {found}");
        }
    }

    #[test]
    fn a_usual_pose_keeps_its_variance_to_the_bit_and_ends_a_streak() {
        let track = at(0.0);
        let mut trust = Trust { streak: [2, 0, 1] };
        let alone = std::iter::once((&track, 0.0));
        let variance = [1e-4, 2e-4, 3e-4];
        let found = trust.variance(alone, [0.0; 3], variance, [1e-4; 3]);
        // After an outlier another one is less improbable than this.
        assert!(found[0] > variance[0] && found[1] >= variance[1]);
        assert_eq!(trust, Trust::default());
        let alone = std::iter::once((&track, 0.0));
        assert_eq!(
            trust.variance(alone, [0.0; 3], variance, [1e-4; 3]),
            variance
        );
    }
}
