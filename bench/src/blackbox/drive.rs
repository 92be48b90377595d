//! The graph, and the black box in its states beside it.

use std::collections::BTreeMap;
use std::error::Error;
use std::fs::{self, File};
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};

use vigil_cycle::{Clock, Monotonic, clock, signal};

use super::half::{Deadlines, Half, Span, State};
use super::process::Process;
use crate::chain::STAGE_NAMES;
use crate::latency::cycles::join;
use crate::latency::graph::{Change, GraphFile, GraphRun};

/// Time after the start, or the orderly end, of a black box that is left out.
const SETTLE: Duration = Duration::from_secs(1);
/// Time for the graph to come up.
const START_LIMIT: Duration = Duration::from_secs(60);
/// Cycles at the start that are no steady state.
const WARM_UP: Duration = Duration::from_secs(2);
/// Between two looks.
const POLL: Duration = Duration::from_millis(50);
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

/// A launched graph; stopped when dropped.
struct Launched(Child);

impl Drop for Launched {
    fn drop(&mut self) {
        if matches!(self.0.try_wait(), Ok(None)) {
            signal::terminate(self.0.id());
            let _ = self.0.wait();
        }
    }
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
        let [printed, errors] = ["printed.json", "errors.txt"].map(|name| folder.join(name));
        let mut command = graph.command(seconds, folder);
        command.stdout(File::create(&printed)?);
        command.stderr(File::create(&errors)?);
        let mut launched = Launched(command.spawn()?);
        wait_until_ready(&graph, &mut launched, &errors)?;
        let spans = self.spans(&graph)?;
        drop(launched);
        let ran = GraphRun::read(&fs::read(printed)?, folder)?;
        Self::split(&graph, &ran, spans)
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
    fn split(graph: &GraphFile, ran: &GraphRun, spans: Vec<Span>) -> Result<Run, Box<dyn Error>> {
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
        let half = |span| {
            Half::new(span, &cycles, deadlines, |at_ns| {
                frames.get(&at_ns).copied()
            })
        };
        let halves: Vec<Half> = spans.into_iter().map(half).collect();
        match halves.iter().all(|half| half.cycles > 0) {
            true => Ok(Run { halves }),
            false => Err("a half without a cycle".into()),
        }
    }
}

/// Waits until every stage answers, and a while longer.
fn wait_until_ready(
    graph: &GraphFile,
    launched: &mut Launched,
    errors: &Path,
) -> Result<(), Box<dyn Error>> {
    let (events, began) = (graph.setup().domain()?.events_file(), Instant::now());
    let is_ready = || fs::read_to_string(&events).is_ok_and(|text| text.contains("\"ready\""));
    while !is_ready() {
        if let Some(status) = launched.0.try_wait()? {
            let said = fs::read_to_string(errors).unwrap_or_default();
            return Err(format!("the graph ended with {status}\n{said}").into());
        }
        if began.elapsed() > START_LIMIT {
            return Err(format!("no graph after {START_LIMIT:?}").into());
        }
        std::thread::sleep(POLL);
    }
    std::thread::sleep(WARM_UP);
    Ok(())
}
