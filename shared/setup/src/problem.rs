//! What is wrong with a configuration: every problem with its file, line and key.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::locate::line_of_key;

/// One problem of a configuration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// File in which it lies.
    pub file: PathBuf,
    /// Line, from 1; 0 if the file as a whole is meant.
    pub line: usize,
    /// Key, or empty.
    pub key: String,
    /// The option of the command line that has given the value in place of the file.
    pub option: Option<String>,
    /// What is wrong and what is allowed.
    pub message: String,
}

impl Problem {
    /// Of the value at `key` of the file `text`.
    pub(crate) fn at_key(path: &Path, text: &str, key: &str, message: String) -> Self {
        Self {
            file: path.to_path_buf(),
            line: line_of_key(text, key),
            key: key.to_owned(),
            option: None,
            message,
        }
    }

    /// Of a line; 0 for the file as a whole.
    pub(crate) fn at_line(path: &Path, line: usize, message: String) -> Self {
        Self {
            file: path.to_path_buf(),
            line,
            key: String::new(),
            option: None,
            message,
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(option) = &self.option {
            return write!(f, "{option}: {}", self.message);
        }
        write!(f, "{}", self.file.display())?;
        if self.line > 0 {
            write!(f, ":{}", self.line)?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        write!(f, ": {}", self.message)
    }
}

/// Why a configuration was refused: every problem found.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", .problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
pub struct SetupError {
    /// The problems, in the order of the files.
    pub problems: Vec<Problem>,
}

impl From<Problem> for SetupError {
    fn from(problem: Problem) -> Self {
        Self {
            problems: vec![problem],
        }
    }
}
