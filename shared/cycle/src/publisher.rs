//! A publisher outside the graph: it waits for the graph aloud, fills in headers, and joins the
//! graph again after a restart.

mod channels;

use std::io::Write as _;
use std::time::Duration;

use vigil_blocks::SensorFrame;

use crate::clock::{Clock, Monotonic};
use crate::domain::{Domain, GraphStart};
use crate::port::{Graph, Link, Sender, Stamp};
use crate::port_error::PortError;
use crate::topic::Topic;

pub use channels::{ChannelError, Channels};

/// Interval at which a publisher looks whether its graph is still the one that it has joined, ns.
const LOOK_NS: u64 = 200_000_000;
/// Time between two attempts of a publisher that has nothing else to do.
const PAUSE: Duration = Duration::from_millis(100);
/// A wait is told at once, and then this often, ns.
const REPEAT_NS: u64 = 5_000_000_000;

/// Publishes the frames of a robot into the graph of a name, through shared memory.
///
/// A whole publisher; its crate depends on `vigil-blocks` and `vigil-cycle`.
///
/// ```no_run
/// use std::time::Duration;
///
/// use vigil_blocks::SensorFrame;
/// use vigil_cycle::{Clock, Monotonic, Publisher, clock};
///
/// fn main() -> Result<(), Box<dyn std::error::Error>> {
///     let mut publisher = Publisher::join("rover")?;
///     let mut due_ns = Monotonic.now_ns();
///     loop {
///         due_ns += Duration::from_millis(50).as_nanos() as u64;
///         clock::sleep_until(due_ns);
///         let mut frame = SensorFrame::default();
///         let channels = publisher.channels();
///         channels.command(&mut frame, "cmd_speed", 0.2)?;
///         channels.command(&mut frame, "cmd_curv", 0.0)?;
///         // And so on with what your sensors read: `vigil channels` prints the names.
///         channels.set(&mut frame, "x", 0.1)?;
///         publisher.publish(&frame, due_ns)?;
///     }
/// }
/// ```
pub struct Publisher {
    graph: String,
    joined: Option<Joined>,
    channels: Channels,
    look_ns: u64,
    told_ns: Option<u64>,
}

/// What holds for one start of the graph.
struct Joined {
    // Before the link that it was opened with.
    sender: Box<dyn Sender<SensorFrame>>,
    _graph: Graph,
    start: Option<GraphStart>,
}

impl Publisher {
    /// Waits for the graph of this name; says on standard error what it waits for.
    ///
    /// # Errors
    /// [`PortError`] that no waiting helps against: other types, or another publisher.
    pub fn join(graph: &str) -> Result<Self, PortError> {
        let mut publisher = Self {
            graph: graph.to_owned(),
            joined: None,
            channels: Channels::default(),
            look_ns: 0,
            told_ns: None,
        };
        while !publisher.try_to_join()? {
            std::thread::sleep(PAUSE);
        }
        Ok(publisher)
    }

    /// The channel list of the graph, which sets values by their names.
    #[must_use]
    pub const fn channels(&self) -> &Channels {
        &self.channels
    }

    /// Publishes a frame that was due at this instant of CLOCK_MONOTONIC, ns; false if there is no
    /// graph to take it. It never waits: if the graph has ended it says so, and joins the next one
    /// of that name. The header is filled in; a capture time of 0 becomes `due_ns`.
    ///
    /// # Errors
    /// As [`Self::join`].
    pub fn publish(&mut self, frame: &SensorFrame, due_ns: u64) -> Result<bool, PortError> {
        let now_ns = Monotonic.now_ns();
        if now_ns >= self.look_ns {
            self.look_ns = now_ns + LOOK_NS;
            self.look()?;
        }
        let Some(Joined { sender, .. }) = &mut self.joined else {
            return Ok(false);
        };
        *sender.block() = *frame;
        let stamp = Stamp {
            t_schedule_ns: due_ns,
            t_capture_ns: match frame.header.t_capture_ns {
                0 => due_ns,
                given => given,
            },
        };
        match sender.send(stamp, &Monotonic) {
            Ok(_) => Ok(true),
            // Between two looks the graph has taken its files away.
            Err(_) if !self.is_joined() => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// True while the graph is the one that it has joined.
    fn is_joined(&self) -> bool {
        let start = Domain::running(&self.graph).and_then(|domain| domain.start());
        let is_same = |joined: &Joined| joined.start == start;
        self.joined.as_ref().is_some_and(is_same)
    }

    /// Looks for the graph; joins the one that there is.
    fn look(&mut self) -> Result<(), PortError> {
        if self.is_joined() {
            return Ok(());
        }
        self.joined = None;
        self.try_to_join().map(|_| ())
    }

    fn try_to_join(&mut self) -> Result<bool, PortError> {
        let Some(domain) = Domain::running(&self.graph) else {
            self.tell(&format!("graph '{}'", self.graph));
            return Ok(false);
        };
        // Before all else: a graph that starts anew meanwhile is found out.
        let start = domain.start();
        let opened = Link::join_as_guest(&domain, "publisher").and_then(|link| {
            let graph = Graph::SharedMemory(link);
            Ok((graph.sender::<SensorFrame>(Topic::Sensor)?, graph))
        });
        let (sender, graph) = match opened {
            Ok(opened) => opened,
            Err(error) if error.is_coming() || domain.start() != start => {
                self.tell(&format!("the topics of graph '{}'", self.graph));
                return Ok(false);
            }
            Err(error) => return Err(error),
        };
        let Ok(channels) = Channels::read(&domain.channels_file()) else {
            return Ok(false);
        };
        self.channels = channels;
        self.joined = Some(Joined {
            sender,
            _graph: graph,
            start,
        });
        if self.told_ns.take().is_some() {
            say(&format!("joined graph '{}'", self.graph));
        }
        Ok(true)
    }

    /// Says what it waits for, unless it has said so just now.
    fn tell(&mut self, what: &str) {
        let now_ns = Monotonic.now_ns();
        if self.told_ns.is_some_and(|told| now_ns < told + REPEAT_NS) {
            return;
        }
        self.told_ns = Some(now_ns);
        let running = match Domain::all_running() {
            none if none.is_empty() => "none".to_owned(),
            names => names.join(", "),
        };
        say(&format!("waiting for {what}; running: {running}"));
    }
}

/// That nobody reads it is no reason to end a robot's program.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}
