//! Linear models whose modes differ by shifts only.

use nalgebra::{Cholesky, SMatrix, SVector};

use super::super::model::{
    MAGNITUDE_MAX, MEASUREMENT_SD_MIN, MODES_MAX, ModelError, distribution, in_range, length,
};
use super::super::vector::Block;
use crate::gaussian::Gaussian;
use crate::hybrid::{Conditional, Modes};
use crate::logspace::log_normal;

/// Base-2 logarithm that stands for a probability of 0; keeps the arithmetic finite.
const LOG2_IMPOSSIBLE: f32 = -1e30;

/// Distances are in units in which half a square is a binary digit.
pub(super) const ROOT_LOG2_E: f64 = 1.201_122_408_786_449_8;

/// What is told about a system of N continuous dimensions, M measurements of them and W
/// measurements of the mode alone; [`LinearModel::new`] checks it. The module's page has the
/// equations.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearParameters<const N: usize, const M: usize, const W: usize> {
    /// Probability of each mode before the first step; sums to 1.
    pub initial: Vec<f64>,
    /// Row by row the probabilities of the next mode; each row sums to 1.
    pub transition: Vec<Vec<f64>>,
    /// A.
    pub motion: SMatrix<f64, N, N>,
    /// b of each mode.
    pub shift: Vec<[f64; N]>,
    /// Q.
    pub motion_noise: SMatrix<f64, N, N>,
    /// H.
    pub observe: SMatrix<f64, M, N>,
    /// h of each mode.
    pub offset: Vec<[f64; M]>,
    /// R.
    pub sensor_noise: SMatrix<f64, M, M>,
    /// For each mode the means of what is measured of the mode alone, such as wheel rates.
    pub rates: Vec<[f64; W]>,
    /// Their standard deviations.
    pub rate_sd: [f64; W],
    /// Mean before the first step.
    pub start: [f64; N],
    /// Covariance before the first step.
    pub start_covariance: SMatrix<f64, N, N>,
}

/// What is measured in one step. The filter on lanes leaves out what is not finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation<const M: usize, const W: usize> {
    /// z.
    pub state: [f64; M],
    /// w.
    pub rates: [f64; W],
}

impl<const M: usize, const W: usize> Observation<M, W> {
    /// Nothing measured.
    pub const MISSING: Self = Self {
        state: [f64::NAN; M],
        rates: [f64::NAN; W],
    };
}

/// By how much each mode differs from one of them; a lane for each mode.
#[derive(Debug, Clone)]
pub(super) struct Differences<const N: usize, const M: usize, const W: usize> {
    /// Of b.
    pub shift: [Block<f32>; N],
    /// Of H b + h.
    pub offset: [Block<f32>; M],
    /// Of the mean rates, in units of their standard deviations and [`ROOT_LOG2_E`].
    pub rates: [Block<f32>; W],
}

/// A checked model, with its tables as the kernels read them.
#[derive(Debug, Clone)]
pub struct LinearModel<const N: usize, const M: usize, const W: usize> {
    pub(super) parameters: LinearParameters<N, M, W>,
    /// Base-2 logarithm of the probability of each mode, by the mode before.
    pub(super) log_p: Vec<Block<f32>>,
    /// `ln √(2π sd²)` of each rate.
    pub(super) log_rate_scale: [f64; W],
    /// For each mode the differences from it.
    pub(super) differences: Vec<Differences<N, M, W>>,
}

impl<const N: usize, const M: usize, const W: usize> LinearModel<N, M, W> {
    /// Checks `p` and prepares the tables.
    ///
    /// # Errors
    /// [`ModelError`], naming the field, what it holds and what is allowed.
    pub fn new(p: LinearParameters<N, M, W>) -> Result<Self, ModelError> {
        let modes = p.initial.len();
        if !(1..=MODES_MAX).contains(&modes) {
            return Err(ModelError::Modes { found: modes });
        }
        distribution("initial", 0, &p.initial, modes)?;
        length("transition", p.transition.len(), modes)?;
        length("shift", p.shift.len(), modes)?;
        length("offset", p.offset.len(), modes)?;
        length("rates", p.rates.len(), modes)?;
        in_range("motion", p.motion.as_slice(), -MAGNITUDE_MAX)?;
        in_range("shift", p.shift.as_flattened(), -MAGNITUDE_MAX)?;
        in_range("observe", p.observe.as_slice(), -MAGNITUDE_MAX)?;
        in_range("offset", p.offset.as_flattened(), -MAGNITUDE_MAX)?;
        in_range("rates", p.rates.as_flattened(), -MAGNITUDE_MAX)?;
        in_range("rate_sd", &p.rate_sd, MEASUREMENT_SD_MIN)?;
        in_range("start", &p.start, -MAGNITUDE_MAX)?;
        covariance("motion_noise", &p.motion_noise, 0.0)?;
        covariance("sensor_noise", &p.sensor_noise, MEASUREMENT_SD_MIN)?;
        covariance("start_covariance", &p.start_covariance, 0.0)?;
        let mut log_p = vec![Block::splat(LOG2_IMPOSSIBLE); modes];
        for (from, next) in p.transition.iter().enumerate() {
            let next = distribution("transition", from, next, modes)?;
            for (to, next) in log_p.iter_mut().zip(next) {
                to.0[from] = (next.log2() as f32).max(LOG2_IMPOSSIBLE);
            }
        }
        let differences = (0..modes).map(|from| differences(&p, from)).collect();
        Ok(Self {
            log_rate_scale: p.rate_sd.map(|sd| -log_normal(0.0, sd * sd)),
            parameters: p,
            log_p,
            differences,
        })
    }

    /// What was told.
    #[must_use]
    pub const fn parameters(&self) -> &LinearParameters<N, M, W> {
        &self.parameters
    }

    /// `ln` of the density of the rates in `mode`.
    fn log_rates(&self, mode: usize, rates: &[f64; W]) -> f64 {
        let means = rates.iter().zip(&self.parameters.rates[mode]);
        means
            .zip(&self.parameters.rate_sd)
            .map(|((z, mean), sd)| log_normal(z - mean, sd * sd))
            .sum()
    }
}

/// Differences of all modes from `from`.
fn differences<const N: usize, const M: usize, const W: usize>(
    p: &LinearParameters<N, M, W>,
    from: usize,
) -> Differences<N, M, W> {
    let mut found = Differences {
        shift: [Block::splat(0.0); N],
        offset: [Block::splat(0.0); M],
        rates: [Block::splat(0.0); W],
    };
    for mode in 0..p.initial.len() {
        let shift = SVector::from(p.shift[mode]) - SVector::from(p.shift[from]);
        let offset = SVector::from(p.offset[mode]) - SVector::from(p.offset[from]);
        let seen = p.observe * shift + offset;
        for (to, shift) in found.shift.iter_mut().zip(&shift) {
            to.0[mode] = *shift as f32;
        }
        for (to, seen) in found.offset.iter_mut().zip(&seen) {
            to.0[mode] = *seen as f32;
        }
        for (w, to) in found.rates.iter_mut().enumerate() {
            let apart = (p.rates[mode][w] - p.rates[from][w]) / p.rate_sd[w];
            to.0[mode] = (ROOT_LOG2_E * apart) as f32;
        }
    }
    found
}

/// Symmetric, and nowhere less than `sd_min` squared.
fn covariance<const N: usize>(
    table: &'static str,
    found: &SMatrix<f64, N, N>,
    sd_min: f64,
) -> Result<(), ModelError> {
    in_range(table, found.as_slice(), -MAGNITUDE_MAX)?;
    let largest = (0..N).map(|i| found[(i, i)]).fold(0.0, f64::max);
    let margin = if sd_min > 0.0 {
        -sd_min * sd_min * (1.0 - 1e-9)
    } else {
        // Variances may be 0: the rounding of a factorisation must not refuse them.
        1e-12 * largest + f64::MIN_POSITIVE
    };
    let raised = found + SMatrix::identity() * margin;
    let symmetric = (found - found.transpose()).abs().max() <= 1e-12 * largest;
    if N == 0 || (symmetric && Cholesky::new(raised).is_some()) {
        Ok(())
    } else {
        Err(ModelError::Covariance { table })
    }
}

impl<const N: usize, const M: usize, const W: usize> Modes for LinearModel<N, M, W> {
    fn modes(&self) -> usize {
        self.parameters.initial.len()
    }

    fn initial(&self, mode: usize) -> f64 {
        self.parameters.initial[mode]
    }

    fn transition(&self, from: usize, to: usize) -> f64 {
        self.parameters.transition[from][to]
    }
}

/// The same model for the filters in double precision; there an observation with a channel that
/// is not finite is impossible.
impl<const N: usize, const M: usize, const W: usize> Conditional<N> for LinearModel<N, M, W> {
    type Observation = Observation<M, W>;

    fn prior(&self, _mode: usize) -> Gaussian<N> {
        Gaussian {
            mean: SVector::from(self.parameters.start),
            covariance: self.parameters.start_covariance,
        }
    }

    fn predict(&self, mode: usize, state: &mut Gaussian<N>) {
        let p = &self.parameters;
        state.predict(&p.motion, &SVector::from(p.shift[mode]), &p.motion_noise);
    }

    fn update(&self, mode: usize, state: &mut Gaussian<N>, z: &Observation<M, W>) -> Option<f64> {
        let p = &self.parameters;
        let rates = self.log_rates(mode, &z.rates);
        if !rates.is_finite() {
            return None;
        }
        let expected = p.observe * state.mean + SVector::from(p.offset[mode]);
        let innovation = SVector::from(z.state) - expected;
        let seen = state.update(&innovation, &p.observe, &p.sensor_noise);
        seen.map(|log_density| log_density + rates)
    }
}
