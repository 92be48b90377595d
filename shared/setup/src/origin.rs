//! Where the values of a configuration come from.

use std::fmt;

use crate::document::Document;
use crate::locate::line_of_given_key;
use crate::problem::SetupError;

/// Where a value comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// Nobody gave it.
    Default,
    /// This line of the graph file.
    Line(usize),
    /// This option of the command line.
    Option(String),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Default => write!(f, "default"),
            Self::Line(line) => write!(f, "line {line}"),
            Self::Option(option) => write!(f, "{option}"),
        }
    }
}

impl Document {
    /// Where the value at `key` (`services.detector.core`) comes from.
    #[must_use]
    pub fn origin(&self, key: &str) -> Origin {
        if let Some(option) = self.replaced.get(key) {
            return Origin::Option(option.clone());
        }
        let text = self.graph.text().unwrap_or_default();
        line_of_given_key(text, key).map_or(Origin::Default, Origin::Line)
    }

    /// Blames the options for the problems of values that they have replaced.
    pub(crate) fn blame_options(&self, mut error: SetupError) -> SetupError {
        for problem in &mut error.problems {
            if problem.file == self.graph.path {
                problem.option = self.replaced.get(&problem.key).cloned();
            }
        }
        error
    }
}
