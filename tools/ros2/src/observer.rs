//! Follows a graph from its start, or from now, to its end.

use std::time::{Duration, Instant};

use vigil_cycle::domain::GraphStart;
use vigil_cycle::{Clock, Monotonic, PortError, signal};
use vigil_flight::LiveMessages;
use vigil_setup::RunningGraph;
use vigil_timeline::EventReader;

use crate::feeds::Feeds;
use crate::network::{Network, NetworkError};

/// Between two looks whether the graph runs, which cost system calls.
const LIFE: Duration = Duration::from_secs(1);

/// Why following has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// This program is to stop.
    Stopped,
    /// The graph has ended.
    Ended,
    /// The graph was started anew.
    Replaced,
}

impl Reason {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Self::Stopped => "vigil ros2 has ended",
            Self::Ended => "the graph has ended",
            Self::Replaced => "the graph was started anew",
        }
    }
}

/// Observes one run of a graph.
pub struct Observer<'a> {
    running: &'a RunningGraph,
    start: Option<GraphStart>,
    feeds: Feeds,
    events: EventReader,
}

impl<'a> Observer<'a> {
    /// Joins a graph; with `all` also what the robot says. `is_late`: events of before are passed
    /// over.
    ///
    /// # Errors
    /// The transport's, as when a topic has no place for one more reader.
    pub fn join(running: &'a RunningGraph, all: bool, is_late: bool) -> Result<Self, PortError> {
        let mut events = EventReader::open(&running.domain.events_file());
        if is_late {
            while let Ok(Some(_)) = events.next_entry() {}
        }
        Ok(Self {
            running,
            start: running.domain.start(),
            feeds: Feeds::open(&running.domain, all)?,
            events,
        })
    }

    /// Sends what the graph says until it ends, or this program is to stop.
    ///
    /// # Errors
    /// The network's.
    pub fn follow(
        &mut self,
        messages: &mut LiveMessages,
        network: &Network,
    ) -> Result<Reason, NetworkError> {
        let pause = self.running.setup.observer_pause();
        let mut looked = Instant::now();
        loop {
            if signal::stop_requested() {
                return Ok(Reason::Stopped);
            }
            self.feeds.drain(messages, network)?;
            while let Ok(Some(entry)) = self.events.next_entry() {
                messages.event(&entry, &mut |message| network.send(message))?;
            }
            messages.look(Monotonic.now_ns(), &mut |message| network.send(message))?;
            if looked.elapsed() >= LIFE {
                looked = Instant::now();
                if !self.running.lives() {
                    return Ok(Reason::Ended);
                }
                if self.running.domain.start() != self.start {
                    return Ok(Reason::Replaced);
                }
            }
            std::thread::sleep(pause);
        }
    }
}
