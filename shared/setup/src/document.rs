//! What a start reads, once: the graph file and the texts of the files that it names.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::graph_file::GraphFile;
use crate::locate::line_of_byte;
use crate::problem::{Problem, SetupError};

/// Largest file, bytes. A policy of this size has some three million values, more than a cycle can
/// weigh; all other files are far smaller.
const BYTES_MAX: u64 = 64 << 20;

/// A file that was read: its text, or why it has none.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct TextFile {
    /// Where it was read from.
    pub(crate) path: PathBuf,
    text: Result<String, String>,
}

impl TextFile {
    /// Reads a file.
    pub(crate) fn read(path: PathBuf) -> Self {
        let unreadable = |error| format!("cannot be read: {error}");
        let length = std::fs::metadata(&path).map(|metadata| metadata.len());
        let text = match length {
            Ok(length) if length > BYTES_MAX => {
                Err(format!("has {length} bytes, allowed are {BYTES_MAX}"))
            }
            _ => std::fs::read_to_string(&path).map_err(unreadable),
        };
        Self { path, text }
    }

    /// The text.
    pub(crate) fn text(&self) -> Result<&str, Problem> {
        let text = self.text.as_deref();
        text.map_err(|error| Problem::at_line(&self.path, 0, error.to_owned()))
    }

    /// The value that a TOML text holds.
    pub(crate) fn parse<T: serde::de::DeserializeOwned>(&self) -> Result<T, Problem> {
        let text = self.text()?;
        toml::from_str(text).map_err(|error| {
            let line = |span: std::ops::Range<usize>| line_of_byte(text, span.start);
            let message = error.message().replace('\n', " ");
            Problem::at_line(&self.path, error.span().map_or(0, line), message)
        })
    }
}

/// What a start reads: the configuration with its options applied, and the texts of all files.
///
/// The launcher reads it once and hands it on, so that a service that is restarted runs on the same
/// bytes, even if a file was edited meanwhile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Document {
    pub(crate) graph: TextFile,
    pub(crate) robot: TextFile,
    pub(crate) tree: TextFile,
    pub(crate) model: TextFile,
    pub(crate) decision: TextFile,
    pub(crate) policy: Option<TextFile>,
    /// The graph file, options applied.
    pub file: GraphFile,
    /// The options that have replaced a value, by its key.
    #[serde(default)]
    pub(crate) replaced: BTreeMap<String, String>,
}

impl Document {
    /// Reads a graph file and the files that it names; `change` may replace values before.
    ///
    /// # Errors
    /// Why the graph file cannot be understood. Other files are judged by [`Document::check`].
    pub fn read(path: &Path, change: impl FnOnce(&mut GraphFile)) -> Result<Self, SetupError> {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
        let graph = TextFile::read(path);
        let mut file: GraphFile = graph.parse()?;
        change(&mut file);
        let named = |name: &String| TextFile::read(resolve(&graph.path, name));
        Ok(Self {
            robot: named(&file.files.robot),
            tree: named(&file.files.tree),
            model: named(&file.files.model),
            decision: named(&file.files.decision),
            policy: file.supervisor.policy_file.as_ref().map(named),
            graph,
            file,
            replaced: BTreeMap::new(),
        })
    }

    /// The document as text, for another process.
    ///
    /// # Errors
    /// A value that TOML cannot hold.
    pub fn to_text(&self) -> Result<String, SetupError> {
        toml::to_string(self)
            .map_err(|error| Problem::at_line(&self.graph.path, 0, error.to_string()).into())
    }

    /// Reads a document that another process has written.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub fn read_text(path: &Path) -> Result<Self, SetupError> {
        Ok(TextFile::read(path.to_path_buf()).parse()?)
    }

    /// The same of a text that stands in another file, which errors name.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub fn from_text(path: &Path, text: String) -> Result<Self, SetupError> {
        let file = TextFile {
            path: path.to_path_buf(),
            text: Ok(text),
        };
        Ok(file.parse()?)
    }
}

/// The path that the graph file at `graph` means by `name`.
pub(crate) fn resolve(graph: &Path, name: &str) -> PathBuf {
    graph.parent().unwrap_or_else(|| Path::new(".")).join(name)
}
