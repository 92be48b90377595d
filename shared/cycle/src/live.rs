//! Runs a cycle on its thread: placement, waiting, orderly stop.

use crate::clock::{self, Clock, Monotonic};
use crate::placement::{self, Placement, Wanted};
use crate::port::EventListener;
use crate::port::PortError;
use crate::signal;
use crate::source::{Source, SourceCycle};
use crate::stage::{Stage, StageCycle};
use crate::wake::{self, Timer, Wake};

/// No wait is longer than this, ns: a stop request is seen at the latest then.
const WAIT_NS_MAX: u64 = 50_000_000;

/// Runs a stage until SIGINT or SIGTERM.
///
/// # Errors
/// The transport's; the service ends then and the launcher restarts it.
pub fn run_stage(
    cycle: &mut StageCycle,
    stage: &mut impl Stage,
    listener: &EventListener,
) -> Result<(), PortError> {
    let timer = Timer::new().map_err(|e| PortError::setup("timer", &e))?;
    cycle.ready(&Monotonic)?;
    while !signal::stop_requested() {
        let latest_ns = Monotonic.now_ns() + WAIT_NS_MAX;
        if wake::wait(
            &timer,
            listener.descriptor(),
            cycle.next_wake_ns().min(latest_ns),
        ) == Wake::Input
        {
            listener.drain();
        }
        cycle.turn(stage, &Monotonic)?;
    }
    cycle.stop(&Monotonic)
}

/// Runs a source until SIGINT or SIGTERM.
///
/// # Errors
/// The transport's; the service ends then and the launcher restarts it.
pub fn run_source(cycle: &mut SourceCycle, source: &mut impl Source) -> Result<(), PortError> {
    cycle.ready(&Monotonic)?;
    while !signal::stop_requested() {
        let latest_ns = Monotonic.now_ns() + WAIT_NS_MAX;
        clock::sleep_until(cycle.next_wake_ns().min(latest_ns));
        cycle.turn(source, &Monotonic)?;
    }
    cycle.stop(&Monotonic)
}

/// Places the calling thread; see [`placement::apply`].
#[must_use]
pub fn place(wanted: Wanted) -> Placement {
    signal::install();
    placement::apply(wanted)
}

/// Minor and major page faults of this process so far.
#[must_use]
pub fn page_faults() -> [u64; 2] {
    // SAFETY: getrusage only writes into the zeroed struct that it is given.
    #[allow(unsafe_code)]
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_SELF, &raw mut usage);
        usage
    };
    [usage.ru_minflt as u64, usage.ru_majflt as u64]
}
