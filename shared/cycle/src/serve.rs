//! The life of a service process: place, open ports, warm up, cycle, report.

use std::error::Error;
use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use crate::clock::{Clock, Monotonic};
use crate::cycle_account::CycleAccount;
use crate::deadline::{DeadlineMonitor, Schedule};
use crate::domain::{Domain, Queues};
use crate::failure;
use crate::health::HealthBoard;
use crate::live::{self, FinishedRun, ServiceEnd, WarmUp};
use crate::on_miss::OnMiss;
use crate::placement::PlacementRequest;
use crate::port::{EventListener, Graph, Link};
use crate::port_error::PortError;
use crate::recorder::Recorder;
use crate::report::{ReportError, RunReport};
use crate::shed::Shedder;
use crate::source::{Source, SourceCycle};
use crate::stage::{Stage, StageCycle};
use crate::topic::{ServiceName, Topic};
use crate::wake::Inputs;

/// Delay between the opened ports and the first frame of a source, ns: time for the others. Chosen
/// by hand: shorter loses first frames on a slow machine; longer only delays the start.
const START_DELAY_NS: u64 = 50_000_000;

/// For tests of what follows a failed assertion: the service that this variable names fails one at
/// the end of its warm-up, if the configuration permits injections.
const FAILS_VARIABLE: &str = "VIGIL_FAILS";

/// What a service process is to be.
#[derive(Debug, Clone, PartialEq)]
pub struct ServicePlan {
    /// Which service.
    pub service: ServiceName,
    /// Name of the graph.
    pub graph: String,
    /// Sizes of the queues.
    pub queues: Queues,
    /// Core and priority.
    pub wanted: PlacementRequest,
    /// Period, deadline and budget.
    pub schedule: Schedule,
    /// What it does about its own misses.
    pub on_miss: OnMiss,
    /// How long it looks for input before it blocks, ns.
    pub spin_ns: u64,
    /// What it leaves behind when it stops.
    pub leave: Leave,
    /// Whether faults may be injected; never on a robot.
    pub allow_injection: bool,
}

/// What a service leaves behind when it stops.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Leave {
    /// Where to write the run report.
    pub report: Option<PathBuf>,
    /// Where to write the stamps of the last cycles, and of how many.
    pub stamps: Option<(PathBuf, usize)>,
    /// No histograms: the report's are empty.
    pub no_timing: bool,
}

impl Leave {
    /// The recorder that keeps what is to be left.
    fn recorder(&self) -> Result<Recorder, PortError> {
        let mut recorder = Recorder::new()?;
        if self.no_timing {
            recorder = recorder.without_timing();
        }
        if let Some((_, capacity)) = &self.stamps {
            recorder = recorder.with_stamps(*capacity);
        }
        Ok(recorder)
    }
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
    /// The stamps could not be written.
    #[error("stamps: {0}")]
    Stamps(#[from] io::Error),
    /// A deadline was missed, and `on_miss` is `stop`.
    #[error("a deadline was missed, and on_miss = \"stop\"")]
    Missed,
    /// The service's own models or settings do not fit.
    #[error("{0}")]
    Build(String),
}

impl ServeError {
    /// Exit code of a service that ended so: 1, or [`EXIT_MISSED`].
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Missed => EXIT_MISSED,
            _ => 1,
        }
    }
}

/// Exit code of a service that a missed deadline has ended: not to be restarted.
pub const EXIT_MISSED: u8 = 3;
/// Exit code of a service that refuses its options or configuration.
pub const EXIT_REFUSED: u8 = 2;

/// The `main` of a service: `prepare` reads and checks all that it needs, `serve` runs it until it
/// is stopped. With `checks_only` it ends in between. Errors go to standard error.
pub fn process<P>(
    service: ServiceName,
    checks_only: bool,
    prepare: impl FnOnce() -> Result<P, Box<dyn Error>>,
    serve: impl FnOnce(P) -> Result<(), ServeError>,
) -> ExitCode {
    let prepared = match prepare() {
        Ok(prepared) => prepared,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(EXIT_REFUSED);
        }
    };
    if checks_only {
        return ExitCode::SUCCESS;
    }
    match serve(prepared) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}: {error}", service.as_str());
            ExitCode::from(error.exit_code())
        }
    }
}

/// Runs a stage that waits for blocks of `T` on `input`, until SIGINT or SIGTERM.
///
/// # Errors
/// [`ServeError`]; what it did until then stays visible in Health.
pub fn stage<T: vigil_blocks::Block, S: Stage>(
    plan: &ServicePlan,
    input: Topic,
    build: impl FnOnce(&Graph) -> Result<S, ServeError>,
) -> Result<(), ServeError> {
    woken_by(plan, |graph| {
        let stage = build(graph)?;
        Ok((stage, listener::<T>(graph, input)?))
    })
}

/// Opens what announces the blocks of a topic.
///
/// # Errors
/// The transport's; that the graph is not in shared memory.
pub fn listener<T: vigil_blocks::Block>(
    graph: &Graph,
    topic: Topic,
) -> Result<EventListener, ServeError> {
    match graph {
        Graph::SharedMemory(link) => Ok(link.listener::<T>(topic)?),
        Graph::InProcess(_) => Err(ServeError::Build("not in shared memory".into())),
    }
}

/// Runs a stage that is woken by what `build` opens with it, until SIGINT or SIGTERM.
///
/// # Errors
/// As [`stage`].
pub fn woken_by<S: Stage, I: Inputs>(
    plan: &ServicePlan,
    build: impl FnOnce(&Graph) -> Result<(S, I), ServeError>,
) -> Result<(), ServeError> {
    let (graph, account) = open(plan)?;
    let (mut stage, inputs) = build(&graph)?;
    let mut cycle = StageCycle::new(account).with_input_of(stage.writer());
    if stage.particles() > 0 {
        cycle = cycle.with_shedder(Shedder::new(stage.particles(), plan.schedule));
    }
    let warm_up = warm_up(plan);
    let run = live::run_stage(&mut cycle, &mut stage, &inputs, plan.spin_ns, warm_up)?;
    leave(plan, cycle.account().recorder(), run)
}

/// Runs a source until SIGINT or SIGTERM.
///
/// # Errors
/// [`ServeError`]; what it did until then stays visible in Health.
pub fn source<S: Source>(
    plan: &ServicePlan,
    build: impl FnOnce(&Graph) -> Result<S, ServeError>,
) -> Result<(), ServeError> {
    let (graph, account) = open(plan)?;
    let mut source = build(&graph)?;
    let first_ns = Monotonic.now_ns() + START_DELAY_NS;
    let mut cycle = SourceCycle::new(account, first_ns);
    let run = live::run_source(&mut cycle, &mut source, plan.spin_ns, warm_up(plan))?;
    leave(plan, cycle.account().recorder(), run)
}

fn warm_up(plan: &ServicePlan) -> WarmUp {
    let name = plan.service.as_str();
    let is_named = || std::env::var_os(FAILS_VARIABLE).is_some_and(|fails| fails == name);
    WarmUp::new(plan.allow_injection && is_named())
}

fn open(plan: &ServicePlan) -> Result<(Graph, CycleAccount), PortError> {
    let domain = Domain::new(&plan.graph, plan.queues)?;
    failure::end_on_panic(domain.failure_file(plan.service));
    let placement = live::place(plan.wanted);
    let graph = Graph::SharedMemory(Link::join(&domain, plan.service.as_str())?);
    let sender = graph.sender(Topic::Health(plan.service))?;
    let health = HealthBoard::new(sender, plan.schedule, plan.wanted, placement);
    let (monitor, recorder) = (DeadlineMonitor::new(plan.schedule), plan.leave.recorder()?);
    let account = CycleAccount::new(monitor, health, recorder).with_on_miss(plan.on_miss);
    Ok((graph, account))
}

fn leave(plan: &ServicePlan, recorder: &Recorder, run: FinishedRun) -> Result<(), ServeError> {
    if let (Some((path, _)), Some(stamps)) = (&plan.leave.stamps, recorder.stamps()) {
        stamps.write(path)?;
    }
    if let Some(path) = &plan.leave.report {
        let service = plan.service.as_str();
        RunReport::new(service, &recorder.timing, run.page_faults)?.write(path)?;
    }
    match run.ended {
        ServiceEnd::Stopped => Ok(()),
        ServiceEnd::Missed => Err(ServeError::Missed),
    }
}
