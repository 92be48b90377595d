//! Exceptions: Vigil's own texts.

use std::fmt::Display;
use std::io;
use std::path::Path;

use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;

pyo3::create_exception!(
    vigil_pomdp,
    PomdpError,
    PyValueError,
    "What is wrong with a model, a policy or an argument: what was found and what is allowed."
);
pyo3::create_exception!(
    vigil_pomdp,
    ParseError,
    PomdpError,
    "What is wrong with the text of a model. `line` and `column` say where, from 1."
);

/// The exception of an error.
pub fn refusal(error: impl Display) -> PyErr {
    PomdpError::new_err(error.to_string())
}

/// The same, of the text of a model.
pub fn parse_refusal(py: Python<'_>, error: &vigil_pomdp::ParseError) -> PyErr {
    let raised = ParseError::new_err(error.to_string());
    let value = raised.value(py);
    let place = [("line", error.at.line), ("column", error.at.column)];
    let set = place
        .into_iter()
        .try_for_each(|(name, at)| value.setattr(name, at));
    set.err().unwrap_or(raised)
}

/// The exception of a file that cannot be read or written.
pub fn file_refusal(path: &Path, error: &io::Error) -> PyErr {
    let text = error.to_string();
    match error.raw_os_error() {
        // Python makes a FileNotFoundError and the like of the number.
        Some(number) => {
            let text = text
                .split(" (os error")
                .next()
                .unwrap_or_default()
                .to_owned();
            PyOSError::new_err((number, text, path.as_os_str().to_owned()))
        }
        None => refusal(format!("{}: {text}", path.display())),
    }
}
