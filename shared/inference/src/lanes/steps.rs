//! The filter: what happens in which order, and what is done when it goes wrong.

use std::mem::swap;

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::cloud::{Cloud, Sums};
use super::kernels::{Advance, Ancestry, Reweigh, Select};
use super::model::{MODES_MAX, PlanarModel};
use super::processor::{Level, Processor};
use super::random::Streams;
use super::vector::LANES;
use super::weighing::{Observation, Weighing};
use crate::angle::wrap;
use crate::filter;

/// Particles at most: slots are counted in single precision within a block.
pub const PARTICLES_MAX: usize = 4_000_000;

/// Particles are moved by two registers at a time.
const PARTICLES_STEP: usize = 2 * LANES;

/// The weights are relative to the best mode at the measured pose. If they sum to less than this,
/// they are computed once more relative to the best particle: the loss of a single one's bits
/// would matter.
const SUM_MIN: f64 = 1e-20;

/// Base-2 logarithm of the best particle's likelihood, relative as above, below which single
/// precision does not tell particles apart to half a unit.
const LOG2_HOPELESS: f32 = -4e6;

/// Coasted steps in a row after which the poses are drawn anew around the measured one. As
/// `bootstrap::COASTED_MAX`.
const COASTED_MAX: u32 = 5;

/// A particle filter for a [`PlanarModel`]: single precision, 16 lanes, made for speed. All
/// buffers are made once.
///
/// Equal seeds and observations give equal bits, on every level with fused multiplication and
/// addition the same ones. For other models see [`bootstrap`](crate::bootstrap).
///
/// ```
/// use vigil_inference::lanes::{LaneFilter, Observation, PlanarModel, PlanarParameters};
///
/// let model = PlanarModel::new(&PlanarParameters {
///     initial: vec![1.0, 0.0],
///     transition: vec![vec![0.99, 0.01], vec![0.0, 1.0]],
///     motion: vec![[0.05, 0.0, 0.0], [0.04, 0.0, 0.02]],
///     motion_sd: [0.002; 3],
///     pose_sd: [0.005; 3],
///     wheel_rates: vec![vec![1.0], vec![0.0]],
///     wheel_rate_sd: 0.3,
///     start: [0.0; 3],
///     start_sd: [0.01; 3],
/// })?;
/// let mut filter = LaneFilter::new(model, 1000, 7);
/// let mut z = Observation { pose: [0.05, 0.0, 0.0], ..Observation::MISSING };
/// z.wheel_rates[0] = 1.02;
/// filter.step(&z);
/// assert!(filter.posterior()[0] > 0.99);
/// # Ok::<(), vigil_inference::lanes::ModelError>(())
/// ```
#[derive(Debug, Clone)]
pub struct LaneFilter {
    model: PlanarModel,
    processor: Processor,
    level: Level,
    /// Share of the particles; 1 resamples in every step.
    threshold: f64,
    /// For what is drawn once a step or less.
    rng: Pcg64Mcg,
    streams: Streams,
    cloud: Cloud,
    ancestry: Ancestry,
    /// Base-2 logarithm of the mean weight that the particles bring along: what rounding left.
    log2_brought: f64,
    posterior: [f64; MODES_MAX],
    pose: [f64; 3],
    coasted: u32,
}

/// What the filter says about one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Estimate of `ln p(z_t | z_1 .. z_{t-1})` for the channels in use; 0 for a step that was
    /// not updated.
    pub log_evidence: f64,
    /// `1 / Σ W²`, before resampling.
    pub effective_sample_size: f64,
    /// What was out of the ordinary, the gravest only.
    pub event: Option<Event>,
}

/// A step that took another way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Event {
    /// A channel is not finite or out of range and was left out.
    NotFinite,
    /// All weights were tiny and were computed again relative to the largest.
    Redone,
    /// No particle explains the observation, or no channel is usable: predicted, not updated.
    Coasted,
    /// The same so often in a row that the poses were drawn anew around the measured one, and the
    /// modes from the prior.
    Restarted,
}

impl LaneFilter {
    /// A filter that resamples in every step, on the highest level available. The number of
    /// `particles` is rounded up to a multiple of 32, and is at most [`PARTICLES_MAX`].
    #[must_use]
    pub fn new(model: PlanarModel, particles: usize, seed: u64) -> Self {
        let count = particles.clamp(1, PARTICLES_MAX);
        let bundles = count.next_multiple_of(PARTICLES_STEP) / LANES;
        let level = Level::best();
        let (start, sd) = (model.start, model.start_sd);
        let mut filter = Self {
            processor: Processor::at_or_plain(level),
            level,
            threshold: 1.0,
            rng: Pcg64Mcg::seed_from_u64(seed),
            streams: Streams::new(seed),
            cloud: Cloud::new(bundles),
            ancestry: Ancestry::Same { offset: 0.0 },
            log2_brought: 0.0,
            posterior: model.initial,
            pose: start,
            coasted: 0,
            model,
        };
        filter.scatter(start, sd);
        filter
    }

    /// The same filter on another level; none if this processor lacks it.
    #[must_use]
    pub fn at_level(mut self, level: Level) -> Option<Self> {
        self.processor = Processor::at(level)?;
        self.level = level;
        Some(self)
    }

    /// The same filter on a processor of the tests.
    #[cfg(test)]
    pub(super) fn on(mut self, processor: Processor) -> Self {
        self.processor = processor;
        self
    }

    /// The same filter, resampling only when the effective sample size falls below this share of
    /// the particles, 0 to 1.
    #[must_use]
    pub fn resampling_below(mut self, share: f64) -> Self {
        self.threshold = share;
        if !self.resamples_always() {
            self.cloud.keep_logs();
        }
        self
    }

    /// Particles.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.cloud.count()
    }

    /// The level in use.
    #[must_use]
    pub const fn level(&self) -> Level {
        self.level
    }

    /// The model.
    #[must_use]
    pub const fn model(&self) -> &PlanarModel {
        &self.model
    }

    /// Posterior probability of each mode after the last step, before resampling: finite, and its
    /// sum is 1.
    #[must_use]
    pub fn posterior(&self) -> &[f64] {
        &self.posterior[..self.model.modes]
    }

    /// Posterior mean of x m, y m, yaw rad (within ±π) after the last step, before resampling.
    #[must_use]
    pub const fn pose(&self) -> [f64; 3] {
        self.pose
    }

    /// Draws a mode, moves, weighs, resamples. Allocates nothing.
    pub fn step(&mut self, z: &Observation) -> Step {
        let mut weighing = Weighing::new(&self.model, z, self.pose);
        let mut event = (weighing.missing > 0).then_some(Event::NotFinite);
        let usable = weighing.used > 0 && weighing.log_best.is_finite();
        if !usable {
            weighing = Weighing::nothing(self.pose);
            event = Some(Event::Coasted);
        }
        let mut sums = self.advance(&weighing);
        let mut unit = 0.0;
        // Not a number is not enough either.
        let is_enough = sums.weight >= SUM_MIN;
        if !is_enough {
            (sums, unit) = self.reweigh(&weighing);
            event = Some(Event::Redone);
            if unit < LOG2_HOPELESS {
                weighing = Weighing::nothing(self.pose);
                (sums, unit) = self.reweigh(&weighing);
                event = Some(Event::Coasted);
            }
        }
        let coasted = event == Some(Event::Coasted);
        self.coasted = if coasted { self.coasted + 1 } else { 0 };
        let count = self.count() as f64;
        let log2_mean = (sums.weight / count).log2() + f64::from(unit);
        let log2_evidence = log2_mean - self.log2_brought;
        let log_evidence = weighing.log_best + log2_evidence * std::f64::consts::LN_2;
        let effective_sample_size = sums.weight * sums.weight / sums.squares;
        self.report(&weighing, &sums);
        self.hand_over(&sums, log2_mean, effective_sample_size);
        if self.coasted >= COASTED_MAX && self.restart(z) {
            event = Some(Event::Restarted);
        }
        Step {
            log_evidence: if coasted { 0.0 } else { log_evidence },
            effective_sample_size,
            event,
        }
    }

    fn advance(&mut self, weighing: &Weighing) -> Sums {
        let mut sums = Sums::ZERO;
        self.processor.run(Advance {
            model: &self.model,
            weighing,
            ancestry: self.ancestry,
            cloud: &mut self.cloud,
            streams: &mut self.streams,
            sums: &mut sums,
        });
        swap(&mut self.cloud.bundles, &mut self.cloud.next);
        sums
    }

    fn reweigh(&mut self, weighing: &Weighing) -> (Sums, f32) {
        let (mut sums, mut unit) = (Sums::ZERO, 0.0);
        self.processor.run(Reweigh {
            weighing,
            ancestry: self.ancestry,
            cloud: &mut self.cloud,
            sums: &mut sums,
            unit: &mut unit,
        });
        (sums, unit)
    }

    /// Publishes the belief.
    fn report(&mut self, weighing: &Weighing, sums: &Sums) {
        let total: f64 = sums.modes.iter().sum();
        for (p, weight) in self.posterior.iter_mut().zip(sums.modes) {
            *p = weight / total;
        }
        for (axis, distance) in sums.distance.iter().enumerate() {
            self.pose[axis] = f64::from(weighing.reference[axis]) - distance / sums.weight;
        }
        self.pose[2] = wrap(self.pose[2]);
    }

    /// Prepares the particles for the next step: selects them, or keeps their weights.
    fn hand_over(&mut self, sums: &Sums, log2_mean: f64, effective_sample_size: f64) {
        let few = effective_sample_size < self.threshold * self.count() as f64;
        if few || self.resamples_always() {
            // Of 2^24 draws none is 0 or 1.
            let u = (f64::from(self.rng.random::<u32>() >> 8) + 0.5) / f64::from(1 << 24);
            self.processor.run(Select {
                cloud: &mut self.cloud,
                total: sums.weight,
                u,
            });
            self.ancestry = Ancestry::Selected;
            self.log2_brought = 0.0;
        } else {
            swap(&mut self.cloud.logs, &mut self.cloud.next_logs);
            let offset = log2_mean as f32;
            self.ancestry = Ancestry::Same { offset };
            self.log2_brought = log2_mean - f64::from(offset);
        }
    }

    fn resamples_always(&self) -> bool {
        self.threshold >= 1.0 || self.threshold.is_nan()
    }

    /// Draws all particles anew around a measured pose, if there is one.
    fn restart(&mut self, z: &Observation) -> bool {
        let pose = [z.pose[0], z.pose[1], wrap(z.pose[2])];
        let known = pose
            .iter()
            .all(|at| at.abs() <= super::model::MAGNITUDE_MAX);
        if known {
            self.scatter(pose, self.model.pose_sd);
        }
        known
    }

    /// Draws all particles from the prior over modes and around a pose, with equal weights.
    fn scatter(&mut self, pose: [f64; 3], sd: [f64; 3]) {
        let initial = self.model.initial;
        for bundle in &mut self.cloud.bundles {
            for lane in 0..LANES {
                let mut left: f64 = self.rng.random();
                let mode = initial.iter().position(|p| {
                    left -= p;
                    left < 0.0
                });
                let [x, y, yaw] = std::array::from_fn(|axis| {
                    pose[axis] + sd[axis] * self.rng.sample::<f64, _>(StandardNormal)
                });
                bundle.mode.0[lane] = mode.unwrap_or(0) as u32;
                bundle.x.0[lane] = x as f32;
                bundle.y.0[lane] = y as f32;
                bundle.yaw.0[lane] = wrap(yaw) as f32;
            }
        }
        self.cloud.forget();
        self.ancestry = Ancestry::Same { offset: 0.0 };
        self.log2_brought = 0.0;
        self.posterior = initial;
        self.pose = [pose[0], pose[1], wrap(pose[2])];
        self.coasted = 0;
    }
}

impl filter::Filter for LaneFilter {
    type Observation = Observation;

    fn step(&mut self, z: &Observation) -> filter::Step {
        let step = Self::step(self, z);
        filter::Step {
            log_evidence: step.log_evidence,
            effective_sample_size: step.effective_sample_size,
            event: match step.event {
                Some(Event::Coasted) => Some(filter::Event::Coasted),
                Some(Event::Restarted) => Some(filter::Event::Restarted),
                Some(Event::NotFinite | Event::Redone) | None => None,
            },
        }
    }

    fn posterior(&self) -> &[f64] {
        Self::posterior(self)
    }

    fn reset(&mut self) {
        self.scatter(self.model.start, self.model.start_sd);
    }
}
