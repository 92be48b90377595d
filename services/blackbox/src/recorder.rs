//! Writes a recording: what the ring holds of the time before, and what follows.

use std::collections::BTreeMap;
use std::error::Error;
use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use vigil_cycle::{Clock, Monotonic, Topic};
use vigil_flight::{FlightError, FlightWriter, part_path};
use vigil_setup::RunningGraph;
use vigil_timeline::{EventReader, TimelineEntry, WallClock};

use crate::folder::{self, RecordingsFolder};
use crate::reason::Reason;
use crate::ring::{Record, RingReader};

/// Between two looks at a ring that has nothing new.
const POLL: Duration = Duration::from_millis(50);
/// Causes of one recording that are kept.
const CAUSES_MAX: usize = 1000;
/// Events reach the launcher's file within this time, ns.
const EVENTS_LATE_NS: u64 = 500_000_000;

/// Why a recording could not be written.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// What was kept cannot be read.
    #[error("the memory of the last seconds: {0}")]
    Ring(io::Error),
    /// The launcher's events cannot be read.
    #[error("the file of events: {0}")]
    Events(io::Error),
    /// Nothing came, and what lay in the place of the file stays.
    #[error("nothing was recorded")]
    Nothing,
    /// The thread that writes has ended otherwise.
    #[error("the thread that writes has failed")]
    Thread,
}

/// What a recording is to hold.
#[derive(Debug, Clone)]
pub struct Order {
    /// Why.
    pub cause: Cause,
    /// From when on, `CLOCK_MONOTONIC` ns.
    pub from_ns: u64,
    /// Until when, ns; further causes may put it off.
    pub until_ns: u64,
    /// Until when at the latest, ns.
    pub until_ns_max: u64,
}

/// Why something is written, in words, and since when.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cause {
    /// Of which kind.
    pub reason: Reason,
    /// When it happened, `CLOCK_MONOTONIC` ns.
    pub t_ns: u64,
    /// In words.
    pub text: String,
}

/// What the thread that writes is told while it does.
#[derive(Debug)]
struct Orders {
    causes: Mutex<Causes>,
    /// True once the graph ends: nothing follows.
    ends: AtomicBool,
}

/// Why a recording is written, and until when.
#[derive(Debug)]
struct Causes {
    /// The first, and those that came since.
    all: Vec<Cause>,
    until_ns: u64,
    /// A later cause begins a recording of its own.
    until_ns_max: u64,
    /// True once nothing more is written: a cause comes too late.
    is_closed: bool,
}

impl Orders {
    fn causes(&self) -> MutexGuard<'_, Causes> {
        self.causes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A recording that is being written, by a thread of its own.
#[derive(Debug)]
pub struct Recording {
    orders: Arc<Orders>,
    thread: JoinHandle<Result<Written, RecordingError>>,
}

/// What a recording is written from, and where to.
pub struct Material {
    /// What the graph runs on.
    pub running: RunningGraph,
    /// Text of that, for an exact replay.
    document: String,
    /// Where recordings lie.
    pub destination: Destination,
    /// The launcher's file of events.
    pub events: PathBuf,
    /// Blocks that came and were overwritten before they were taken, so far.
    pub lost: AtomicU64,
}

/// Where recordings lie.
#[derive(Debug, Clone)]
pub enum Destination {
    /// In a folder of bounded size, each with a name of its own.
    Folder(RecordingsFolder),
    /// The same, of what stays in memory until it is written: a part of it is of no use, and who
    /// runs the graph sees to the folder's bound.
    Rescue(RecordingsFolder),
    /// In this file; what lies there is replaced.
    File(PathBuf),
}

/// A recording that was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// Where.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// Time that its blocks cover.
    pub covered: Duration,
    /// Blocks in it.
    pub blocks: u64,
    /// Blocks that were overwritten before they were taken.
    pub lost: u64,
    /// Times at which blocks were overwritten in the ring before they were written.
    pub gaps: u64,
}

impl Recording {
    /// Begins to write.
    pub fn start(material: &Arc<Material>, ring: RingReader, order: Order) -> Self {
        let orders = Arc::new(Orders {
            causes: Mutex::new(Causes {
                all: vec![order.cause.clone()],
                until_ns: order.until_ns,
                until_ns_max: order.until_ns_max,
                is_closed: false,
            }),
            ends: AtomicBool::new(false),
        });
        let (material, shared) = (Arc::clone(material), Arc::clone(&orders));
        let write = move || {
            // What it will take at least, so that the bound holds while it is written.
            let memory_bytes = material.running.setup.file.blackbox.memory_bytes();
            material.destination.prune(memory_bytes);
            let written = write(&material, ring, &order, &shared);
            shared.causes().is_closed = true;
            material.destination.prune(0);
            written
        };
        Self {
            orders,
            thread: thread::spawn(write),
        }
    }

    /// Has a further cause, and goes on until then, at least; false if it is too late for that.
    pub fn put_off(&self, cause: &Cause, until_ns: u64) -> bool {
        let mut causes = self.orders.causes();
        if causes.is_closed || cause.t_ns > causes.until_ns_max {
            return false;
        }
        causes.until_ns = until_ns.clamp(causes.until_ns, causes.until_ns_max);
        if causes.all.len() < CAUSES_MAX {
            causes.all.push(cause.clone());
        }
        true
    }

    /// True once it is written, or has failed.
    pub fn is_over(&self) -> bool {
        self.thread.is_finished()
    }

    /// Nothing follows: it ends with what there is.
    pub fn end(&self) {
        self.orders.ends.store(true, Ordering::Relaxed);
    }

    /// Nothing follows: writes what there is, and waits for it.
    ///
    /// # Errors
    /// Why it could not be written.
    pub fn finish(self) -> Result<Written, RecordingError> {
        self.end();
        self.thread.join().unwrap_or(Err(RecordingError::Thread))
    }
}

/// Writes a recording, and gives it its name.
fn write(
    material: &Material,
    ring: RingReader,
    order: &Order,
    orders: &Orders,
) -> Result<Written, RecordingError> {
    // The calendar may have been set since the graph began.
    let clock = WallClock::now();
    let destination = &material.destination;
    let path = destination.name(&order.cause, &clock);
    let file = FlightWriter::create(&path, &material.running.setup, clock)?;
    let filling = Filling {
        file,
        ring,
        is_rescue: matches!(destination, Destination::Rescue(_)),
        pending: None,
        events: EventReader::open(&material.events),
        pending_event: None,
        blocks: 0,
        bounds_ns: None,
        order,
        orders,
    };
    match filling.fill(material, &clock) {
        Ok((gravest, mut written)) => {
            let named = destination.name(&gravest, &clock);
            if std::fs::rename(&written.path, &named).is_ok() {
                written.path = named;
            }
            Ok(written)
        }
        Err(error) => {
            let part = part_path(&path);
            match (&error, destination) {
                (RecordingError::Nothing, _) | (_, Destination::Rescue(_)) => {
                    _ = std::fs::remove_file(part);
                }
                (_, Destination::Folder(_)) => _ = folder::adopt(&part),
                (_, Destination::File(_)) => {}
            }
            Err(error)
        }
    }
}

impl Destination {
    fn name(&self, cause: &Cause, clock: &WallClock) -> PathBuf {
        match self {
            Self::Folder(folder) | Self::Rescue(folder) => {
                folder.name(&clock.rfc3339(cause.t_ns), cause.reason.word())
            }
            Self::File(path) => path.clone(),
        }
    }

    /// Makes room for `more` bytes, in a folder whose bound this process sees to.
    pub fn prune(&self, more: u64) {
        if let Self::Folder(folder) = self {
            folder.prune(more);
        }
    }
}

impl Material {
    /// Of a running graph.
    ///
    /// # Errors
    /// Its configuration has no form as text.
    pub fn new(running: RunningGraph, destination: Destination) -> Result<Self, Box<dyn Error>> {
        Ok(Self {
            document: running.document.to_text()?,
            destination,
            lost: AtomicU64::new(0),
            events: running.domain.events_file(),
            running,
        })
    }

    /// What is said of a recording beside its messages.
    fn about(
        &self,
        gravest: &Cause,
        causes: &[Cause],
        clock: &WallClock,
    ) -> BTreeMap<String, String> {
        let time = |cause: &Cause| clock.rfc3339(cause.t_ns);
        let told = causes
            .iter()
            .map(|cause| format!("{} {}", time(cause), cause.text));
        let told: Vec<String> = told.collect();
        let about = [
            ("graph", self.running.domain.graph().to_owned()),
            ("reason", gravest.reason.to_string()),
            ("what", gravest.text.clone()),
            ("when", time(gravest)),
            ("causes", told.join("\n")),
            ("config_hash", format!("{:016x}", self.running.setup.hash)),
        ];
        let about = about.map(|(key, value)| (key.to_owned(), value));
        BTreeMap::from(about)
    }
}

/// A recording that is being filled.
struct Filling<'a> {
    file: FlightWriter,
    ring: RingReader,
    is_rescue: bool,
    /// What lies beyond the present end: it belongs to the recording if that is put off.
    pending: Option<Record>,
    events: EventReader,
    /// An event beyond the present end.
    pending_event: Option<TimelineEntry>,
    /// Blocks so far.
    blocks: u64,
    /// When the first and the last of them came, ns.
    bounds_ns: Option<[u64; 2]>,
    order: &'a Order,
    orders: &'a Orders,
}

impl Filling<'_> {
    /// Writes all of it; the gravest of its causes, and what was written.
    fn fill(
        mut self,
        material: &Material,
        clock: &WallClock,
    ) -> Result<(Cause, Written), RecordingError> {
        let document = material.document.as_bytes();
        self.file
            .attach("document.toml", "application/toml", document)?;
        // A file that is cut short says why it was written, too; the whole reason comes at the end.
        let cause = &self.order.cause;
        let about = material.about(cause, std::slice::from_ref(cause), clock);
        self.file.metadata("vigil", &about)?;
        let lost_before = material.lost.load(Ordering::Relaxed);
        self.fill_until_end()?;
        if self.blocks == 0 {
            return Err(RecordingError::Nothing);
        }
        let mut causes = self.orders.causes().all.clone();
        causes.sort();
        let gravest = causes.first().unwrap_or(&self.order.cause).clone();
        let mut about = material.about(&gravest, &causes, clock);
        let lost = material.lost.load(Ordering::Relaxed);
        let (lost, gaps) = (lost.saturating_sub(lost_before), self.ring.overtaken());
        about.insert("lost".to_owned(), lost.to_string());
        about.insert("gaps".to_owned(), gaps.to_string());
        self.file.metadata("vigil", &about)?;
        let finished = self.file.finish()?;
        let [first_ns, last_ns] = self.bounds_ns.unwrap_or_default();
        let written = Written {
            path: finished.path,
            bytes: finished.bytes,
            covered: Duration::from_nanos(last_ns.saturating_sub(first_ns)),
            blocks: self.blocks,
            lost,
            gaps,
        };
        Ok((gravest, written))
    }

    /// Writes every block and event until the end, which may be put off meanwhile.
    fn fill_until_end(&mut self) -> Result<(), RecordingError> {
        loop {
            let next = match self.pending.take() {
                Some(record) => Some(record),
                None => self.next_record()?,
            };
            let until_ns = self.orders.causes().until_ns;
            match next {
                Some(record) if record.t_ns <= until_ns => {
                    let topic = Topic::ALL.get(usize::from(record.code));
                    if let (Some(topic), true) = (topic, record.t_ns >= self.order.from_ns) {
                        self.file.block(*topic, &record.bytes)?;
                        self.blocks += 1;
                        let [first_ns, _] = self.bounds_ns.unwrap_or([record.t_ns; 2]);
                        self.bounds_ns = Some([first_ns, record.t_ns]);
                    }
                }
                next => {
                    self.pending = next;
                    let is_over = self.is_over();
                    self.events(is_over)?;
                    if is_over {
                        return Ok(());
                    }
                    thread::sleep(POLL);
                }
            }
        }
    }

    /// The ring's next block. One that is broken ends what a killed black box kept.
    fn next_record(&mut self) -> Result<Option<Record>, RecordingError> {
        match self.ring.next_record() {
            Err(_) if self.is_rescue => Ok(None),
            next => next.map_err(RecordingError::Ring),
        }
    }

    /// True, and then no cause is taken any more, if all of the recording's time has passed.
    fn is_over(&self) -> bool {
        let mut causes = self.orders.causes();
        let is_past = Monotonic.now_ns() > causes.until_ns.saturating_add(EVENTS_LATE_NS);
        causes.is_closed = is_past || self.orders.ends.load(Ordering::Relaxed);
        causes.is_closed
    }

    /// Writes the events that have come since; one beyond the present end waits for what becomes
    /// of that.
    fn events(&mut self, is_over: bool) -> Result<(), RecordingError> {
        let until_ns = self.orders.causes().until_ns;
        loop {
            let entry = match self.pending_event.take() {
                Some(entry) => entry,
                None => match self.events.next_entry().map_err(RecordingError::Events)? {
                    Some(entry) => entry,
                    None => return Ok(()),
                },
            };
            if (self.order.from_ns..=until_ns).contains(&entry.t_ns) {
                self.file.event(&entry)?;
            } else if entry.t_ns > until_ns && !is_over {
                self.pending_event = Some(entry);
                return Ok(());
            }
        }
    }
}
