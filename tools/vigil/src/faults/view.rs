//! A reader of a running graph's faults.

use std::time::{Duration, Instant};

use vigil_blocks::{Block, Faults};
use vigil_cycle::port::Link;
use vigil_cycle::{Clock, Graph, KeptBlock, Monotonic, Receiver, Topic};
use vigil_setup::{RunningArgs, RunningGraph};
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
    running: RunningGraph,
    /// Its topics.
    pub graph: Graph,
    faults: Box<dyn Receiver<Faults>>,
}

impl View {
    /// Joins a running graph.
    ///
    /// # Errors
    /// A graph that does not run; the transport's.
    pub fn join(args: &RunningArgs) -> Result<Self, CommandError> {
        let running = args.find().map_err(CommandError::failure)?;
        let link = Link::join(&running.domain, "vigil-faults").map_err(CommandError::failure)?;
        let graph = Graph::SharedMemory(link);
        let faults = graph.receiver(Topic::Faults);
        Ok(Self {
            faults: faults.map_err(CommandError::failure)?,
            running,
            graph,
        })
    }

    /// The first block, with names. Without a supervisor it is what the last one has kept, and
    /// stale.
    ///
    /// # Errors
    /// A graph of another fault tree; one that has said nothing yet.
    pub fn first(&mut self) -> Result<Document, CommandError> {
        let began = Instant::now();
        while began.elapsed() < FIRST {
            if let Some(document) = self.newest()? {
                return Ok(document);
            }
            std::thread::sleep(POLL);
        }
        let kept = KeptBlock::<Faults>::read_file(&self.running.domain.faults_file());
        let kept = kept.map(|block| self.named(&block)).transpose()?;
        kept.map(|document| document.gone_stale()).ok_or_else(|| {
            let name = self.running.domain.graph();
            CommandError::failure(format!(
                "graph '{name}': nothing has been said of faults yet"
            ))
        })
    }

    /// The newest block that has come since the last look, with names; one that is too old is none.
    ///
    /// # Errors
    /// A graph of another fault tree.
    pub fn newest(&mut self) -> Result<Option<Document>, CommandError> {
        let mut newest = None;
        while let Some(block) = self.faults.take_next() {
            let age_ns = Monotonic.now_ns().saturating_sub(block.header.t_publish_ns);
            let is_fresh = Duration::from_nanos(age_ns) < STALE;
            if block.header.schema == Faults::SCHEMA && is_fresh {
                newest = Some(Box::new(*block));
            }
        }
        newest.map(|block| self.named(&block)).transpose()
    }

    fn named(&self, block: &Faults) -> Result<Document, CommandError> {
        let setup = &self.running.setup;
        if block.tree_hash == setup.tree.hash() {
            return Ok(Document::new(block, setup));
        }
        let name = self.running.domain.graph();
        Err(CommandError::failure(format!(
            "graph '{name}' was started anew, with another fault tree"
        )))
    }

    /// Name of the graph.
    pub fn graph_name(&self) -> &str {
        self.running.domain.graph()
    }

    /// True while the graph runs.
    pub fn is_running(&self) -> bool {
        self.running.lives()
    }
}
