//! Planar robots whose motion and wheel rates depend on the mode, through tables.

use super::alias;
use super::vector::{Block, LANES};
use crate::angle::wrap;

/// Modes of a model at most: one per lane.
pub const MODES_MAX: usize = LANES;
/// Measured wheel rates at most.
pub const WHEELS_MAX: usize = 8;
/// Magnitude of poses, increments and rates at most: what exceeds it is no measurement.
pub const MAGNITUDE_MAX: f64 = 1e6;
/// Standard deviation of a measurement at least: below, single precision has nothing to weigh.
pub const MEASUREMENT_SD_MIN: f64 = 1e-6;

/// What is told about a robot; [`PlanarModel::new`] checks it.
///
/// One step, with the mode d' drawn from row d of `transition` and n standard normal:
///
/// ```text
/// x   += cos(yaw) dx[d'] - sin(yaw) dy[d'] + motion_sd[0] n1
/// y   += sin(yaw) dx[d'] + cos(yaw) dy[d'] + motion_sd[1] n2
/// yaw += dyaw[d'] + motion_sd[2] n3            (the rotation above is by the yaw before)
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PlanarParameters {
    /// Probability of each mode before the first step; sums to 1.
    pub initial: Vec<f64>,
    /// Row by row the probabilities of the next mode; each row sums to 1.
    pub transition: Vec<Vec<f64>>,
    /// For each mode the increment in the body's frame of one step: dx m, dy m, dyaw rad.
    pub motion: Vec<[f64; 3]>,
    /// Standard deviation of the noise of one step: x m, y m, yaw rad.
    pub motion_sd: [f64; 3],
    /// Standard deviation of the measured pose: x m, y m, yaw rad.
    pub pose_sd: [f64; 3],
    /// For each mode the mean of each measured wheel rate (rad/s); up to [`WHEELS_MAX`].
    pub wheel_rates: Vec<Vec<f64>>,
    /// Standard deviation of a measured wheel rate (rad/s).
    pub wheel_rate_sd: f64,
    /// Mean pose before the first step: x m, y m, yaw rad.
    pub start: [f64; 3],
    /// Its standard deviation.
    pub start_sd: [f64; 3],
}

/// What is wrong with [`PlanarParameters`].
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The number of modes is that of `initial`.
    #[error("{found} modes, need 1 to {MODES_MAX}")]
    Modes {
        /// Length of `initial`.
        found: usize,
    },
    /// The number of wheels is that of the first mode.
    #[error("{found} wheel rates, at most {WHEELS_MAX}")]
    Wheels {
        /// Length of the first row of `wheel_rates`.
        found: usize,
    },
    /// Every table has one row per mode, and rows of equal lengths.
    #[error("`{table}` has {found} numbers or rows, needs {wanted}")]
    Length {
        /// Name of the field.
        table: &'static str,
        /// Its length, or that of one of its rows.
        found: usize,
        /// What it should be.
        wanted: usize,
    },
    /// Probabilities are not negative, and sum to 1 within 1e-6.
    #[error("`{table}`, row {row}: not a probability distribution")]
    Distribution {
        /// Name of the field.
        table: &'static str,
        /// The row, 0 for a single one.
        row: usize,
    },
    /// A number is not finite or out of range.
    #[error("`{table}` holds {value}, allowed is {low} to {high}")]
    Range {
        /// Name of the field.
        table: &'static str,
        /// What was found.
        value: f64,
        /// The least allowed.
        low: f64,
        /// The largest allowed.
        high: f64,
    },
    /// A covariance is symmetric and has no negative variance in any direction; that of a
    /// measurement has none below [`MEASUREMENT_SD_MIN`] squared.
    #[error("`{table}` is not a covariance, or that of a measurement is too small")]
    Covariance {
        /// Name of the field.
        table: &'static str,
    },
}

/// A checked model, with its tables as the kernels read them.
#[derive(Debug, Clone)]
pub struct PlanarModel {
    pub(super) modes: usize,
    pub(super) wheels: usize,
    pub(super) initial: [f64; MODES_MAX],
    /// An alias table for each mode: entry `16 mode + column`.
    pub(super) alias: [u32; MODES_MAX * LANES],
    pub(super) dx: Block<f32>,
    pub(super) dy: Block<f32>,
    pub(super) dyaw: Block<f32>,
    pub(super) motion_sd: [f32; 3],
    pub(super) pose_sd: [f64; 3],
    pub(super) wheel_rates: [[f64; WHEELS_MAX]; MODES_MAX],
    pub(super) wheel_rate_sd: f64,
    pub(super) start: [f64; 3],
    pub(super) start_sd: [f64; 3],
}

impl PlanarModel {
    /// Checks and converts.
    ///
    /// # Errors
    /// The first fault found; see [`ModelError`].
    pub fn new(parameters: &PlanarParameters) -> Result<Self, ModelError> {
        let p = parameters;
        let modes = p.initial.len();
        if modes == 0 || modes > MODES_MAX {
            return Err(ModelError::Modes { found: modes });
        }
        length("transition", p.transition.len(), modes)?;
        length("motion", p.motion.len(), modes)?;
        length("wheel_rates", p.wheel_rates.len(), modes)?;
        let wheels = p.wheel_rates.first().map_or(0, Vec::len);
        if wheels > WHEELS_MAX {
            return Err(ModelError::Wheels { found: wheels });
        }
        in_range("motion", p.motion.as_flattened(), -MAGNITUDE_MAX)?;
        in_range("motion_sd", &p.motion_sd, 0.0)?;
        in_range("pose_sd", &p.pose_sd, MEASUREMENT_SD_MIN)?;
        in_range("wheel_rate_sd", &[p.wheel_rate_sd], MEASUREMENT_SD_MIN)?;
        in_range("start", &p.start, -MAGNITUDE_MAX)?;
        in_range("start_sd", &p.start_sd, 0.0)?;
        let column = |axis: usize, scale: fn(f64) -> f64| {
            let mut table = Block::splat(0.0_f32);
            for (to, motion) in table.0.iter_mut().zip(&p.motion) {
                *to = scale(motion[axis]) as f32;
            }
            table
        };
        let mut model = Self {
            modes,
            wheels,
            initial: distribution("initial", 0, &p.initial, modes)?,
            alias: [0; MODES_MAX * LANES],
            dx: column(0, |dx| dx),
            dy: column(1, |dy| dy),
            // The kernels wrap once, so that a step turns less than once around.
            dyaw: column(2, wrap),
            motion_sd: p.motion_sd.map(|sd| sd as f32),
            pose_sd: p.pose_sd,
            wheel_rates: [[0.0; WHEELS_MAX]; MODES_MAX],
            wheel_rate_sd: p.wheel_rate_sd,
            start: [p.start[0], p.start[1], wrap(p.start[2])],
            start_sd: p.start_sd,
        };
        let tables = model.alias.as_chunks_mut::<LANES>().0;
        for (row, (table, next)) in tables.iter_mut().zip(&p.transition).enumerate() {
            *table = alias::table(&distribution("transition", row, next, modes)?);
        }
        for (to, rates) in model.wheel_rates.iter_mut().zip(&p.wheel_rates) {
            length("wheel_rates", rates.len(), wheels)?;
            in_range("wheel_rates", rates, -MAGNITUDE_MAX)?;
            to[..wheels].copy_from_slice(rates);
        }
        Ok(model)
    }

    /// Number of modes, 1 to 16.
    #[must_use]
    pub const fn modes(&self) -> usize {
        self.modes
    }

    /// Number of measured wheel rates, 0 to 8.
    #[must_use]
    pub const fn wheels(&self) -> usize {
        self.wheels
    }
}

pub(super) fn length(table: &'static str, found: usize, wanted: usize) -> Result<(), ModelError> {
    if found == wanted {
        Ok(())
    } else {
        Err(ModelError::Length {
            table,
            found,
            wanted,
        })
    }
}

/// All of `values` between `low` and [`MAGNITUDE_MAX`].
pub(super) fn in_range(table: &'static str, values: &[f64], low: f64) -> Result<(), ModelError> {
    let allowed = low..=MAGNITUDE_MAX;
    match values.iter().find(|value| !allowed.contains(*value)) {
        None => Ok(()),
        Some(&value) => Err(ModelError::Range {
            table,
            value,
            low,
            high: MAGNITUDE_MAX,
        }),
    }
}

/// The probabilities of a row, zeros behind.
pub(super) fn distribution(
    table: &'static str,
    row: usize,
    probabilities: &[f64],
    modes: usize,
) -> Result<[f64; MODES_MAX], ModelError> {
    length(table, probabilities.len(), modes)?;
    let sum: f64 = probabilities.iter().sum();
    // Not a number fails both.
    if !(probabilities.iter().all(|&p| p >= 0.0) && (sum - 1.0).abs() <= 1e-6) {
        return Err(ModelError::Distribution { table, row });
    }
    let mut padded = [0.0; MODES_MAX];
    padded[..modes].copy_from_slice(probabilities);
    Ok(padded)
}
