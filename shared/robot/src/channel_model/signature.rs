//! What labelled runs showed of a declared fault, and how much the last seconds look like it.
//!
//! The whitened residuals of each channel are averaged over the last 0.5, 2 and 4 s. A fault that
//! has begun moves these means in a way that changes with its age, so a signature has a few phases.
//! What it does also depends on what is commanded: the mean of a phase is `Mb`, with `b` a one and
//! the command. The evidence of a phase is `bᵀMᵀC⁻¹v - ½ bᵀMᵀC⁻¹Mb` for means `v` and a covariance
//! `C` (Fisher's discriminant): the log-likelihood ratio of two Gaussian laws with one covariance.
//! Successive ratios are of the same residuals, so they are averaged over time and never summed.

use serde::{Deserialize, Serialize};
use vigil_checkpoint::CheckpointValue;

use super::law::BLOCKS;
use super::observation::{Observation, SMOOTHING_S};
use super::window::Window;
use super::{AXES, CHANNELS_MAX};
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
/// The most that it says among faults, nats.
const UNBOUNDED_MAX: f64 = 1e6;
/// Time constant over which ratios are averaged, s.
const AVERAGE_S: f64 = 0.35;

/// Means of so many channels.
#[must_use]
pub const fn means_count(channels: usize) -> usize {
    SPANS.len() * channels
}

/// Means of the whitened residuals of all channels, span by span; missing ones are 0.
pub type Means = [f64; MEANS_MAX];
/// Terms of a command: a one, and its axes relative to their sizes; 0 for those that are not there.
pub type Terms = [f64; 1 + AXES];

/// The terms of the command of the last two seconds, whose axes have these sizes.
#[must_use]
pub fn terms(now: &Observation, sizes: &[f64; AXES]) -> Terms {
    let command = &now.smoothed[SMOOTHING_S.len() - 1];
    std::array::from_fn(|term| match term {
        0 => 1.0,
        axis => command[axis - 1] / sizes[axis - 1],
    })
}

/// What the last seconds show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Features {
    /// Means as deviations from those of a healthy robot.
    pub means: Means,
    /// The command in which they were seen.
    pub terms: Terms,
}

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
    /// Weight of each standardized mean, by the terms of the command.
    pub weights: Vec<Vec<f64>>,
    /// Square of the fault's own mean, by pairs of terms.
    pub squares: Vec<Vec<f64>>,
}

impl Phase {
    /// True if it is of this many means.
    fn fits(&self, means: usize) -> bool {
        let terms = self.weights.len();
        let is_sane = |value: &f64| value.abs() <= NUMBER_MAX;
        let are = |rows: &[Vec<f64>], length: usize| {
            let is_row = |row: &Vec<f64>| row.len() == length && row.iter().all(is_sane);
            rows.len() == terms && rows.iter().all(is_row)
        };
        (1..=1 + AXES).contains(&terms) && are(&self.weights, means) && are(&self.squares, terms)
    }

    /// Log-likelihood ratio of the fault, in this phase, to health.
    fn log_ratio(&self, seen: &Features) -> f64 {
        let dot = |row: &[f64], with: &[f64]| row.iter().zip(with).map(|(a, b)| a * b).sum::<f64>();
        let rows = self.weights.iter().zip(&self.squares).zip(&seen.terms);
        rows.map(|((weights, squares), term)| {
            term * (dot(weights, &seen.means) - 0.5 * dot(squares, &seen.terms))
        })
        .sum()
    }
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
        let is_whole = |one: &Signature| {
            let phases = one.phase.len();
            (1..=PHASES_MAX).contains(&phases) && one.phase.iter().all(|phase| phase.fits(n))
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
    pub fn log_ratio(&self, seen: &Features) -> f64 {
        let of = |phase: &Phase| phase.log_ratio(seen);
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
#[derive(Debug, Clone, Copy, Default, PartialEq, CheckpointValue)]
pub struct Evidence {
    log_ratio: f64,
    /// The same of ratios that are not bounded.
    unbounded: f64,
}

impl Evidence {
    /// Takes the ratio of an observation of this length.
    pub fn take(&mut self, log_ratio: f64, dt_s: f64) {
        let keep = (-dt_s / AVERAGE_S).exp();
        let averaged = |before: f64, most: f64| {
            let ratio = log_ratio.clamp(-LOG_RATIO_MAX, most);
            (keep * before + (1.0 - keep) * ratio).max(0.0)
        };
        self.log_ratio = averaged(self.log_ratio, LOG_RATIO_MAX);
        self.unbounded = averaged(self.unbounded, UNBOUNDED_MAX);
    }

    /// The evidence, nats.
    #[must_use]
    pub const fn log_ratio(&self) -> f64 {
        self.log_ratio
    }

    /// The same of ratios without a bound: among faults.
    #[must_use]
    pub const fn unbounded(&self) -> f64 {
        self.unbounded
    }

    /// What it lacks because each ratio is bounded, nats: beside health that is as good as
    /// certain, but not among faults.
    #[must_use]
    pub const fn beyond_bound(&self) -> f64 {
        self.unbounded - self.log_ratio
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(values: &[f64], terms: Terms) -> Features {
        let mut means = [0.0; MEANS_MAX];
        means[..values.len()].copy_from_slice(values);
        Features { means, terms }
    }

    #[test]
    fn evidence_is_the_ratio_of_two_gaussian_laws_averaged_over_phases() {
        // One channel; the means are independent and of unit variance. In each phase what a fault
        // does without a command, and what each unit of the first axis adds to it.
        let phases = [
            [[1.0, 2.0, 0.5], [0.5, -1.0, 0.0]],
            [[-1.0, 0.0, 3.0], [0.0, 2.0, 1.0]],
        ];
        let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum();
        let phase = |rows: [[f64; 3]; 2]| Phase {
            weights: rows.map(|row| row.to_vec()).to_vec(),
            squares: rows.map(|a| rows.map(|b| dot(&a, &b)).to_vec()).to_vec(),
        };
        let signature = Signature {
            fault: "engine".to_owned(),
            runs: 2,
            phase: phases.map(phase).to_vec(),
        };
        let values = [0.3, 1.8, 0.1];
        for command in [0.0, 0.4, -1.0] {
            let ratio = |rows: [[f64; 3]; 2]| {
                let mean = |i: usize| rows[0][i] + command * rows[1][i];
                let squares = |i: usize| values[i] * values[i] - (values[i] - mean(i)).powi(2);
                (0..3).map(|i| 0.5 * squares(i)).sum::<f64>().exp()
            };
            let expected = (0.5 * (ratio(phases[0]) + ratio(phases[1]))).ln();
            let terms = [1.0, command, 0.0, 0.0, 0.0];
            let found = signature.log_ratio(&seen(&values, terms));
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
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
                        weights: vec![vec![0.0; weights]; 2],
                        squares: vec![vec![0.0; 2]; 2],
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
            signatures.fault[0].phase[0].weights[1][3] = wrong;
            assert!(!signatures.fits(2));
            let mut signatures = of(6, 1.0, 1);
            signatures.fault[0].phase[0].squares[0][1] = wrong;
            assert!(!signatures.fits(2));
            let mut signatures = of(6, 1.0, 1);
            signatures.mean[0] = wrong;
            assert!(!signatures.fits(2));
        }
    }
}
