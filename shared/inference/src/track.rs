//! A Gaussian track of a planar pose whose motion per metre deviates from its model.
//!
//! State: x, y, yaw; three offsets that are constant within a run, or drift; three deviations that
//! follow an Ornstein-Uhlenbeck process along the path. Offsets and deviations are per commanded
//! metre, in the order yaw, forward, lateral. A forward offset, as of motors that yield, shortens
//! the turn in the same proportion as the travel. A deviation, as of a slope on which the robot
//! slips, does not; and it changes sign when the robot drives the other way. The extended Kalman
//! filter linearises about the heading at half the turn.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use vigil_checkpoint::CheckpointValue;

use crate::angle::wrap;
use crate::gaussian::{Gaussian, log_density};

/// Dimension of a track's state.
pub const TRACK_DIMENSION: usize = N;
const N: usize = 9;

/// How far the motion per metre deviates from its model; order yaw, forward, lateral.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionNoise {
    /// Covariance of the offsets, per metre.
    pub offset: Matrix3<f64>,
    /// Stationary covariance of the coloured deviations, per metre.
    pub deviation: Matrix3<f64>,
    /// Correlation length of the deviations, m.
    pub length_m: f64,
    /// Variance of white noise per metre travelled.
    pub white: Vector3<f64>,
    /// Variance by which the offsets drift per metre travelled.
    pub drift: Vector3<f64>,
    /// Largest mean deviation per metre in this mode; infinite where there is no such bound.
    pub bound: Vector3<f64>,
    /// Rate of sudden changes of the ground, 1/m, after which the deviations are unknown.
    pub changes_1_m: f64,
}

/// Estimated deviations per metre of a healthy robot where it drives: slip, slope, the offset of a
/// servo. A fault adds to them.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Context {
    /// Mean; order yaw, forward, lateral.
    pub mean: Vector3<f64>,
    /// Covariance.
    pub covariance: Matrix3<f64>,
    /// Direction of travel for which they hold: 1 forwards, -1 backwards, 0 any.
    direction: f64,
}

impl MotionNoise {
    /// True where the deviations are those of a healthy robot.
    #[must_use]
    pub fn is_bounded(&self) -> bool {
        self.bound.iter().all(|bound| bound.is_finite())
    }
}

impl Default for Context {
    /// No deviation, for certain.
    fn default() -> Self {
        Self {
            mean: Vector3::zeros(),
            covariance: Matrix3::zeros(),
            direction: 0.0,
        }
    }
}

impl Context {
    /// Deviations with this mean and covariance, whatever the direction of travel.
    #[must_use]
    pub const fn new(mean: Vector3<f64>, covariance: Matrix3<f64>) -> Self {
        Self {
            mean,
            covariance,
            direction: 0.0,
        }
    }

    /// This context for one direction of travel: see [`Self::direction`].
    #[must_use]
    pub const fn facing(self, direction: f64) -> Self {
        Self { direction, ..self }
    }

    /// Direction of travel for which they hold: 1 forwards, -1 backwards, 0 any.
    #[must_use]
    pub const fn direction(&self) -> f64 {
        self.direction
    }

    /// Forgets over a travel of `travel_m`, as the ground changes. The effect of a slope changes
    /// sign with the direction of travel.
    pub fn fade(&mut self, travel_m: f64, noise: &MotionNoise) {
        if turns_round(&mut self.direction, travel_m) {
            // Forward and lateral; a yaw deviation per metre keeps its sign.
            for i in [1, 2] {
                reverse(&mut self.mean, &mut self.covariance, i);
            }
        }
        let fading = (-travel_m.abs() / noise.length_m).exp();
        let square = fading * fading;
        self.mean *= fading;
        self.covariance =
            self.covariance * square + (noise.offset + noise.deviation) * (1.0 - square);
    }
}

/// True if a travel of `travel_m` is opposite to `direction`, which becomes that of the travel.
fn turns_round(direction: &mut f64, travel_m: f64) -> bool {
    let turns = *direction * travel_m < 0.0;
    if travel_m != 0.0 {
        *direction = travel_m.signum();
    }
    turns
}

/// Changes the sign of one component of a Gaussian.
fn reverse<const D: usize>(
    mean: &mut SVector<f64, D>,
    covariance: &mut SMatrix<f64, D, D>,
    i: usize,
) {
    mean[i] = -mean[i];
    covariance.row_mut(i).neg_mut();
    covariance.column_mut(i).neg_mut();
}

/// One displacement.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Displacement {
    /// Expected yaw, forward, lateral displacement per commanded metre.
    pub per_metre: [f64; 3],
    /// Commanded travel, m.
    pub travel_m: f64,
    /// Additional variance of yaw (rad²), forward and lateral displacement (m²).
    pub extra: [f64; 3],
}

/// The track.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Track {
    mean: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
    /// Direction of the last displacement: 1 forwards, -1 backwards, 0 none yet.
    direction: f64,
}

impl From<Gaussian<N>> for Track {
    fn from(Gaussian { mean, covariance }: Gaussian<N>) -> Self {
        Self {
            mean,
            covariance,
            direction: 0.0,
        }
    }
}

impl From<Track> for Gaussian<N> {
    fn from(
        Track {
            mean, covariance, ..
        }: Track,
    ) -> Self {
        Self { mean, covariance }
    }
}

impl Track {
    /// A track at `pose` (x, y, yaw) with its covariance and the noise's stationary deviations.
    #[must_use]
    pub fn new(pose: Vector3<f64>, covariance: Matrix3<f64>, noise: &MotionNoise) -> Self {
        let mut track = Self {
            mean: SVector::zeros(),
            covariance: SMatrix::zeros(),
            direction: 0.0,
        };
        track.mean.fixed_rows_mut::<3>(0).copy_from(&pose);
        track
            .covariance
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&covariance);
        track.begin(&Context::default(), noise);
        track
    }

    /// Pose x m, y m, yaw rad (not wrapped).
    #[must_use]
    pub fn pose(&self) -> Vector3<f64> {
        self.mean.fixed_rows::<3>(0).into()
    }

    /// Covariance of the pose.
    #[must_use]
    pub fn pose_covariance(&self) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(0, 0).into()
    }

    /// Estimated deviation per metre from the model: offset plus coloured part.
    #[must_use]
    pub fn deviation(&self) -> Vector3<f64> {
        self.mean.fixed_rows::<3>(3) + self.mean.fixed_rows::<3>(6)
    }

    /// The estimated deviations, offsets included.
    #[must_use]
    pub fn context(&self) -> Context {
        let view = |r: usize, c: usize| -> Matrix3<f64> {
            self.covariance.fixed_view::<3, 3>(r, c).into()
        };
        let across = view(3, 6);
        Context {
            mean: self.deviation(),
            covariance: view(3, 3) + across + across.transpose() + view(6, 6),
            direction: self.direction,
        }
    }

    /// This track after a displacement in this direction: 1 forwards, -1 backwards, 0 none.
    #[must_use]
    pub const fn facing(self, direction: f64) -> Self {
        Self { direction, ..self }
    }

    /// The same pose in another mode, in a context. In a nominal mode, one with a bound, the
    /// context becomes the deviations. In a fault it becomes the offsets, which keep their sign
    /// when the direction of travel changes, plus those of the fault.
    #[must_use]
    pub fn enter(&self, context: &Context, noise: &MotionNoise) -> Self {
        let mut track = *self;
        if noise.is_bounded() {
            track.begin(&Context::default(), noise);
            track.mean.fixed_rows_mut::<3>(6).copy_from(&context.mean);
            track.set(6, 6, &context.covariance);
        } else {
            track.begin(context, noise);
        }
        track
    }

    /// The same pose on ground of which nothing is known: with the prior of the deviations.
    pub(crate) fn renewed(&self, noise: &MotionNoise) -> Self {
        let mut track = *self;
        track.begin(&Context::default(), noise);
        track
    }

    fn begin(&mut self, context: &Context, noise: &MotionNoise) {
        let pose = self.pose_covariance();
        self.mean.fixed_rows_mut::<3>(3).copy_from(&context.mean);
        self.mean.fixed_rows_mut::<3>(6).fill(0.0);
        self.covariance.fill(0.0);
        self.set(0, 0, &pose);
        self.set(3, 3, &(context.covariance + noise.offset));
        self.set(6, 6, &noise.deviation);
    }

    /// Moves each mean deviation that is beyond its bound back onto it, and the rest of the state
    /// as far as it is correlated: a Kalman filter constrained by projection (Simon, *Kalman
    /// Filtering with State Constraints*, 2010).
    pub fn saturate(&mut self, bound: &Vector3<f64>) {
        for i in 0..3 {
            let deviation = self.mean[3 + i] + self.mean[6 + i];
            // Unlike `clamp` these accept a bound that is negative or no number.
            let beyond = deviation - deviation.min(bound[i]).max(-bound[i]);
            if beyond == 0.0 {
                continue;
            }
            let along = self.covariance.column(3 + i) + self.covariance.column(6 + i);
            let variance = along[3 + i] + along[6 + i];
            if variance > 0.0 {
                self.mean -= along * (beyond / variance);
            }
        }
    }

    /// Natural logarithm of the probability that some deviation lies beyond its bound. A departure
    /// within the bounds is not material.
    #[must_use]
    pub fn log_material(&self, bound: &Vector3<f64>) -> f64 {
        let Context {
            mean, covariance, ..
        } = self.context();
        let mut within = 0.0;
        for i in 0..3 {
            let sd = (2.0 * covariance[(i, i)]).sqrt().max(f64::MIN_POSITIVE);
            let (near, far) = (
                (bound[i] - mean[i].abs()) / sd,
                (bound[i] + mean[i].abs()) / sd,
            );
            let beyond = 0.5 * (libm::erfc(near) + libm::erfc(far));
            within += (-beyond.min(1.0)).ln_1p();
        }
        // One minus the product of the probabilities within, without cancellation where it is
        // small.
        (-within.exp_m1()).max(f64::MIN_POSITIVE).ln()
    }

    /// Puts the pose at `pose` with `variance` and keeps the deviations: the frame in which the
    /// pose is measured has jumped.
    pub fn anchor(&mut self, pose: [f64; 3], variance: [f64; 3]) {
        self.mean
            .fixed_rows_mut::<3>(0)
            .copy_from(&Vector3::from(pose));
        self.covariance.fixed_view_mut::<3, 6>(0, 3).fill(0.0);
        self.covariance.fixed_view_mut::<6, 3>(3, 0).fill(0.0);
        let block = Matrix3::from_diagonal(&Vector3::from(variance));
        self.covariance
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&block);
    }

    /// Adds variance to the pose (x, y, yaw).
    pub fn diffuse(&mut self, variance: [f64; 3]) {
        for (i, variance) in variance.into_iter().enumerate() {
            self.covariance[(i, i)] += variance;
        }
    }

    /// The Gaussian with the first two moments of the mixture of this track, with the weight
    /// `share`, and another one. Their headings must differ by less than a turn.
    pub(crate) fn mixed(&self, other: &Self, share: f64) -> Self {
        assert!(
            (0.0..=1.0).contains(&share),
            "the shares of a mixture are probabilities"
        );
        let rest = 1.0 - share;
        let difference = self.mean - other.mean;
        Self {
            mean: self.mean * share + other.mean * rest,
            covariance: self.covariance * share
                + other.covariance * rest
                + difference * difference.transpose() * (share * rest),
            direction: self.direction,
        }
    }

    /// Expected turn of a displacement, rad.
    #[must_use]
    pub fn turn(&self, step: &Displacement) -> f64 {
        let slipping = step.per_metre[0] * self.mean[4];
        (step.per_metre[0] + self.deviation()[0] + slipping) * step.travel_m
    }

    /// Moves by one displacement.
    pub fn predict(&mut self, step: &Displacement, noise: &MotionNoise) {
        let travel = step.travel_m;
        self.face(travel);
        let moved = (Vector3::from(step.per_metre) + self.deviation()) * travel;
        let slipping = step.per_metre[0] * travel;
        let turn = moved[0] + slipping * self.mean[4];
        let (forward, lateral) = (moved[1], moved[2]);
        let (sin, cos) = (self.mean[2] + 0.5 * turn).sin_cos();
        let (dx, dy) = (forward * cos - lateral * sin, forward * sin + lateral * cos);
        self.mean[0] += dx;
        self.mean[1] += dy;
        self.mean[2] += turn;
        let fading = (-travel.abs() / noise.length_m).exp();
        let old = self.mean.fixed_rows::<3>(6).into_owned();
        self.mean.fixed_rows_mut::<3>(6).copy_from(&(old * fading));

        // Jacobians of the new pose: by the old pose, and by the motion in the body frame.
        let heading = Matrix3::new(1.0, 0.0, -dy, 0.0, 1.0, dx, 0.0, 0.0, 1.0);
        let body = Matrix3::new(-0.5 * dy, cos, -sin, 0.5 * dx, sin, cos, 1.0, 0.0, 0.0);
        let by_deviation = body * travel;
        // A forward offset changes the turn, too.
        let mut by = by_deviation;
        by.set_column(1, &(by.column(1) + body.column(0) * slipping));
        let view = |r: usize, c: usize| -> Matrix3<f64> {
            self.covariance.fixed_view::<3, 3>(r, c).into()
        };
        let (pp, po, pd) = (view(0, 0), view(0, 3), view(0, 6));
        let (oo, od, dd) = (view(3, 3), view(3, 6), view(6, 6));
        // Covariances of the new pose with the old offsets and deviations. The product of whole
        // 9x9 matrices would be mostly of zeros and ones.
        let pose_offset = heading * po + by * oo + by_deviation * od.transpose();
        let pose_deviation = heading * pd + by * od + by_deviation * dd;
        let mixed = heading * (po * by.transpose() + pd * by_deviation.transpose());
        let across = by * od * by_deviation.transpose();
        let drift = by * oo * by.transpose()
            + across
            + across.transpose()
            + by_deviation * dd * by_deviation.transpose();
        let white = noise.white * travel.abs() + Vector3::from(step.extra);
        let white = body * Matrix3::from_diagonal(&white) * body.transpose();
        let pose = heading * pp * heading.transpose() + mixed + mixed.transpose() + drift + white;
        // An Ornstein-Uhlenbeck process keeps its stationary covariance.
        let fresh = noise.deviation * (1.0 - fading * fading);
        let drifted = oo + Matrix3::from_diagonal(&(noise.drift * travel.abs()));
        self.set(3, 3, &drifted);
        self.set(0, 0, &pose);
        self.set(0, 3, &pose_offset);
        self.set(0, 6, &(pose_deviation * fading));
        self.set(3, 6, &(od * fading));
        self.set(6, 6, &(dd * (fading * fading) + fresh));
    }

    /// Changes the sign of the forward and lateral deviations when the direction of travel does: a
    /// slope pulls in one direction of the ground, so that its effect per metre driven changes
    /// sign.
    fn face(&mut self, travel_m: f64) {
        let turns = turns_round(&mut self.direction, travel_m);
        for i in [N - 2, N - 1].into_iter().filter(|_| turns) {
            reverse(&mut self.mean, &mut self.covariance, i);
        }
    }

    fn set(&mut self, row: usize, column: usize, block: &Matrix3<f64>) {
        self.covariance
            .fixed_view_mut::<3, 3>(row, column)
            .copy_from(block);
        if row != column {
            self.covariance
                .fixed_view_mut::<3, 3>(column, row)
                .copy_from(&block.transpose());
        }
    }

    /// Innovation of a measured pose (x, y, yaw) and its covariance, in the frame of the pose.
    #[must_use]
    pub fn innovation(&self, pose: [f64; 3], variance: [f64; 3]) -> (Vector3<f64>, Matrix3<f64>) {
        let innovation = Vector3::new(
            pose[0] - self.mean[0],
            pose[1] - self.mean[1],
            wrap(pose[2] - self.mean[2]),
        );
        (
            innovation,
            self.pose_covariance() + Matrix3::from_diagonal(&Vector3::from(variance)),
        )
    }

    /// Conditions on a measured pose (x, y, yaw) with independent noise of `variance`; returns
    /// its log-density. None, unchanged, if a value is not finite or the covariance degenerated.
    pub fn update(&mut self, pose: [f64; 3], variance: [f64; 3]) -> Option<f64> {
        let (innovation, spread) = self.innovation(pose, variance);
        let (log_likelihood, factor) = log_density(&innovation, spread)?;
        let rows: SMatrix<f64, 3, N> = self.covariance.fixed_view::<3, N>(0, 0).into();
        // With spread = L Lᵀ and W = L⁻¹ rows the gain is Wᵀ L⁻¹, and the covariance loses Wᵀ W,
        // which is symmetric whatever the rounding.
        let root = factor.l_dirty();
        let whitened = root.solve_lower_triangular(&innovation)?;
        let rows = root.solve_lower_triangular(&rows)?;
        let mean = self.mean + rows.tr_mul(&whitened);
        if !mean.iter().all(|value| value.is_finite()) {
            return None;
        }
        self.mean = mean;
        self.covariance -= rows.tr_mul(&rows);
        Some(log_likelihood)
    }
}

#[cfg(test)]
mod tests;
