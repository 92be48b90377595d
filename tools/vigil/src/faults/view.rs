//! A reader of a running graph's faults.

use std::time::{Duration, Instant};

use vigil_blocks::{Block, Faults};
use vigil_cycle::port::Link;
use vigil_cycle::{Domain, Graph, Receiver, Topic};
use vigil_setup::{GraphArgs, Setup};
use vigil_terminal::CommandError;

use super::document::Document;

/// Without a block for so long nothing is known: the supervisor sends one ten times a second.
pub const STALE: Duration = Duration::from_secs(1);
/// Time that the first block may take.
const FIRST: Duration = Duration::from_secs(2);
/// Between two looks.
const POLL: Duration = Duration::from_millis(5);

/// The faults of a graph, as they come.
pub struct View {
    /// The graph's configuration, which gives names.
    pub setup: Setup,
    /// Where it runs.
    pub domain: Domain,
    /// Its topics.
    pub graph: Graph,
    faults: Box<dyn Receiver<Faults>>,
}

impl View {
    /// Joins a running graph.
    ///
    /// # Errors
    /// A configuration that is refused; a graph that does not run.
    pub fn join(args: &GraphArgs) -> Result<Self, CommandError> {
        let setup = args.load().map_err(CommandError::usage)?;
        let domain = running(&setup.file.graph.name)?;
        let link = Link::join(&domain, "vigil-faults").map_err(CommandError::failure)?;
        let graph = Graph::SharedMemory(link);
        let faults = graph.receiver(Topic::Faults);
        Ok(Self {
            faults: faults.map_err(CommandError::failure)?,
            setup,
            domain,
            graph,
        })
    }

    /// The first block, with names.
    ///
    /// # Errors
    /// A graph that says nothing.
    pub fn first(&mut self) -> Result<Document, CommandError> {
        let began = Instant::now();
        while began.elapsed() < FIRST {
            if let Some(document) = self.newest() {
                return Ok(document);
            }
            std::thread::sleep(POLL);
        }
        let name = self.domain.graph();
        let message = format!("graph '{name}': its supervisor says nothing of faults");
        Err(CommandError::failure(message))
    }

    /// The newest block that has come since the last look, with names.
    pub fn newest(&mut self) -> Option<Document> {
        let mut newest = None;
        while let Some(block) = self.faults.take_next() {
            if block.header.schema == Faults::SCHEMA {
                newest = Some(Document::new(block, &self.setup));
            }
        }
        newest
    }

    /// True while the graph runs.
    pub fn is_running(&self) -> bool {
        Domain::running(self.domain.graph()).is_some()
    }
}

/// The place of a running graph.
fn running(name: &str) -> Result<Domain, CommandError> {
    Domain::running(name).ok_or_else(|| {
        let others = Domain::all_running();
        let others = match others.is_empty() {
            true => "none runs".to_owned(),
            false => format!("there run: {}", others.join(", ")),
        };
        CommandError::failure(format!("no graph named '{name}' is running; {others}"))
    })
}
