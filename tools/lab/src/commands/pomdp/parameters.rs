//! Files of parameters that decision models follow from.

use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use vigil_terminal::CommandError;

/// A file of parameters.
pub(super) struct ParameterFile {
    path: PathBuf,
    text: String,
    /// What it is for.
    pub model: ModelKind,
}

/// What a file of parameters is for: its key `model`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ModelKind {
    Exceptions,
    Navigation,
    Recovery,
}

#[derive(Deserialize)]
struct Head {
    model: ModelKind,
}

impl ParameterFile {
    /// # Errors
    /// A file that cannot be read, or does not say what it is for.
    pub(super) fn read(path: &Path) -> Result<Self, CommandError> {
        let text = fs::read_to_string(path)
            .map_err(|error| refused(path, &format!("cannot be read: {error}")))?;
        let head: Head = toml::from_str(&text).map_err(|error| refused(path, &error))?;
        Ok(Self {
            path: path.to_owned(),
            text,
            model: head.model,
        })
    }

    /// Its parameters.
    ///
    /// # Errors
    /// A key that is not known, or a value of another type.
    pub(super) fn parsed<T: DeserializeOwned>(&self) -> Result<T, CommandError> {
        toml::from_str(&self.text).map_err(|error| self.refused(&error))
    }

    /// Why the file is refused.
    pub(super) fn refused(&self, problem: &dyn Display) -> CommandError {
        refused(&self.path, problem)
    }
}

fn refused(path: &Path, problem: &dyn Display) -> CommandError {
    CommandError::usage(format!("{}: {problem}", path.display()))
}
