//! Measurements of which now and then one is far off: normal noise, contaminated.
//!
//! With a small probability a sample's noise has [`SPREAD`] times the standard deviation. What is
//! an outlier under every hypothesis is evidence for none of them.

use crate::logspace::{log_add, log_normal};
use crate::track::Track;

/// Standard deviations of an outlier over those of the noise. Beyond three of them, thirty of the
/// noise, a sample is evidence again.
pub const SPREAD: f64 = 10.0;

/// Logarithms of the densities of a residual of variance `spread`, `noise` of it the sensor's:
/// as it should be, and as an outlier, where such come with the probability `rate`.
fn log_densities(residual: f64, spread: f64, noise: f64, rate: f64) -> (f64, f64) {
    let wide = spread + (SPREAD * SPREAD - 1.0) * noise;
    (
        (-rate).ln_1p() + log_normal(residual, spread),
        rate.ln() + log_normal(residual, wide),
    )
}

/// The whitened residual that has the log-density, relative to that of none, which `whitened` has
/// where outliers come with the probability `rate`.
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

/// Probability, at least, that an outlier follows an outlier: what disturbs a sensor lasts. Chosen:
/// one in a hundred, as a broken sensor's exception.
const AGAIN: f64 = 0.01;
/// Probability below which a run of outliers is none: the pose has jumped. The fourth in a row at
/// the least rate (1e-5 x 0.01^3), the tenth at the largest (0.1^10).
const FLUKE: f64 = 5e-10;
/// Log-odds of an outlier under the most probable hypothesis below which none need be thought of.
/// Chosen: one in 1,100 changes no belief and saves most of the work.
const UNLIKELY: f64 = -7.0;

/// Variances of the first pose of a track. No earlier pose tells whether it is an outlier, so it is
/// taken as noisier than a good one and less noisy than an outlier: the next pose can correct it.
#[must_use]
pub fn unvouched(variance: [f64; 3]) -> [f64; 3] {
    variance.map(|variance| SPREAD * variance)
}

/// How far a measured pose can be trusted, axis by axis (x, y, yaw).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Trust {
    /// Outliers in a row.
    streak: [i32; 3],
}

impl Trust {
    /// Variances of a measured pose: that of an axis grows, up to its squared residual, by the
    /// probability that it is an outlier, as `rates` say, under weighted hypotheses (logarithms).
    /// Where so many in a row would be a fluke, it is none.
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
        let said = |track: &Track| -> [(f64, (f64, f64)); 3] {
            let (apart, spread) = track.innovation(pose, variance);
            std::array::from_fn(|i| {
                let densities = log_densities(apart[i], spread[(i, i)], variance[i], again[i]);
                (apart[i] * apart[i], densities)
            })
        };
        let likeliest = hypotheses.clone().max_by(|(_, a), (_, b)| a.total_cmp(b));
        let is_usual = likeliest.is_none_or(|(track, _)| {
            let said = said(track);
            said.iter().all(|(_, (usual, far))| far - usual < UNLIKELY)
        });
        if is_usual {
            self.streak = [0; 3];
            return variance;
        }
        let (mut usual, mut far) = ([f64::NEG_INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let mut nearest = [f64::INFINITY; 3];
        for (track, log_weight) in hypotheses {
            for (i, (square, densities)) in said(track).into_iter().enumerate() {
                usual[i] = usual[i].max(log_weight + densities.0);
                far[i] = far[i].max(log_weight + densities.1);
                nearest[i] = nearest[i].min(square);
            }
        }
        std::array::from_fn(|i| {
            let is_fluke = rates[i] * rates[i].max(AGAIN).powi(self.streak[i]) < FLUKE;
            // Without a number, the measurement is what it is.
            let p = match far[i].is_finite() {
                true => crate::logspace::probability(far[i] - usual[i]),
                false => 0.0,
            };
            self.streak[i] = match p > 0.5 {
                true => self.streak[i].saturating_add(1),
                false => 0,
            };
            let p = if is_fluke { 0.0 } else { p };
            // An outlier has no largest size: one further off is noisier, not less likely.
            let wide = (nearest[i] / variance[i]).max(SPREAD * SPREAD);
            match wide.is_finite() {
                true => variance[i] / (1.0 - p + p / wide),
                false => variance[i],
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::MotionNoise;
    use nalgebra::{Matrix3, Vector3};

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
        let noise = MotionNoise {
            offset: Matrix3::zeros(),
            deviation: Matrix3::zeros(),
            length_m: 1.0,
            white: Vector3::zeros(),
            drift: Vector3::zeros(),
            bound: Vector3::repeat(f64::INFINITY),
            changes_1_m: 0.0,
        };
        let at = |x: f64| Track::new(Vector3::new(x, 0.0, 0.0), Matrix3::zeros(), &noise);
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
}
