//! Writes a recording: what the ring holds of the time before, and what follows.

use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use vigil_blocks::Header;
use vigil_cycle::{Clock, Monotonic};
use vigil_flight::{FlightError, FlightWriter};
use vigil_setup::RunningGraph;
use vigil_timeline::{EventReader, WallClock};

use crate::feeds::TOPICS;
use crate::folder::RecordingsFolder;
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
    /// Until when, ns; a later order may put it off.
    pub until_ns: u64,
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
    until_ns: AtomicU64,
    /// The first, and those that came since.
    causes: Mutex<Vec<Cause>>,
    /// True once the graph ends: nothing follows.
    ends: AtomicBool,
}

/// A recording that is being written, by a thread of its own.
#[derive(Debug)]
pub struct Recording {
    orders: Arc<Orders>,
    thread: JoinHandle<Result<PathBuf, RecordingError>>,
}

/// What a recording is written from, and where to.
pub struct Material {
    /// What the graph runs on.
    pub running: RunningGraph,
    /// Text of that, for an exact replay.
    pub document: String,
    /// Where recordings lie.
    pub folder: RecordingsFolder,
    /// Instants by the calendar.
    pub clock: WallClock,
    /// Blocks that came and were overwritten before they were taken, so far.
    pub lost: AtomicU64,
}

impl Recording {
    /// Begins to write.
    pub fn start(material: &Arc<Material>, ring: RingReader, order: Order) -> Self {
        let orders = Arc::new(Orders {
            until_ns: AtomicU64::new(order.until_ns),
            causes: Mutex::new(vec![order.cause.clone()]),
            ends: AtomicBool::new(false),
        });
        let (material, shared) = (Arc::clone(material), Arc::clone(&orders));
        Self {
            orders,
            thread: thread::spawn(move || {
                // What it will take at least, so that the bound holds while it is written.
                material
                    .folder
                    .prune(material.running.setup.file.blackbox.memory_bytes());
                let written = write(&material, ring, &order, &shared);
                if written.is_err() {
                    material.folder.adopt_parts();
                }
                material.folder.prune(0);
                written
            }),
        }
    }

    /// Has a further cause, and goes on until then, at least.
    pub fn put_off(&self, cause: Cause, until_ns: u64) {
        self.orders.until_ns.fetch_max(until_ns, Ordering::Relaxed);
        let causes = self.orders.causes.lock();
        let mut causes = causes.unwrap_or_else(PoisonError::into_inner);
        if causes.len() < CAUSES_MAX {
            causes.push(cause);
        }
    }

    /// True once it is written, or has failed.
    pub fn is_over(&self) -> bool {
        self.thread.is_finished()
    }

    /// Nothing follows: writes what there is, and waits for it.
    ///
    /// # Errors
    /// Why it could not be written.
    pub fn finish(self) -> Result<PathBuf, RecordingError> {
        self.orders.ends.store(true, Ordering::Relaxed);
        self.thread.join().unwrap_or(Err(RecordingError::Thread))
    }
}

/// When a block was published, ns; `None` of what is no block.
fn published_ns(record: &Record) -> Option<u64> {
    let header = record.bytes.get(..size_of::<Header>())?;
    Some(bytemuck::pod_read_unaligned::<Header>(header).t_publish_ns)
}

fn write(
    material: &Material,
    mut ring: RingReader,
    order: &Order,
    orders: &Orders,
) -> Result<PathBuf, RecordingError> {
    let Material {
        running,
        document,
        folder,
        clock,
        lost,
    } = material;
    let lost_before = lost.load(Ordering::Relaxed);
    let graph = running.domain.graph();
    let name = |cause: &Cause| folder.name(graph, &clock.rfc3339(cause.t_ns), cause.reason.word());
    let path = name(&order.cause);
    let mut file = FlightWriter::create(&path, &running.setup, *clock)?;
    file.attach("document.toml", "application/toml", document.as_bytes())?;
    loop {
        let until_ns = orders.until_ns.load(Ordering::Relaxed);
        let Some(record) = ring.next_record().map_err(RecordingError::Ring)? else {
            let is_over = Monotonic.now_ns() > until_ns + EVENTS_LATE_NS;
            if is_over || orders.ends.load(Ordering::Relaxed) {
                break;
            }
            thread::sleep(POLL);
            continue;
        };
        let is_within = |t_ns: u64| (order.from_ns..=until_ns).contains(&t_ns);
        if let (Some(topic), true) = (
            TOPICS.get(usize::from(record.code)),
            published_ns(&record).is_some_and(is_within),
        ) {
            file.block(*topic, &record.bytes)?;
        }
    }
    let until_ns = orders.until_ns.load(Ordering::Relaxed);
    let mut events = EventReader::open(&running.domain.events_file());
    while let Some(entry) = events.next_entry().map_err(RecordingError::Events)? {
        if (order.from_ns..=until_ns).contains(&entry.t_ns) {
            file.event(&entry)?;
        }
    }
    let mut causes = orders
        .causes
        .lock()
        .map_or_else(|_| Vec::new(), |causes| causes.clone());
    causes.sort();
    let gravest = causes.first().unwrap_or(&order.cause);
    let mut about = about(material, gravest, &causes);
    about.insert("gaps".into(), ring.overtaken().to_string());
    let lost = lost.load(Ordering::Relaxed) - lost_before;
    about.insert("lost".into(), lost.to_string());
    file.metadata("vigil", &about)?;
    file.finish()?;
    // The gravest cause names it.
    let named = name(gravest);
    Ok(match std::fs::rename(&path, &named) {
        Ok(()) => named,
        Err(_) => path,
    })
}

/// What is said of a recording beside its messages.
fn about(material: &Material, gravest: &Cause, causes: &[Cause]) -> BTreeMap<String, String> {
    let Material { running, clock, .. } = material;
    let told = causes.iter();
    let told = told.map(|cause| format!("{} {}", clock.rfc3339(cause.t_ns), cause.text));
    let told: Vec<String> = told.collect();
    let about = [
        ("graph", running.domain.graph().to_owned()),
        ("reason", gravest.reason.to_string()),
        ("what", gravest.text.clone()),
        ("when", clock.rfc3339(gravest.t_ns)),
        ("causes", told.join("\n")),
        ("config_hash", format!("{:016x}", running.setup.hash)),
    ];
    let about = about.map(|(key, value)| (key.to_owned(), value));
    BTreeMap::from(about)
}
