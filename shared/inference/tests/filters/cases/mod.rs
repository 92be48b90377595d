//! Filter cases with exact answers: small models, observations, and the beliefs that an exact
//! filter computes from them (`tests/data/filters`). Oracles for every filter.

mod hidden_markov;
mod jump_linear;
mod linear;
mod planar;

use std::path::Path;

use nalgebra::{SMatrix, SVector};
use serde::de::DeserializeOwned;
use vigil_inference::gaussian::Gaussian;

pub use hidden_markov::HiddenMarkov;
pub use jump_linear::{JumpLinear, PoseAndWheels};
pub use linear::Linear;
pub use planar::Planar;

/// Why a case could not be read.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// The file could not be read.
    #[error("{0}: {1}")]
    Io(String, std::io::Error),
    /// The table is not this case's.
    #[error("{0}: {1}")]
    Table(String, csv::Error),
    /// The file is not this case.
    #[error("{0}: {1}")]
    Format(String, serde_json::Error),
}

fn read<T: DeserializeOwned>(path: &Path) -> Result<T, CaseError> {
    let name = || path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|e| CaseError::Io(name(), e))?;
    serde_json::from_str(&text).map_err(|e| CaseError::Format(name(), e))
}

fn vector<const N: usize>(values: &[f64; N]) -> SVector<f64, N> {
    SVector::from(*values)
}

fn matrix<const N: usize>(rows: &[[f64; N]; N]) -> SMatrix<f64, N, N> {
    SMatrix::from_fn(|i, j| rows[i][j])
}

/// Conditions on `z = x + N(0, noise)`; None, unchanged, if a value is not finite.
fn observe<const N: usize>(
    state: &mut Gaussian<N>,
    z: &[f64; N],
    noise: &SMatrix<f64, N, N>,
) -> Option<f64> {
    state.update(&(vector(z) - state.mean), &SMatrix::identity(), noise)
}
