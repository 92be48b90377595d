//! Runs a cycle on its thread: placement, waiting, orderly stop.

use crate::clock::{self, Clock, Monotonic};
use crate::placement::{self, Placement, PlacementRequest};
use crate::port_error::PortError;
use crate::signal;
use crate::source::{Source, SourceCycle};
use crate::stage::{Stage, StageCycle};
use crate::wake::{self, INPUTS, Inputs, NOTHING, Timer, Wake};

/// No wait is longer than this, ns: the interval of Health, which a source below 20 Hz sends by
/// these wake-ups. A stop request that comes just before a wait is seen after it.
const WAIT_NS_MAX: u64 = 50_000_000;

/// Cycles after which a service is in its steady state: every page is touched, every connection
/// made. Chosen by hand: two seconds at 100 Hz.
const WARM_UP_CYCLES: u64 = 200;

/// How a service's run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ServiceEnd {
    /// SIGINT or SIGTERM.
    Stopped,
    /// It missed a deadline, and that was to end it.
    Missed,
}

/// What a run has shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FinishedRun {
    /// Why it ended.
    pub ended: ServiceEnd,
    /// Minor and major page faults in the steady state; `None` if it was never reached.
    pub page_faults: Option<[u64; 2]>,
}

/// The warm-up of a run: page faults count from its end on.
#[derive(Debug)]
pub(crate) struct WarmUp {
    faults_before: Option<[u64; 2]>,
    fails: bool,
}

impl WarmUp {
    /// A warm-up that ends in a failed assertion if `fails`: for the tests of what follows then.
    pub(crate) const fn new(fails: bool) -> Self {
        Self {
            faults_before: None,
            fails,
        }
    }

    /// Takes the number of cycles done; asks the kernel once.
    fn take(&mut self, cycles: u64) {
        if self.faults_before.is_none() && cycles >= WARM_UP_CYCLES {
            assert!(!self.fails, "an assertion fails because a test wants it");
            self.faults_before = Some(page_faults());
        }
    }

    fn run(&self, ended: ServiceEnd) -> FinishedRun {
        let after = page_faults();
        let since = |before: [u64; 2]| [after[0] - before[0], after[1] - before[1]];
        FinishedRun {
            ended,
            page_faults: self.faults_before.map(since),
        }
    }
}

/// Runs a stage until SIGINT or SIGTERM, or until a miss that is to end it. About when input is
/// expected it looks for it for at most `spin_ns` before it blocks: 0 for never.
///
/// # Errors
/// The transport's; the service ends then and the launcher restarts it.
pub(crate) fn run_stage(
    cycle: &mut StageCycle,
    stage: &mut impl Stage,
    inputs: &impl Inputs,
    spin_ns: u64,
    mut warm_up: WarmUp,
) -> Result<FinishedRun, PortError> {
    let timer = Timer::new().map_err(|e| PortError::setup("timer", e))?;
    let mut ended = ServiceEnd::Stopped;
    cycle.account_mut().ready(&Monotonic)?;
    while !signal::stop_requested() {
        let wake = await_input(cycle, stage, inputs, &timer, spin_ns);
        if cycle.turn(stage, &Monotonic)?.is_break() {
            ended = ServiceEnd::Missed;
            break;
        }
        warm_up.take(cycle.account().health().view().cycles);
        if wake == Wake::Input && !cycle.had_input() {
            // A flood of wake-ups must not hold the core.
            let until_ns = cycle.listens_again_ns(Monotonic.now_ns());
            wake::wait(&timer, [NOTHING; INPUTS], until_ns);
        }
    }
    cycle.account_mut().stop(&Monotonic)?;
    Ok(warm_up.run(ended))
}

/// Returns when there may be input, or something is due, and which.
fn await_input(
    cycle: &StageCycle,
    stage: &impl Stage,
    inputs: &impl Inputs,
    timer: &Timer,
    spin_ns: u64,
) -> Wake {
    let due_ns = cycle.next_wake_ns().min(Monotonic.now_ns() + WAIT_NS_MAX);
    let block_until = |at_ns| {
        let wake = wake::wait(timer, inputs.descriptors(), at_ns);
        if wake == Wake::Input {
            inputs.drain();
        }
        wake
    };
    let expected_ns = cycle.expected_input_ns().filter(|_| spin_ns > 0);
    if let Some(expected_ns) = expected_ns {
        // The wake-up of a block that a spin has found may come only now: it is drained first, so
        // that no block that came since is missed.
        inputs.drain();
        if stage.has_input() {
            return Wake::Input;
        }
        let from_ns = expected_ns.saturating_sub(spin_ns / 2).min(due_ns);
        let until_ns = (expected_ns + spin_ns / 2).min(due_ns);
        if Monotonic.now_ns() < from_ns {
            let wake = block_until(from_ns);
            if wake != Wake::Deadline {
                return wake;
            }
        }
        if spin_until(until_ns, || stage.has_input()) {
            return Wake::Input;
        }
    }
    block_until(due_ns)
}

/// Looks until `found` or the instant has come; true if it was found.
fn spin_until(until_ns: u64, found: impl Fn() -> bool) -> bool {
    loop {
        if found() {
            return true;
        }
        if Monotonic.now_ns() >= until_ns {
            return false;
        }
        std::hint::spin_loop();
    }
}

/// Runs a source until SIGINT or SIGTERM, or until a miss that is to end it. The last `spin_ns`
/// before each instant it does not sleep.
///
/// # Errors
/// The transport's; the service ends then and the launcher restarts it.
pub(crate) fn run_source(
    cycle: &mut SourceCycle,
    source: &mut impl Source,
    spin_ns: u64,
    mut warm_up: WarmUp,
) -> Result<FinishedRun, PortError> {
    let mut ended = ServiceEnd::Stopped;
    cycle.account_mut().ready(&Monotonic)?;
    while !signal::stop_requested() {
        let latest_ns = Monotonic.now_ns() + WAIT_NS_MAX;
        let due_ns = cycle.next_wake_ns();
        let from_ns = due_ns.saturating_sub(spin_ns);
        clock::sleep_until(from_ns.min(latest_ns));
        // Not after a signal, nor long before the instant.
        if spin_ns > 0 && Monotonic.now_ns() >= from_ns {
            spin_until(due_ns, || false);
        }
        if cycle.turn(source, &Monotonic)?.is_break() {
            ended = ServiceEnd::Missed;
            break;
        }
        warm_up.take(cycle.account().health().view().cycles);
    }
    cycle.account_mut().stop(&Monotonic)?;
    Ok(warm_up.run(ended))
}

/// Places the calling thread; see [`placement::apply`].
#[must_use]
pub(crate) fn place(wanted: PlacementRequest) -> Placement {
    signal::install();
    placement::apply(wanted)
}

/// Minor and major page faults of this process so far.
fn page_faults() -> [u64; 2] {
    // SAFETY: getrusage only writes into the zeroed struct that it is given.
    #[allow(unsafe_code)]
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_SELF, &raw mut usage);
        usage
    };
    [usage.ru_minflt as u64, usage.ru_majflt as u64]
}
