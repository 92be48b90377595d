//! What all particles share: a Kalman filter, in double precision, that moves as one mode does.

use std::f64::consts::TAU;

use nalgebra::{Cholesky, SMatrix, SVector};

use super::model::{LinearModel, Observation, ROOT_LOG2_E};
use crate::gaussian::Gaussian;

/// Distance of an observation from the reference, in standard deviations, beyond which nothing
/// explains it: single precision could overflow.
const DISTANCE_MAX: f64 = 1e9;

/// The particles' covariance, and the mean from which their distances count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Reference<const N: usize> {
    pub state: Gaussian<N>,
    /// The mode in which it moves: the likeliest.
    pub mode: usize,
}

/// One step, as the kernels read it; names as on the module's page. Distances in the space of
/// observations are in units of [`ROOT_LOG2_E`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Look<const N: usize, const M: usize, const W: usize> {
    /// y.
    pub innovation: [f32; M],
    /// V; a column of zeros for what is left out.
    pub whiten: [[f32; M]; M],
    /// V H A.
    pub sight: [[f32; N]; M],
    /// B.
    pub back: [[f32; M]; N],
    /// A - B V H A.
    pub motion: [[f32; N]; N],
    /// Distance of each rate from the reference mode's; none for what is left out.
    pub rates: [Option<f32>; W],
    /// `ln N(z; *, 0)`, for the channels in use.
    pub log_density: f64,
    /// Channels left out.
    pub left_out: usize,
}

impl<const N: usize> Reference<N> {
    /// The reference one step later, and what the particles need to follow. None if it leaves the
    /// range of numbers, or the observation is too far from it.
    pub(super) fn look<const M: usize, const W: usize>(
        &self,
        model: &LinearModel<N, M, W>,
        z: &Observation<M, W>,
    ) -> Option<(Self, Look<N, M, W>)> {
        let p = &model.parameters;
        let mut next = self.state;
        next.predict(
            &p.motion,
            &SVector::from(p.shift[self.mode]),
            &p.motion_noise,
        );
        let mut observe = p.observe;
        let expected = observe * next.mean + SVector::from(p.offset[self.mode]);
        let mut innovation = SVector::from(z.state) - expected;
        let mut noise = p.sensor_noise;
        let used = z.state.map(f64::is_finite);
        for m in (0..M).filter(|&m| !used[m]) {
            // A measurement of nothing, with noise of its own.
            observe.row_mut(m).fill(0.0);
            noise.row_mut(m).fill(0.0);
            noise.column_mut(m).fill(0.0);
            (noise[(m, m)], innovation[m]) = (1.0, 0.0);
        }
        let cross = next.covariance * observe.transpose();
        let factor = Cholesky::new(observe * cross + noise)?;
        let factor = factor.l_dirty();
        let mut whiten = inverse_lower(factor);
        let back = cross * whiten.transpose();
        let sight = whiten * observe * p.motion;
        let distance = whiten * innovation;
        next.mean += back * distance;
        let covariance = next.covariance - back * back.transpose();
        next.covariance = 0.5 * (covariance + covariance.transpose());
        for m in (0..M).filter(|&m| !used[m]) {
            whiten[(m, m)] = 0.0;
        }
        let rates = self.rates(model, &z.rates);
        let channels = used.iter().filter(|&&used| used).count();
        let determinant: f64 = (0..M).map(|m| factor[(m, m)]).product();
        let square = distance.norm_squared() + channels as f64 * TAU.ln();
        let log_density = rates.log_density - 0.5 * square - determinant.ln();
        let mut known = next.mean.iter().chain(&next.covariance);
        let fits = distance.amax().max(rates.farthest) <= DISTANCE_MAX && log_density.is_finite();
        if !(fits && known.all(|value| value.is_finite())) {
            return None;
        }
        let look = Look {
            innovation: std::array::from_fn(|m| (ROOT_LOG2_E * distance[m]) as f32),
            whiten: rows(&(whiten * ROOT_LOG2_E)),
            sight: rows(&(sight * ROOT_LOG2_E)),
            back: rows(&(back / ROOT_LOG2_E)),
            motion: rows(&(p.motion - back * sight)),
            rates: rates.apart,
            log_density,
            left_out: M - channels + rates.left_out,
        };
        let (state, mode) = (next, self.mode);
        Some((Self { state, mode }, look))
    }

    /// What is measured of the mode alone, as the reference's mode expects it.
    fn rates<const M: usize, const W: usize>(
        &self,
        model: &LinearModel<N, M, W>,
        rates: &[f64; W],
    ) -> Rates<W> {
        let p = &model.parameters;
        let mut found = Rates {
            apart: [None; W],
            farthest: 0.0,
            log_density: 0.0,
            left_out: 0,
        };
        for (w, z) in rates.iter().enumerate() {
            if z.is_finite() {
                let apart = (z - p.rates[self.mode][w]) / p.rate_sd[w];
                found.apart[w] = Some((ROOT_LOG2_E * apart) as f32);
                found.farthest = found.farthest.max(apart.abs());
                found.log_density -= 0.5 * apart * apart + model.log_rate_scale[w];
            } else {
                found.left_out += 1;
            }
        }
        found
    }
}

/// The part of an observation that knows the mode only.
struct Rates<const W: usize> {
    /// See [`Look::rates`].
    apart: [Option<f32>; W],
    /// The largest of these distances, in standard deviations.
    farthest: f64,
    log_density: f64,
    left_out: usize,
}

/// The inverse of the lower triangle.
fn inverse_lower<const M: usize>(factor: &SMatrix<f64, M, M>) -> SMatrix<f64, M, M> {
    let mut inverse = SMatrix::zeros();
    for i in 0..M {
        let scale = 1.0 / factor[(i, i)];
        inverse[(i, i)] = scale;
        for j in 0..i {
            let sum: f64 = (j..i).map(|k| factor[(i, k)] * inverse[(k, j)]).sum();
            inverse[(i, j)] = -sum * scale;
        }
    }
    inverse
}

fn rows<const R: usize, const C: usize>(matrix: &SMatrix<f64, R, C>) -> [[f32; C]; R] {
    std::array::from_fn(|r| std::array::from_fn(|c| matrix[(r, c)] as f32))
}
