//! A running graph as somebody sees who looks on: its newest blocks, and what is kept of the past.
//! Nothing is ever sent.

mod end_to_end;
mod event_log;
mod history;
#[cfg(test)]
pub mod sample;
mod topics;
mod view;

use std::time::{Duration, Instant, SystemTime};

use vigil_blocks::Faults;
use vigil_cycle::{Clock, KeptBlock, Monotonic};
use vigil_setup::{RunningArgs, RunningGraph, Setup};
use vigil_terminal::CommandError;

pub use end_to_end::Percentiles;
pub use history::History;
pub use view::{Histories, View};

use crate::list::start_time;
use event_log::EventLog;
use topics::Topics;

/// Between two looks at the topics.
pub const POLL: Duration = Duration::from_millis(50);
/// Between two looks at the processes, which cost system calls.
const PROCESSES: Duration = Duration::from_secs(1);
/// How long a first look lasts at least, so that times have a distribution, and at most.
const FIRST: [Duration; 2] = [Duration::from_millis(500), Duration::from_secs(2)];

/// Looks on at a graph.
pub struct Watch {
    running: RunningGraph,
    /// Let go of once the graph has ended.
    topics: Option<Topics>,
    events: EventLog,
    /// When the graph was started.
    start: Option<SystemTime>,
    looked: Instant,
    /// What is known.
    pub view: View,
}

impl Watch {
    /// Joins a running graph.
    ///
    /// # Errors
    /// A graph that does not run; the transport's.
    pub fn join(args: &RunningArgs) -> Result<Self, CommandError> {
        let running = args.find().map_err(CommandError::failure)?;
        Self::join_running(running).map_err(CommandError::failure)
    }

    fn join_running(running: RunningGraph) -> Result<Self, vigil_cycle::PortError> {
        let topics = Topics::join(&running.domain)?;
        let mut watch = Self {
            topics: Some(topics),
            events: EventLog::open(&running.domain.events_file()),
            start: start_time(&running.domain),
            looked: Instant::now(),
            view: View {
                faults: KeptBlock::<Faults>::read_file(&running.domain.faults_file()),
                ..View::default()
            },
            running,
        };
        watch.look_at_processes();
        Ok(watch)
    }

    /// What the graph runs on.
    pub fn setup(&self) -> &Setup {
        &self.running.setup
    }

    /// Looks until every topic has said something, or it is clear that one does not.
    pub fn first_look(&mut self) {
        let began = Instant::now();
        let [least, most] = FIRST;
        while began.elapsed() < least || (began.elapsed() < most && !self.view.is_complete()) {
            self.look();
            std::thread::sleep(POLL);
        }
        self.look();
    }

    /// Takes what has come since the last look.
    pub fn look(&mut self) {
        if let Some(topics) = &mut self.topics {
            topics.take(&mut self.view, Monotonic.now_ns());
        }
        if self.events.read() {
            self.view.events = self.events.newest();
        }
        if self.looked.elapsed() >= PROCESSES {
            self.looked = Instant::now();
            self.look_at_processes();
        }
    }

    /// Sees whether the graph runs, and who belongs to it; joins it again once it was started anew.
    fn look_at_processes(&mut self) {
        let is_other = start_time(&self.running.domain) != self.start;
        let lives = self.running.lives();
        if lives && (is_other || self.topics.is_none()) {
            self.join_again();
            return;
        }
        self.view.has_ended = !lives;
        if !lives {
            self.topics = None;
            self.view.launcher = None;
            self.view.lives = [None; 4];
            return;
        }
        let processes = self.running.processes();
        self.view.launcher = processes.launcher;
        self.view.lives = [None; 4];
        for (service, pid) in processes.services {
            let process = self.running.domain.find_process(pid);
            self.view.lives[service.index()] = Some(process.is_some());
        }
        let up = self
            .start
            .map(|start| SystemTime::now().duration_since(start));
        self.view.up_s = up.and_then(Result::ok).map(|up| up.as_secs_f64());
    }

    /// A graph that is just being started is joined at a later look.
    fn join_again(&mut self) {
        let joined = RunningGraph::read(self.running.domain.graph())
            .ok()
            .and_then(|running| Self::join_running(running).ok());
        if let Some(joined) = joined {
            *self = joined;
        }
    }
}
