//! States, actions and observations by name or by index.

use pyo3::Borrowed;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::errors::refusal;

/// A name or an index.
pub enum Key {
    /// An index, from 0.
    Index(i64),
    /// A name.
    Name(String),
}

impl<'py> FromPyObject<'_, 'py> for Key {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(name) = given.extract::<String>() {
            return Ok(Self::Name(name));
        }
        given.extract::<i64>().map(Self::Index).map_err(|_| {
            let found = given.get_type().name().map(|name| name.to_string());
            let found = found.unwrap_or_default();
            PyTypeError::new_err(format!(
                "{found}, allowed is a name (str) or an index (int)"
            ))
        })
    }
}

impl Key {
    /// Its index among `names`, which are `what`.
    pub fn index(&self, what: &str, names: &[String]) -> PyResult<usize> {
        let found = match self {
            Self::Index(index) => usize::try_from(*index).ok().filter(|at| *at < names.len()),
            Self::Name(name) => names.iter().position(|known| known == name),
        };
        found.ok_or_else(|| {
            refusal(match self {
                Self::Index(index) => {
                    let most = names.len() - 1;
                    format!("the model has no {what} {index}; allowed are 0 to {most}")
                }
                Self::Name(name) => {
                    let allowed = names.join(", ");
                    format!("the model has no {what} '{name}'; allowed are {allowed}")
                }
            })
        })
    }
}
