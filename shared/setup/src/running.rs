//! Graphs that run on this machine, and what they run on.

use std::path::Path;

use vigil_cycle::{Domain, PortError, Processes};

use crate::document::Document;
use crate::load::Setup;
use crate::problem::SetupError;

/// Which running graph.
#[derive(Debug, Clone, Default, PartialEq, Eq, clap::Args)]
pub struct RunningArgs {
    /// Name of the running graph; needed only while several run. `vigil list` names them.
    #[arg(long, value_name = "NAME")]
    pub graph: Option<String>,
}

/// A running graph.
#[derive(Debug, Clone)]
pub struct RunningGraph {
    /// Where it runs.
    pub domain: Domain,
    /// What it runs on: configuration and models, options applied.
    pub document: Document,
    /// The same, checked.
    pub setup: Setup,
}

/// Why a graph was not found.
#[derive(Debug, thiserror::Error)]
pub enum NotRunning {
    /// None of this name runs.
    #[error("no graph named '{name}' is running; {}", others(.running))]
    Unknown {
        /// The name.
        name: String,
        /// Those that run.
        running: Vec<String>,
    },
    /// None runs.
    #[error("no graph is running; `vigil run` starts one")]
    None,
    /// No name was given, and several run.
    #[error("several graphs are running: say which with --graph: {}", .0.join(", "))]
    Several(Vec<String>),
    /// What it runs on cannot be read: it was started by another version.
    #[error("graph '{name}': {error}")]
    Document {
        /// Its name.
        name: String,
        /// Why.
        error: SetupError,
    },
    /// The transport's.
    #[error(transparent)]
    Port(#[from] PortError),
}

fn others(running: &[String]) -> String {
    match running {
        [] => "none runs".to_owned(),
        names => format!("there run: {}", names.join(", ")),
    }
}

impl RunningArgs {
    /// The graph of this name, or the only one that runs.
    ///
    /// # Errors
    /// See [`NotRunning`].
    pub fn find(&self) -> Result<RunningGraph, NotRunning> {
        let running = Domain::all_running();
        let name = match (&self.graph, running.as_slice()) {
            (Some(name), running) if running.contains(name) => name.clone(),
            (Some(name), _) => {
                let name = name.clone();
                return Err(NotRunning::Unknown { name, running });
            }
            (None, []) => return Err(NotRunning::None),
            (None, [only]) => only.clone(),
            (None, _) => return Err(NotRunning::Several(running)),
        };
        RunningGraph::read(&name)
    }
}

impl RunningGraph {
    /// The running graph of this name.
    ///
    /// # Errors
    /// See [`NotRunning`].
    pub fn read(name: &str) -> Result<Self, NotRunning> {
        let unknown = || NotRunning::Unknown {
            name: name.to_owned(),
            running: Domain::all_running(),
        };
        let domain = Domain::running(name).ok_or_else(unknown)?;
        Self::read_document(name, &domain.document_file())
    }

    /// A graph of this name that runs, or has run, on the document in this file.
    ///
    /// # Errors
    /// [`NotRunning::Document`], and the transport's.
    pub fn read_document(name: &str, file: &Path) -> Result<Self, NotRunning> {
        let refused = |error| NotRunning::Document {
            name: name.to_owned(),
            error,
        };
        let document = Document::read_text(file).map_err(refused)?;
        let setup = document.check().map_err(refused)?;
        Ok(Self {
            // With the queues of its configuration.
            domain: setup.domain()?,
            document,
            setup,
        })
    }

    /// False once it has ended.
    #[must_use]
    pub fn lives(&self) -> bool {
        Domain::running(self.domain.graph()).is_some()
    }

    /// The processes that it consists of.
    #[must_use]
    pub fn processes(&self) -> Processes {
        self.domain.processes()
    }
}
