//! The life of a service process: place, open ports, warm up, cycle, report.

use std::path::PathBuf;

use crate::clock::{Clock, Monotonic};
use crate::deadline::{DeadlineMonitor, Schedule};
use crate::domain::{Domain, Queues};
use crate::health::HealthBoard;
use crate::live;
use crate::placement::Wanted;
use crate::port::{Graph, Link, PortError};
use crate::report::{ReportError, RunReport};
use crate::source::{Source, SourceCycle};
use crate::stage::{Stage, StageCycle, Timing};
use crate::topic::{ServiceName, Topic};

/// Delay between the opened ports and the first frame of a source, ns: time for the others.
const START_DELAY_NS: u64 = 50_000_000;

/// What a service process is to be.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Which service.
    pub service: ServiceName,
    /// Name of the graph.
    pub graph: String,
    /// Sizes of the queues.
    pub queues: Queues,
    /// Core and priority.
    pub wanted: Wanted,
    /// Period, deadline and budget.
    pub schedule: Schedule,
    /// Where to leave the run report when the service stops.
    pub report: Option<PathBuf>,
}

/// Why a service ended.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The transport failed.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The report could not be written.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The service's own models or settings do not fit.
    #[error("{0}")]
    Build(String),
}

/// Runs a stage that waits for blocks of `T` on `input`, until SIGINT or SIGTERM.
///
/// # Errors
/// [`ServeError`]; what it did until then stays visible in Health.
pub fn stage<T: vigil_blocks::Block, S: Stage>(
    plan: &Plan,
    input: Topic,
    build: impl FnOnce(&Graph) -> Result<S, ServeError>,
) -> Result<(), ServeError> {
    let (graph, health) = open(plan)?;
    let mut stage = build(&graph)?;
    let Graph::SharedMemory(link) = &graph else {
        return Ok(());
    };
    let listener = link.listener::<T>(input)?;
    let mut cycle = StageCycle::new(DeadlineMonitor::new(plan.schedule), health)?;
    let faults = live::page_faults();
    live::run_stage(&mut cycle, &mut stage, &listener)?;
    report(plan, cycle.timing(), faults)
}

/// Runs a source until SIGINT or SIGTERM.
///
/// # Errors
/// [`ServeError`]; what it did until then stays visible in Health.
pub fn source<S: Source>(
    plan: &Plan,
    build: impl FnOnce(&Graph) -> Result<S, ServeError>,
) -> Result<(), ServeError> {
    let (graph, health) = open(plan)?;
    let mut source = build(&graph)?;
    let first_ns = Monotonic.now_ns() + START_DELAY_NS;
    let mut cycle = SourceCycle::new(DeadlineMonitor::new(plan.schedule), health, first_ns)?;
    let faults = live::page_faults();
    live::run_source(&mut cycle, &mut source)?;
    report(plan, cycle.timing(), faults)
}

fn open(plan: &Plan) -> Result<(Graph, HealthBoard), PortError> {
    let placement = live::place(plan.wanted);
    let domain = Domain::new(&plan.graph, plan.queues)?;
    let graph = Graph::SharedMemory(Link::join(&domain, plan.service.as_str())?);
    let sender = graph.sender(Topic::Health(plan.service))?;
    let health = HealthBoard::new(sender, plan.schedule, plan.wanted, placement);
    Ok((graph, health))
}

fn report(plan: &Plan, timing: &Timing, before: [u64; 2]) -> Result<(), ServeError> {
    let Some(path) = &plan.report else {
        return Ok(());
    };
    let after = live::page_faults();
    let page_faults = [after[0] - before[0], after[1] - before[1]];
    Ok(RunReport::new(plan.service.as_str(), timing, page_faults)?.write(path)?)
}
