//! What labelled runs showed of a declared fault, and how much the last seconds look like it.
//!
//! The whitened residuals of each channel are averaged over the last 0.5, 2 and 4 s. A fault that
//! has begun moves these means in a way that changes with its age, so a signature has a few phases.
//! The evidence of a phase is linear in the means `v`, `w·v - c`, with `w = C⁻¹μ` and
//! `c = ½ μᵀC⁻¹μ` for its mean `μ` and a covariance `C` (Fisher's discriminant): the log-likelihood
//! ratio of two Gaussian laws with one covariance. Successive ratios are of the same residuals, so
//! they are averaged over time and never summed.

use serde::{Deserialize, Serialize};

use super::CHANNELS_MAX;
use super::law::BLOCKS;
use super::window::Window;
use crate::fault_table::DECLARED_MAX;

/// Newest blocks that each mean spans.
const SPANS: [usize; 3] = [1, BLOCKS / 2, BLOCKS];
/// Means of all channels at most.
pub const MEANS_MAX: usize = means_count(CHANNELS_MAX);
/// Phases of a signature at most.
pub const PHASES_MAX: usize = 8;
/// Deviations beyond which a mean says no more.
const CLIP: f64 = 12.0;
/// Smallest deviation of a mean, and the largest magnitude of any number of a signature.
pub const SD_MIN: f64 = 1e-3;
const NUMBER_MAX: f64 = 1e9;
/// A single ratio says no more than this, nats.
const LOG_RATIO_MAX: f64 = 40.0;
/// Time constant over which ratios are averaged, s.
const AVERAGE_S: f64 = 0.35;

/// Means of so many channels.
#[must_use]
pub const fn means_count(channels: usize) -> usize {
    SPANS.len() * channels
}

/// Means of the whitened residuals of all channels, span by span; missing ones are 0.
pub type Means = [f64; MEANS_MAX];

/// The means that the last seconds of so many channels show.
#[must_use]
pub fn means(window: &Window, channels: usize) -> Means {
    let mut out = [0.0; MEANS_MAX];
    for (span, blocks) in SPANS.into_iter().enumerate() {
        for channel in 0..channels.min(CHANNELS_MAX) {
            let newest = window.z[channel][BLOCKS - blocks..].iter().flatten();
            let (sum, count) = newest.fold((0.0, 0.0), |(sum, count), z| (sum + z, count + 1.0));
            out[span * channels + channel] = sum / f64::max(count, 1.0);
        }
    }
    out
}

/// One phase of a fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Phase {
    /// Weight of each standardized mean.
    pub weights: Vec<f64>,
    /// What is taken off their sum.
    pub offset: f64,
}

/// How a fault shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Signature {
    /// Name of the declared fault.
    pub fault: String,
    /// Runs that it was learned from.
    pub runs: usize,
    /// Its phases, all equally probable.
    pub phase: Vec<Phase>,
}

/// How all declared faults show.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Signatures {
    /// The means of a healthy robot.
    pub mean: Vec<f64>,
    /// Their deviations.
    pub sd: Vec<f64>,
    /// The faults of which labelled runs show enough.
    pub fault: Vec<Signature>,
}

impl Signatures {
    /// True if no fault has one.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.fault.is_empty()
    }

    /// True if they are of this many channels.
    #[must_use]
    pub fn fits(&self, channels: usize) -> bool {
        let n = means_count(channels);
        let is_sane = |value: &f64| value.abs() <= NUMBER_MAX;
        let is_phase = |phase: &Phase| {
            let numbers = phase.weights.iter().chain([&phase.offset]);
            phase.weights.len() == n && numbers.into_iter().all(is_sane)
        };
        let is_whole = |one: &Signature| {
            let phases = one.phase.len();
            (1..=PHASES_MAX).contains(&phases) && one.phase.iter().all(is_phase)
        };
        self.is_empty()
            || (self.mean.len() == n
                && self.sd.len() == n
                && self.mean.iter().all(is_sane)
                && self.sd.iter().all(|sd| (SD_MIN..=NUMBER_MAX).contains(sd))
                && self.fault.len() <= DECLARED_MAX
                && self.fault.iter().all(is_whole))
    }

    /// Means as deviations from those of a healthy robot.
    #[must_use]
    pub fn standardized(&self, means: &Means) -> Means {
        let mut out = [0.0; MEANS_MAX];
        let laws = self.mean.iter().zip(&self.sd);
        for ((slot, value), (mean, sd)) in out.iter_mut().zip(means).zip(laws) {
            *slot = ((value - mean) / sd).clamp(-CLIP, CLIP);
        }
        out
    }
}

impl Signature {
    /// Log-likelihood ratio of the fault, in any of its phases, to health.
    #[must_use]
    pub fn log_ratio(&self, standardized: &Means) -> f64 {
        let of = |phase: &Phase| {
            let parts = phase.weights.iter().zip(standardized);
            parts.map(|(weight, value)| weight * value).sum::<f64>() - phase.offset
        };
        let highest = self.phase.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = self
            .phase
            .iter()
            .map(|phase| (of(phase) - highest).exp())
            .sum();
        highest + (sum / self.phase.len().max(1) as f64).ln()
    }
}

/// The evidence for one fault, averaged over time and never below zero.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Evidence {
    log_ratio: f64,
}

impl Evidence {
    /// Takes the ratio of an observation of this length.
    pub fn take(&mut self, log_ratio: f64, dt_s: f64) {
        let keep = (-dt_s / AVERAGE_S).exp();
        let ratio = log_ratio.clamp(-LOG_RATIO_MAX, LOG_RATIO_MAX);
        self.log_ratio = (keep * self.log_ratio + (1.0 - keep) * ratio).max(0.0);
    }

    /// The evidence, nats.
    #[must_use]
    pub const fn log_ratio(&self) -> f64 {
        self.log_ratio
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standardized(values: &[f64]) -> Means {
        let mut out = [0.0; MEANS_MAX];
        out[..values.len()].copy_from_slice(values);
        out
    }

    #[test]
    fn evidence_is_the_ratio_of_two_gaussian_laws_averaged_over_phases() {
        // One channel; the means are independent and of unit variance.
        let phase = |mean: [f64; 3]| Phase {
            weights: mean.to_vec(),
            offset: 0.5 * mean.iter().map(|m| m * m).sum::<f64>(),
        };
        let means = [[1.0, 2.0, 0.5], [-1.0, 0.0, 3.0]];
        let signature = Signature {
            fault: "engine".to_owned(),
            runs: 2,
            phase: means.map(phase).to_vec(),
        };
        let seen = [0.3, 1.8, 0.1];
        let log_density = |mean: [f64; 3]| {
            let parts = seen.iter().zip(mean);
            -0.5 * parts.map(|(x, m)| (x - m) * (x - m)).sum::<f64>()
        };
        let ratio = |mean| (log_density(mean) - log_density([0.0; 3])).exp();
        let expected = (0.5 * (ratio(means[0]) + ratio(means[1]))).ln();
        let found = signature.log_ratio(&standardized(&seen));
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }

    #[test]
    fn evidence_is_averaged_and_never_negative() {
        let mut evidence = Evidence::default();
        evidence.take(-1e9, 0.1);
        assert!(evidence.log_ratio().abs() < 1e-12);
        for _ in 0..1000 {
            evidence.take(7.0, 0.1);
        }
        assert!((evidence.log_ratio() - 7.0).abs() < 1e-9);
        evidence.take(f64::INFINITY, 1e9);
        assert!((evidence.log_ratio() - LOG_RATIO_MAX).abs() < 1e-9);
    }

    #[test]
    fn signatures_of_other_channels_do_not_fit() {
        let of = |weights: usize, sd: f64, phases: usize| Signatures {
            mean: vec![0.0; 6],
            sd: vec![sd; 6],
            fault: vec![Signature {
                fault: "engine".to_owned(),
                runs: 1,
                phase: vec![
                    Phase {
                        weights: vec![0.0; weights],
                        offset: 0.0,
                    };
                    phases
                ],
            }],
        };
        assert!(of(6, 1.0, 4).fits(2) && Signatures::default().fits(2));
        assert!(!of(6, 1.0, 4).fits(3) && !of(5, 1.0, 4).fits(2));
        assert!(!of(6, 0.0, 4).fits(2) && !of(6, f64::NAN, 4).fits(2));
        assert!(!of(6, 1.0, 0).fits(2) && !of(6, 1.0, 9).fits(2));
        for wrong in [f64::NAN, f64::INFINITY, -1e10] {
            let mut signatures = of(6, 1.0, 1);
            signatures.fault[0].phase[0].weights[3] = wrong;
            assert!(!signatures.fits(2));
            let mut signatures = of(6, 1.0, 1);
            signatures.mean[0] = wrong;
            assert!(!signatures.fits(2));
        }
    }
}
