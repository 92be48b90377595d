//! The filter: order of the passes, ways out.

use std::f64::consts::LN_2;

use nalgebra::SVector;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::super::model::MODES_MAX;
use super::super::processor::{Level, Processor};
use super::super::steps::PARTICLES_MAX;
use super::super::vector::{Block, LANES};
use super::kernels::{Advance, Cloud, Found};
use super::model::{LinearModel, Observation};
use super::reference::Reference;
use crate::filter::{Event, Filter, Step};
use crate::gaussian::Gaussian;
use crate::hybrid::{Conditional, Modes};

/// The look-ahead filter for a [`LinearModel`]. All buffers are made once. Particles have equal
/// weights after each step.
///
/// A channel that is not finite is left out. With none left, or when nothing explains the others
/// (a distance of more than 1e9 standard deviations), the step is [`Event::Coasted`]; when a state
/// that nothing measures has grown beyond all numbers, the filter begins anew and says
/// [`Event::Restarted`].
///
/// Equal seeds and observations give equal bits, on every level with fused multiplication and
/// addition the same ones.
///
/// ```
/// use nalgebra::SMatrix;
/// use vigil_inference::filter::Filter;
/// use vigil_inference::lanes::linear::{
///     LaneLookAhead, LinearModel, LinearParameters, Observation,
/// };
///
/// // One wheel moves a position by 0.05 m a step, or is stuck.
/// let model = LinearModel::new(LinearParameters::<1, 1, 1> {
///     initial: vec![1.0, 0.0],
///     transition: vec![vec![0.99, 0.01], vec![0.01, 0.99]],
///     motion: SMatrix::identity(),
///     shift: vec![[0.05], [0.0]],
///     motion_noise: SMatrix::from([[1e-5]]),
///     observe: SMatrix::identity(),
///     offset: vec![[0.0]; 2],
///     sensor_noise: SMatrix::from([[1e-4]]),
///     rates: vec![[1.0], [0.0]],
///     rate_sd: [0.3],
///     start: [0.0],
///     start_covariance: SMatrix::from([[1e-4]]),
/// })?;
/// let mut filter = LaneLookAhead::new(model, 32, 7);
/// filter.step(&Observation { state: [0.01], rates: [0.1] });
/// filter.step(&Observation { state: [0.01], rates: [-0.1] });
/// assert!(filter.posterior()[1] > 0.99);
/// # Ok::<(), vigil_inference::lanes::ModelError>(())
/// ```
#[derive(Debug, Clone)]
pub struct LaneLookAhead<const N: usize, const M: usize, const W: usize> {
    model: LinearModel<N, M, W>,
    processor: Processor,
    level: Level,
    rng: Pcg64Mcg,
    reference: Reference<N>,
    cloud: Cloud<N>,
    posterior: [f64; MODES_MAX],
    left_out: usize,
}

impl<const N: usize, const M: usize, const W: usize> LaneLookAhead<N, M, W> {
    /// A filter on the highest level available. The number of `particles` is rounded up to a
    /// multiple of 16, and is at most [`PARTICLES_MAX`].
    #[must_use]
    pub fn new(model: LinearModel<N, M, W>, particles: usize, seed: u64) -> Self {
        let blocks = particles.clamp(1, PARTICLES_MAX).div_ceil(LANES);
        let level = Level::best();
        let mut filter = Self {
            processor: Processor::at_or_plain(level),
            level,
            rng: Pcg64Mcg::seed_from_u64(seed),
            reference: Reference {
                state: model.prior(0),
                mode: 0,
            },
            cloud: Cloud::new(blocks, model.modes()),
            posterior: [0.0; MODES_MAX],
            left_out: 0,
            model,
        };
        filter.reset();
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

    /// Distances of the particles from the reference.
    #[cfg(test)]
    pub(super) fn distances(&self) -> impl Iterator<Item = f32> {
        let blocks = self.cloud.state.iter().flatten();
        blocks.flat_map(|block| block.0)
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
    pub const fn model(&self) -> &LinearModel<N, M, W> {
        &self.model
    }

    /// Channels of the last observation that were left out: not finite, or all too far away.
    #[must_use]
    pub const fn left_out(&self) -> usize {
        self.left_out
    }

    /// Mode and mean of each particle; their weights are equal.
    pub fn particles(&self) -> impl Iterator<Item = (usize, SVector<f64, N>)> {
        (0..self.count()).map(|i| {
            let (block, lane) = (i / LANES, i % LANES);
            let apart = |n: usize, _| f64::from(self.cloud.state[n][block].0[lane]);
            let mean = self.reference.state.mean + SVector::from_fn(apart);
            (self.cloud.mode[block].0[lane] as usize, mean)
        })
    }

    /// Mean and covariance of the continuous state, over all modes.
    #[must_use]
    pub fn state(&self) -> Gaussian<N> {
        let share = 1.0 / self.count() as f64;
        let mean: SVector<f64, N> = self.particles().map(|(_, mean)| mean * share).sum();
        let mut covariance = self.reference.state.covariance;
        for (_, at) in self.particles() {
            covariance += (at - mean) * (at - mean).transpose() * share;
        }
        Gaussian { mean, covariance }
    }

    /// Begins anew, as there is nothing left to go on with.
    fn restart(&mut self) -> Step {
        self.reset();
        Step {
            log_evidence: 0.0,
            effective_sample_size: self.count() as f64,
            event: Some(Event::Restarted),
        }
    }

    /// Publishes the belief; the likeliest mode moves the reference.
    fn report(&mut self, found: &Found) {
        let mut best = self.reference.mode;
        let weights = found.modes.iter().take(self.model.modes());
        for (mode, (p, weight)) in self.posterior.iter_mut().zip(weights).enumerate() {
            *p = weight / found.total;
            if found.modes[mode] > found.modes[best] {
                best = mode;
            }
        }
        self.reference.mode = best;
    }
}

impl<const N: usize, const M: usize, const W: usize> Filter for LaneLookAhead<N, M, W> {
    type Observation = Observation<M, W>;

    fn step(&mut self, z: &Observation<M, W>) -> Step {
        let look = self.reference.look(&self.model, z);
        let coasted = look.as_ref().is_none_or(|(_, look)| look.left_out == M + W);
        let missing = || self.reference.look(&self.model, &Observation::MISSING);
        let Some((next, look)) = look.or_else(missing) else {
            return self.restart();
        };
        // Of 2^24 draws none is 0 or 1.
        let u = (f64::from(self.rng.random::<u32>() >> 8) + 0.5) / f64::from(1 << 24);
        let mut found = Found::NOTHING;
        self.processor.run(Advance {
            model: &self.model,
            differences: &self.model.differences[self.reference.mode],
            look: &look,
            cloud: &mut self.cloud,
            u,
            found: &mut found,
        });
        if !found.stays_finite {
            return self.restart();
        }
        self.reference = next;
        self.left_out = look.left_out;
        self.report(&found);
        let mean = found.total / self.count() as f64;
        let relative = LN_2 * f64::from(found.log2_unit) + mean.ln();
        Step {
            log_evidence: if coasted {
                0.0
            } else {
                look.log_density + relative
            },
            effective_sample_size: found.total * (found.total / found.squares),
            event: coasted.then_some(Event::Coasted),
        }
    }

    fn posterior(&self) -> &[f64] {
        &self.posterior[..self.model.modes()]
    }

    fn reset(&mut self) {
        let count = self.count();
        self.posterior.fill(0.0);
        for i in 0..count {
            // Evenly over the prior's cumulative probabilities.
            let mut left = (i as f64 + 0.5) / count as f64;
            let drawn = (0..self.model.modes()).find(|&mode| {
                left -= self.model.initial(mode);
                left < 0.0
            });
            let mode = drawn.unwrap_or(0);
            self.cloud.mode[i / LANES].0[i % LANES] = mode as u32;
            self.posterior[mode] += 1.0 / count as f64;
        }
        for state in &mut self.cloud.state {
            state.fill(Block::splat(0.0));
        }
        let mut best = 0;
        for (mode, p) in self.posterior.iter().enumerate() {
            if *p > self.posterior[best] {
                best = mode;
            }
        }
        self.reference = Reference {
            state: self.model.prior(best),
            mode: best,
        };
        self.left_out = 0;
    }
}
