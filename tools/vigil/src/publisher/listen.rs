//! Listens to a publisher: beside a running graph, or in its place.

use std::fs;
use std::path::PathBuf;

use vigil_blocks::datagram::{self, DATAGRAM_SIZE};
use vigil_blocks::{Action, Health, REJECTIONS, SensorFrame};
use vigil_cycle::datagrams::Datagrams;
use vigil_cycle::port::{EventListener, FoundTopic, Link};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::wake::{self, Inputs, Timer};
use vigil_cycle::{
    Clock, Graph, InputAccount, Monotonic, PortError, Receiver, Topic, Writer, signal,
};
use vigil_robot::FrameGuard;
use vigil_sensor_sim::{ArrivalBatch, ArrivalClock};
use vigil_setup::Border;
use vigil_setup::graph_file::Source;

use super::{BorderReport, FrameArrival, Reception};

/// Frames that are kept.
pub const FRAMES_MAX: usize = 500_000;
/// Datagrams that are taken at once.
const DATAGRAMS_MAX: usize = 64;
/// Longest sleep, ns: a wish to stop is heard then.
const SLEEP_NS: u64 = 50_000_000;

/// Takes a frame that was heard; true if a graph takes it.
pub type FrameSink<'a> = &'a mut dyn FnMut(&mut Reception, FrameArrival, bool);

/// Listens for `seconds`, or until a signal, and gives each frame to `sink`; what was heard, and
/// why no more.
///
/// # Errors
/// That there is no place for a graph.
pub fn listen(
    border: &Border,
    seconds: f64,
    sink: FrameSink<'_>,
) -> Result<(Reception, Option<PortError>), PortError> {
    let domain = border.domain()?;
    // Held as long as this listens: no graph is started meanwhile.
    let lock = domain.lock().map_err(|e| PortError::setup("lock", e))?;
    let mut heard = Reception {
        is_graph_running: lock.is_none(),
        ..Reception::default()
    };
    signal::install();
    let sign = if lock.is_some() {
        border
            .tell_publishers(&domain)
            .map_err(|e| PortError::setup("runtime folder", e))?;
        Some(Sign::put(domain.processes_file())?)
    } else {
        None
    };
    let listened = if border.file.sensor.source == Source::Socket && lock.is_some() {
        sockets(border, seconds, &mut heard, sink)
    } else {
        let listened = topic(border, seconds, &mut heard, sink);
        if heard.topic.is_none() {
            heard.topic = found_topic(border)?;
        }
        listened
    };
    if sign.is_some() && listened.is_ok() {
        domain.remove_residue();
    }
    Ok((heard, listened.err()))
}

/// The file by which publishers know that a graph runs; taken away when dropped.
struct Sign(PathBuf);

impl Sign {
    fn put(path: PathBuf) -> Result<Self, PortError> {
        fs::write(&path, "").map_err(|e| PortError::setup("runtime folder", e))?;
        Ok(Self(path))
    }
}

impl Drop for Sign {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

impl Reception {
    /// Keeps a frame, if there is room.
    pub fn keep(&mut self, arrival: FrameArrival) {
        if self.frames.len() < FRAMES_MAX {
            self.frames.push(arrival);
        } else {
            self.more += 1;
        }
    }
}

/// What a graph would refuse.
pub(super) struct Guard {
    account: InputAccount,
    content: FrameGuard,
    period_ns: u64,
}

impl Guard {
    pub fn new(border: &Border) -> Self {
        Self {
            account: InputAccount::new(match border.file.sensor.source {
                Source::Socket => Writer::Socket,
                _ => Writer::Publisher,
            }),
            content: FrameGuard::new(&border.robot),
            period_ns: border.period_ns(),
        }
    }

    /// True if a graph would take it.
    pub fn take(&mut self, frame: &SensorFrame, now_ns: u64) -> bool {
        let content = || self.content.check(frame);
        self.account
            .admit::<SensorFrame>(&frame.header, now_ns, self.period_ns, content)
            .is_taken()
    }

    /// What it refused, by cause.
    pub const fn rejected(&self) -> [u64; REJECTIONS] {
        self.account.rejected
    }
}

/// Calls `take` whenever there may be input, and whether an event says so, until the time is over.
fn while_it_lasts(
    seconds: f64,
    inputs: &impl Inputs,
    heard: &mut Reception,
    mut take: impl FnMut(&mut Reception, bool),
) -> Result<(), PortError> {
    let timer = Timer::new().map_err(|e| PortError::setup("timer", e))?;
    let from_ns = Monotonic.now_ns();
    let until_ns = from_ns.saturating_add((seconds * 1e9) as u64);
    while Monotonic.now_ns() < until_ns && !signal::stop_requested() {
        let next_ns = (Monotonic.now_ns() + SLEEP_NS).min(until_ns);
        let is_told = wake::wait(&timer, inputs.descriptors(), next_ns) == wake::Wake::Input;
        if is_told {
            inputs.drain();
        }
        take(heard, is_told);
    }
    heard.seconds = Monotonic.now_ns().saturating_sub(from_ns) as f64 * 1e-9;
    Ok(())
}

/// The sensor's topic as it is, if it is there.
fn found_topic(border: &Border) -> Result<Option<FoundTopic>, PortError> {
    let path = Topic::Sensor.path(&border.file.graph.name);
    let mut all = FoundTopic::all(&border.domain()?)?.into_iter();
    Ok(all.find(|topic| topic.path == path))
}

/// Reads the sensor's topic.
fn topic(
    border: &Border,
    seconds: f64,
    heard: &mut Reception,
    sink: FrameSink<'_>,
) -> Result<(), PortError> {
    let domain = border.domain()?;
    let graph = Graph::SharedMemory(Link::join(&domain, "check-publisher")?);
    let Graph::SharedMemory(link) = &graph else {
        return Ok(());
    };
    let mut frames = graph.receiver::<SensorFrame>(Topic::Sensor)?;
    let listener: EventListener = link.listener::<SensorFrame>(Topic::Sensor)?;
    // Publishers that obey actions wait for their topic: in the graph's place nobody else makes it.
    let _actions = if heard.is_graph_running {
        None
    } else {
        Some(graph.sender::<Action>(Topic::Action)?)
    };
    let mut guard = Guard::new(border);
    let mut health = BorderHealth::new(border, &graph)?;
    let (mut arrived, mut is_heard) = (Vec::with_capacity(frames.buffer()), false);
    while_it_lasts(seconds, &listener, heard, |heard, is_told| {
        health.look();
        for _ in 0..frames.buffer() {
            let Some(frame) = frames.take_next() else {
                break;
            };
            arrived.push((*frame, Monotonic.now_ns()));
        }
        // Who joins is given frames that were sent before: of the first batch the newest counts.
        let old = match is_heard {
            true => 0,
            false => arrived.len().saturating_sub(1),
        };
        for (frame, now_ns) in arrived.drain(..).skip(old) {
            is_heard = true;
            heard.unannounced += u64::from(!is_told);
            let is_taken = guard.take(&frame, now_ns);
            sink(heard, FrameArrival { now_ns, frame }, is_taken);
        }
    })?;
    heard.topic = found_topic(border)?;
    heard.rejected = if heard.is_graph_running {
        heard.border = health.report();
        health.rejected()
    } else {
        guard.rejected()
    };
    Ok(())
}

/// Reads the sockets that a graph would read.
fn sockets(
    border: &Border,
    seconds: f64,
    heard: &mut Reception,
    sink: FrameSink<'_>,
) -> Result<(), PortError> {
    let socket = &border.file.sensor.socket;
    let folder = border.domain()?.folder().to_owned();
    let unix = (!socket.unix.is_empty()).then(|| folder.join(&socket.unix));
    let udp = socket
        .udp_address()
        .map_err(|e| PortError::setup("sensor.socket.udp", e))?;
    let datagrams = Datagrams::bind(udp, unix.as_deref());
    let datagrams = datagrams.map_err(|e| PortError::setup("sensor.socket", e))?;
    let datagrams = std::rc::Rc::new(datagrams);
    let (mut guard, mut clock) = (Guard::new(border), ArrivalClock::default());
    let mut arrived = Vec::with_capacity(DATAGRAMS_MAX);
    while_it_lasts(seconds, &datagrams, heard, |heard, _| {
        let mut buffer = [0; DATAGRAM_SIZE + 1];
        arrived.clear();
        for _ in 0..DATAGRAMS_MAX {
            let Some((length, _)) = datagrams.receive(&mut buffer) else {
                break;
            };
            match datagram::decode(&buffer[..length]) {
                Ok(frame) => arrived.push(frame),
                Err(rejection) => {
                    guard.account.reject(rejection);
                }
            }
        }
        let now_ns = Monotonic.now_ns();
        for mut frame in arrived.iter().copied() {
            let here = ArrivalBatch {
                headers: arrived.iter().map(|other: &SensorFrame| &other.header),
                is_complete: arrived.len() < DATAGRAMS_MAX,
            };
            let dated = clock.date(&mut frame.header, here, now_ns);
            let is_taken = guard.take(&frame, now_ns);
            if is_taken {
                clock = dated;
            }
            sink(heard, FrameArrival { now_ns, frame }, is_taken);
        }
    })?;
    heard.rejected = guard.rejected();
    Ok(())
}

/// The service at the border of a running graph: what it refuses.
struct BorderHealth {
    health: Box<dyn Receiver<Health>>,
    is_socket: bool,
    /// The first report and the newest.
    window: Option<[Box<Health>; 2]>,
}

impl BorderHealth {
    fn new(border: &Border, graph: &Graph) -> Result<Self, PortError> {
        let service = match border.file.sensor.source {
            Source::Socket => ServiceName::SensorSim,
            _ => ServiceName::Detector,
        };
        Ok(Self {
            health: graph.receiver(Topic::Health(service))?,
            is_socket: service == ServiceName::SensorSim,
            window: None,
        })
    }

    fn look(&mut self) {
        while let Some(health) = self.health.take_next() {
            let window = self
                .window
                .get_or_insert_with(|| [Box::new(*health), Box::new(*health)]);
            *window[1] = *health;
        }
    }

    /// Since the first look; counters of a service that was restarted begin anew.
    fn since(&self, of: impl Fn(&Health) -> u64) -> u64 {
        self.window.as_ref().map_or(0, |[first, last]| {
            let (before, now) = (of(first), of(last));
            now.checked_sub(before).unwrap_or(now)
        })
    }

    fn rejected(&self) -> [u64; REJECTIONS] {
        std::array::from_fn(|i| self.since(|health| health.rejected[i]))
    }

    fn report(&self) -> Option<BorderReport> {
        let [_, last] = self.window.as_ref()?;
        Some(BorderReport {
            period_ns: last.period_ns.max(1),
            lost_at_socket: self.is_socket.then(|| self.since(|health| health.lost)),
        })
    }
}
