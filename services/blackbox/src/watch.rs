//! The black box from its start to its end.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use vigil_cycle::port::Link;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Clock, Graph, Monotonic, placement, signal};
use vigil_setup::{RunningGraph, Setup};
use vigil_timeline::WallClock;

use crate::feeds::{Feeds, News};
use crate::folder::RecordingsFolder;
use crate::reason::Reason;
use crate::recorder::{Cause, Material, Order, Recording};
use crate::ring::{RingReader, RingWriter};

/// Longest pause between two looks: what is lost when this process is killed.
const POLL_MAX: Duration = Duration::from_millis(50);
/// Nanoseconds of a second.
const NS: f64 = 1e9;

/// Keeps and writes until it is asked to stop.
pub fn run(running: RunningGraph) -> Result<(), Box<dyn Error>> {
    signal::install();
    let setup = &running.setup;
    placement::keep_off(&ServiceName::ALL.map(|name| setup.service(name).core));
    let settings = setup.file.blackbox.clone();
    let graph = running.domain.graph().to_owned();
    let path = settings.folder(&setup.path, &graph);
    let folder = RecordingsFolder::open(path, settings.folder_bytes())?;
    for cut in folder.adopt_parts() {
        eprintln!("vigil-blackbox: {} was not finished", cut.display());
    }
    let material = Arc::new(Material {
        document: running.document.to_text()?,
        clock: WallClock::now(),
        lost: AtomicU64::new(0),
        folder,
        running,
    });
    let domain = &material.running.domain;
    let mut rescue = rescue(&material, &domain.ring_file());
    let ring = RingWriter::create(&domain.ring_file(), settings.memory_bytes())?;
    let mut feeds = Feeds::open(&Graph::SharedMemory(Link::join(domain, "blackbox")?))?;
    let mut blackbox = Blackbox {
        before_ns: (settings.before_s * NS) as u64,
        after_ns: (settings.after_s * NS) as u64,
        miss_pause_ns: (settings.miss_pause_s * NS) as u64,
        miss_ns: None,
        material: Arc::clone(&material),
        ring,
        recording: None,
    };
    let pause = pause(&material.running.setup);
    let mut news = Vec::new();
    while !signal::stop_requested() {
        thread::sleep(pause);
        news.clear();
        feeds.drain(&mut blackbox.ring, &mut news)?;
        material.lost.store(feeds.lost(), Ordering::Relaxed);
        blackbox.look(&news);
        if let Some(recording) = rescue.take_if(|recording| recording.is_over()) {
            tell(recording);
        }
    }
    feeds.drain(&mut blackbox.ring, &mut news)?;
    [rescue, blackbox.recording]
        .into_iter()
        .flatten()
        .for_each(tell);
    // An orderly end: nothing is left to be rescued.
    let _ = fs::remove_file(domain.ring_file());
    Ok(())
}

/// Writes what a process before this one has kept, if it was killed.
fn rescue(material: &Arc<Material>, path: &Path) -> Option<Recording> {
    let ring = RingReader::open(path).ok()?;
    let now_ns = Monotonic.now_ns();
    let cause = Cause {
        reason: Reason::Crash,
        t_ns: now_ns,
        text: "the black box was replaced by a new process".to_owned(),
    };
    let order = Order {
        cause,
        from_ns: 0,
        until_ns: now_ns,
    };
    Some(Recording::start(material, ring, order))
}

/// Between two looks: half the time in which the shortest queue fills.
fn pause(setup: &Setup) -> Duration {
    let period = Duration::from_secs_f64(1.0 / setup.file.graph.rate_hz);
    let buffer = u32::try_from(setup.file.transport.buffer).unwrap_or(2);
    (period * buffer / 2).min(POLL_MAX)
}

/// Decides what is written when.
struct Blackbox {
    before_ns: u64,
    after_ns: u64,
    miss_pause_ns: u64,
    /// When misses were last a reason.
    miss_ns: Option<u64>,
    material: Arc<Material>,
    ring: RingWriter,
    recording: Option<Recording>,
}

impl Blackbox {
    /// Begins a recording, or puts off the end of the present one, if there is a reason.
    fn look(&mut self, news: &[News]) {
        if let Some(recording) = self.recording.take_if(|recording| recording.is_over()) {
            tell(recording);
        }
        for item in news {
            if let Some((reason, service)) = Reason::find(item) {
                let text = format!("{reason}, says {}", service.as_str());
                self.note(reason, text);
            }
        }
        let request = self.material.running.domain.request_file();
        if let Ok(text) = fs::read_to_string(&request) {
            let _ = fs::remove_file(&request);
            self.note(Reason::Request, text);
        }
    }

    fn note(&mut self, reason: Reason, text: String) {
        let now_ns = Monotonic.now_ns();
        let cause = Cause {
            reason,
            t_ns: now_ns,
            text,
        };
        if let Some(recording) = &self.recording {
            // Misses alone do not make a recording longer.
            if reason != Reason::Miss {
                recording.put_off(cause, now_ns + self.after_ns);
            }
            return;
        }
        if reason == Reason::Miss {
            let is_early = |last_ns: u64| now_ns < last_ns + self.miss_pause_ns;
            if self.miss_ns.is_some_and(is_early) {
                return;
            }
            self.miss_ns = Some(now_ns);
        }
        let order = Order {
            cause,
            from_ns: now_ns.saturating_sub(self.before_ns),
            until_ns: now_ns + self.after_ns,
        };
        let ring = self.ring.reader();
        self.recording = Some(Recording::start(&self.material, ring, order));
    }
}

/// Waits until a recording is finished, and says where it lies.
fn tell(recording: Recording) {
    match recording.finish() {
        Ok(path) => eprintln!("vigil: recorded {}", path.display()),
        Err(error) => eprintln!("vigil: no recording: {error}"),
    }
}
