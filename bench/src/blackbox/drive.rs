//! The graph, and the black box in its states beside it.

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::path::Path;
use std::time::Duration;

use vigil_cycle::{Clock, Monotonic, clock};

use super::half::{Asked, Deadlines, Half, Span, State};
use super::process::Process;
use crate::chain::STAGE_NAMES;
use crate::latency::attribution::{Record, misses, was_machine_late};
use crate::latency::canary::{Canary, CanaryRecord};
use crate::latency::cycles::{Cycle, join};
use crate::latency::graph::{Change, GraphFile, GraphRun};
use crate::launched::Launched;

/// Time after the start, or the orderly end, of a black box that is left out.
const SETTLE: Duration = Duration::from_secs(1);
/// Cycles at the start that are no steady state.
const WARM_UP: Duration = Duration::from_secs(2);
/// The machine is late in a cycle if it holds canaries up for longer than usual by this, ns.
/// Chosen: a quarter of what a cycle takes; beyond it a cycle says more of the machine than of the
/// black box.
const LATE_NS: u64 = 50_000;
/// Time around a half, s: to settle, to end a black box, to start another.
const AROUND_S: f64 = 10.0;

/// What is measured.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Rate of the schedule, Hz.
    pub rate_hz: f64,
    /// Length of a half, s.
    pub seconds: f64,
    /// Rounds of four halves.
    pub rounds: usize,
}

/// What was measured.
#[derive(Debug)]
pub struct Run {
    /// The halves, in the order of time.
    pub halves: Vec<Half>,
}

impl Plan {
    /// Measures; what it needs for the time lies in `folder`.
    ///
    /// # Errors
    /// If the graph or the black box fails.
    pub fn run(&self, folder: &Path) -> Result<Run, Box<dyn Error>> {
        let change = Change {
            rate_hz: self.rate_hz,
            particles: 1000,
            is_fifo: true,
            is_faulty: false,
        };
        let graph = GraphFile::new(change, folder)?;
        let seconds = 4.0 * self.rounds as f64 * (self.seconds + AROUND_S);
        let launched = Launched::start(&graph, graph.command(seconds, folder), folder)?;
        std::thread::sleep(WARM_UP);
        let canaries = graph.canaries(seconds)?;
        let spans = self.spans(&graph)?;
        let canaries: Vec<_> = canaries.into_iter().map(Canary::finish).collect();
        let canaries: Option<Vec<CanaryRecord>> = canaries.into_iter().collect();
        let canaries = canaries.ok_or("a canary has died")?;
        if canaries.iter().any(|canary| canary.not_kept > 0) {
            return Err("canaries had no room for all late wake-ups".into());
        }
        let ran = GraphRun::read(&launched.stop()?, folder)?;
        Self::split(&graph, &ran, spans, &canaries)
    }

    /// Brings the black box into each state by turns.
    fn spans(&self, graph: &GraphFile) -> Result<Vec<Span>, Box<dyn Error>> {
        let mut process = Process::new(graph.setup().domain()?);
        let restart = graph.setup().file.restart.delay_ms * 1e-3;
        let restart = Duration::from_secs_f64(restart);
        let mut spans = Vec::new();
        for round in 0..self.rounds {
            eprintln!("round {} of {}", round + 1, self.rounds);
            for state in State::order(round) {
                match state {
                    State::Off => process.stop()?,
                    _ => process.start()?,
                }
                std::thread::sleep(SETTLE);
                spans.push(self.span(round, state, &mut process, restart)?);
            }
        }
        Ok(spans)
    }

    /// One half.
    fn span(
        &self,
        round: usize,
        state: State,
        process: &mut Process,
        restart: Duration,
    ) -> Result<Span, Box<dyn Error>> {
        let cpu_s = process.cpu_s();
        let from_ns = Monotonic.now_ns();
        let until_ns = from_ns + (1e9 * self.seconds) as u64;
        match state {
            State::Off | State::On => (),
            State::Stopped => process.hold(true)?,
            State::Killed => {
                process.kill()?;
                std::thread::sleep(restart);
                process.spawn()?;
            }
        }
        clock::sleep_until(until_ns);
        let span = Span {
            round,
            state,
            from_ns,
            until_ns,
            memory_bytes: process.memory_bytes(),
            ring_bytes: process.ring_bytes(),
            cpu_s: process.cpu_s() - cpu_s,
        };
        if state == State::Stopped {
            process.hold(false)?;
        }
        Ok(span)
    }

    /// Each span with what the services did in it.
    fn split(
        graph: &GraphFile,
        ran: &GraphRun,
        spans: Vec<Span>,
        canaries: &[CanaryRecord],
    ) -> Result<Run, Box<dyn Error>> {
        for name in STAGE_NAMES {
            if ran.summary["services"][name]["restarts"] != 0 {
                return Err(format!("{name} was restarted in the run").into());
            }
        }
        let cycles = join(&ran.stamps, graph.setup().period_ns(), 0);
        let frames = ran.stamps[0].iter();
        let frames = frames.map(|stamps| (stamps.t_schedule_ns, stamps.t_publish_ns));
        let frames: BTreeMap<u64, u64> = frames.collect();
        let deadlines = Deadlines {
            frame_ns: graph.stage_deadline_ns(0),
            action_ns: graph.deadline_ns(),
        };
        let canaries: Vec<Record<'_>> = canaries.iter().map(Record::from_canary).collect();
        let was_published = |at_ns: u64| frames.get(&at_ns).copied();
        let window_ns = deadlines.action_ns;
        let was_late = |cycle: &Cycle| was_machine_late(cycle, window_ns, LATE_NS, &canaries);
        let missed = misses(&cycles, deadlines.action_ns, &canaries).into_iter();
        let of_machine = missed.filter(|miss| miss.is_machine);
        let of_machine: BTreeSet<u64> = of_machine.map(|miss| miss.t_schedule_ns).collect();
        let asked = Asked {
            was_published,
            was_late,
            is_of_machine: |at_ns: u64| of_machine.contains(&at_ns),
        };
        let half = |span| Half::new(span, &cycles, deadlines, &asked);
        let halves: Vec<Half> = spans.into_iter().map(half).collect();
        match halves.iter().all(|half| half.cycles > 0) {
            true => Ok(Run { halves }),
            false => Err("a half without a cycle".into()),
        }
    }
}
