//! A recording of a running graph into a file of somebody's own, from now on.

use std::error::Error;
use std::fs;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

use vigil_blackbox::RecordDocument;
use vigil_cycle::port::Link;
use vigil_cycle::{Clock, Graph, Monotonic, signal};
use vigil_flight::part_path;
use vigil_setup::RunningGraph;

use crate::feeds::Feeds;
use crate::reason::Reason;
use crate::recorder::{Cause, Destination, Material, Order, Recording, RecordingError, Written};
use crate::ring::RingWriter;
use crate::say::say;

/// Largest memory for what the disk has not taken yet, bytes.
const MEMORY_BYTES: u64 = 32 << 20;
/// Between two lines of progress, and two looks whether the graph still runs.
const TOLD: Duration = Duration::from_secs(1);
/// Bytes of a MiB.
const MIB: f64 = (1 << 20) as f64;

/// Records into `path` until the duration is over, somebody ends it, or the graph ends. What lies
/// at `path` is replaced by it. Says what was written, as JSON for programs. True if there was
/// something to record.
///
/// # Errors
/// The transport's, and those of the file. What was written by then stays, with `.part` after its
/// name.
pub fn run(
    running: RunningGraph,
    path: &Path,
    duration: Option<Duration>,
    json: bool,
) -> Result<bool, Box<dyn Error>> {
    signal::install();
    let destination = Destination::File(path.to_owned());
    let material = Arc::new(Material::new(running, destination)?);
    let progress = Progress::new(path, !json && io::stderr().is_terminal());
    let written = match record(&material, progress, duration)?.finish() {
        Ok(written) => Some(written),
        Err(nothing @ RecordingError::Nothing) => {
            say(&nothing.to_string());
            None
        }
        Err(error) => return Err(error.into()),
    };
    let said = match json {
        true => Some(serde_json::to_string_pretty(&document(written.as_ref()))?),
        false => written.as_ref().map(text),
    };
    if let Some(said) = said {
        print(&said)?;
    }
    Ok(written.is_some())
}

/// Takes what comes until the end; the recording that is still being written.
fn record(
    material: &Arc<Material>,
    mut progress: Progress,
    duration: Option<Duration>,
) -> Result<Recording, Box<dyn Error>> {
    let running = &material.running;
    let mut ring = ring(running)?;
    let mut feeds = Feeds::open(&Graph::SharedMemory(Link::join(&running.domain, "record")?))?;
    let recording = Recording::start(material, ring.reader(), order(duration));
    let pause = running.setup.observer_pause();
    let (mut is_deserted, mut news) = (false, Vec::new());
    while !is_deserted && !signal::stop_requested() && !recording.is_over() {
        thread::sleep(pause);
        is_deserted = feeds.is_deserted() || progress.is_due() && !running.lives();
        feeds.drain(&mut ring, &mut news)?;
        news.clear();
        material.lost.store(feeds.lost(), Ordering::Relaxed);
    }
    drop(progress);
    if is_deserted {
        say("the graph has ended");
    }
    Ok(recording)
}

/// A ring of its own beside that of the graph's black box; it is gone with this process.
fn ring(running: &RunningGraph) -> io::Result<RingWriter> {
    let id = std::process::id();
    let path = running.domain.folder().join(format!("record-{id}"));
    let memory_bytes = running.setup.file.blackbox.memory_bytes();
    let ring = RingWriter::create(&path, memory_bytes.min(MEMORY_BYTES))?;
    fs::remove_file(path)?;
    Ok(ring)
}

fn order(duration: Option<Duration>) -> Order {
    let now_ns = Monotonic.now_ns();
    let until_ns = duration.map_or(u64::MAX, |duration| {
        let ns = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        now_ns.saturating_add(ns)
    });
    Order {
        cause: Cause {
            reason: Reason::Record,
            t_ns: now_ns,
            text: "vigil record".to_owned(),
        },
        from_ns: now_ns,
        until_ns,
        until_ns_max: until_ns,
    }
}

fn document(written: Option<&Written>) -> RecordDocument {
    RecordDocument {
        schema_version: 1,
        recording: written.map(|it| it.path.display().to_string()),
        bytes: written.map_or(0, |it| it.bytes),
        recorded_s: written.map_or(0.0, |it| it.covered.as_secs_f64()),
        blocks: written.map_or(0, |it| it.blocks),
        lost: written.map_or(0, |it| it.lost),
        gaps: written.map_or(0, |it| it.gaps),
    }
}

fn text(written: &Written) -> String {
    let mut text = format!(
        "{}: {:.1} s, {:.1} MiB, {} blocks",
        written.path.display(),
        written.covered.as_secs_f64(),
        written.bytes as f64 / MIB,
        written.blocks
    );
    if written.lost > 0 {
        text.push_str(&format!(", {} lost", written.lost));
    }
    if written.gaps > 0 {
        text.push_str(&format!(", {} gaps: the disk is too slow", written.gaps));
    }
    text
}

/// Prints a line; a closed pipe is no failure.
fn print(text: &str) -> io::Result<()> {
    match writeln!(io::stdout(), "{text}") {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

/// Says on a terminal how far a recording is.
struct Progress {
    part: PathBuf,
    began: Instant,
    told: Instant,
    is_shown: bool,
}

impl Progress {
    fn new(path: &Path, is_shown: bool) -> Self {
        let now = Instant::now();
        Self {
            part: part_path(path),
            began: now,
            told: now,
            is_shown,
        }
    }

    /// True once a second, when it also shows it.
    fn is_due(&mut self) -> bool {
        if self.told.elapsed() < TOLD {
            return false;
        }
        self.told = Instant::now();
        if self.is_shown {
            let bytes = fs::metadata(&self.part).map_or(0, |metadata| metadata.len());
            let (passed_s, mib) = (self.began.elapsed().as_secs(), bytes as f64 / MIB);
            let _ = write!(io::stderr(), "\r{passed_s:8} s  {mib:8.1} MiB ");
        }
        true
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.is_shown {
            // Back to the start of the line, and clear it.
            let _ = write!(io::stderr(), "\r\x1b[K");
        }
    }
}
