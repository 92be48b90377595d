//! Weighted hypotheses as they travel: what a filter believes, and its reader starts from.

use crate::block::block;
use crate::header::{Cause, Header};
use crate::layout::part;
use crate::sensor::WHEELS;

/// Largest number of hypotheses in a block.
pub const PARTICLE_CAPACITY: usize = 1024;

part! {
/// What the detector believes of the robot as long as it is healthy. Zero where it tracks no pose.
/// Covariances hold the upper triangle, row by row.
pub struct HealthyBelief, size 296 {
    /// Pose: x m, y m, yaw rad.
    pub pose: [f64; 3],
    /// Its covariance.
    pub pose_covariance: [f64; 6],
    /// What the motion departs from its model by where the robot drives, per metre: yaw rad/m,
    /// forward, lateral. While a fault is suspected: from before it.
    pub deviation: [f64; 3],
    /// Its covariance.
    pub deviation_covariance: [f64; 6],
    /// Direction of travel that the deviation is of: 1 forwards, -1 backwards, 0 any.
    pub direction: f64,
    /// Share of their rates that all wheels depart by together: mean and variance.
    pub wheel_ratio: [f64; 2],
    /// Rate by which each wheel departs beside that, rad/s.
    pub wheel_offset: [f64; WHEELS],
    /// Its variance.
    pub wheel_offset_variance: [f64; WHEELS],
}
}

part! {
/// One hypothesis, or one particle of a sampled filter.
pub struct WeightedHypothesis, size 104 {
    /// Set of faults: bit i is node i of the fault tree (always a leaf); 0 is none, or unknown.
    pub leaves: u64,
    /// Since when it holds, capture time ns; 0 for nominal, and where no alarm stands.
    pub onset_t_capture_ns: u64,
    /// Mean pose: x m, y m, yaw rad (not wrapped). Zero where no pose is tracked.
    pub pose: [f64; 3],
    /// Its covariance: upper triangle, row by row; zero for a sampled particle.
    pub pose_covariance: [f64; 6],
    /// Natural logarithm of its probability.
    pub log_weight: f64,
    /// Index into the fault tree's nodes (0 is nominal), [`crate::MODE_UNKNOWN`] or
    /// [`crate::MODE_MULTIPLE`].
    pub mode: u32,
    /// Reserved, zero.
    pub reserved: u32,
}
}

block! {
    /// Weighted hypotheses of a filter, or the particles of a sampled one, published every cycle:
    /// what the writer believes, nothing drawn. The detector's are nominal and unknown. Before an
    /// identification the identifier repeats them; then its own follow, of motion and encoders: the
    /// most probable first, as many as there is room for. What is left out is left out: weights are
    /// not scaled up for it.
    pub struct ParticleBlock, size 106872 {
        /// Common header.
        pub header: Header,
        /// The journal entry behind these hypotheses.
        pub cause: Cause,
        /// Hypotheses in use; the rest of the array is unspecified.
        pub count: u32,
        /// Reserved, zero.
        pub reserved: u32,
        /// What an identification starts from; zero while one is under way.
        pub healthy: HealthyBelief,
        /// The hypotheses.
        pub hypotheses: [WeightedHypothesis; PARTICLE_CAPACITY],
    }
}

impl ParticleBlock {
    /// The hypotheses in use.
    #[must_use]
    pub fn used(&self) -> &[WeightedHypothesis] {
        &self.hypotheses[..(self.count as usize).min(PARTICLE_CAPACITY)]
    }
}
