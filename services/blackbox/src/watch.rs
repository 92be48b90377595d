//! The black box from its start to its end.

use std::error::Error;
use std::fs;
use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use vigil_cycle::port::Link;
use vigil_cycle::{Clock, Domain, Graph, Monotonic, signal};
use vigil_setup::RunningGraph;

use crate::feeds::{Feeds, News};
use crate::folder::RecordingsFolder;
use crate::memory;
use crate::reason::Reason;
use crate::recorder::{Cause, Destination, Material, Order, Recording};
use crate::rescue::{self, Rescue};
use crate::ring::RingWriter;
use crate::say::{say, tell};

/// What was cut short is mended so long after the start, which has enough to do.
const MEND_AFTER: Duration = Duration::from_secs(10);
/// Nanoseconds of a second.
const NS: f64 = 1e9;
/// A recording is at most so many times as long after its first cause as after its last.
const AFTER_MAX: u64 = 6;

/// Keeps and writes until it is asked to stop, or no service is left.
pub fn run(running: RunningGraph) -> Result<(), Box<dyn Error>> {
    signal::install();
    let _lock = memory::lock(&running.domain)?;
    let folder = RecordingsFolder::find(&running)?;
    for cut in folder.adopt_parts() {
        say(&format!("{} was cut short", cut.display()));
    }
    let path = folder.path().as_os_str().as_encoded_bytes();
    fs::write(running.domain.recordings_file(), path)?;
    // Also of a process before this one: each start would write a recording otherwise.
    let since_misses_ns = folder.since_misses().map(|time| time.as_nanos() as u64);
    let miss_ns = since_misses_ns.and_then(|since_ns| Monotonic.now_ns().checked_sub(since_ns));
    let cut_before = folder.clone();
    let material = Arc::new(Material::new(running, Destination::Folder(folder))?);
    material.destination.prune(0);
    let domain = &material.running.domain;
    if let Err(error) = memory::set_aside(domain) {
        say(&format!("what a black box kept is lost: {error}"));
    }
    let ring = begin(&material.running);
    let mut rescues = Rescue::start_all(domain);
    // Beside the rest: it may take long, and ends with this process.
    thread::spawn(move || {
        thread::sleep(MEND_AFTER);
        cut_before.mend_cut(|path| {
            say(&format!(
                "{} has an end, or a name that says why not",
                path.display()
            ));
        });
    });
    let kept = ring.map_err(Into::into);
    let kept = kept.and_then(|ring| keep(&material, ring, miss_ns, &mut rescues));
    if kept.is_ok() {
        // An orderly end: nothing of this drive is left to be rescued.
        memory::remove(&domain.memory_folder());
    }
    // Whatever happened: what was left is written before this process ends.
    rescues.into_iter().for_each(Rescue::finish);
    kept
}

/// Begins to keep. If there is no room, what is not yet written is written first; what cannot be
/// makes room, the oldest first.
fn begin(running: &RunningGraph) -> io::Result<RingWriter> {
    let domain = &running.domain;
    let mut made = memory::create(running);
    if is_full(&made) {
        rescue::write(domain);
        made = memory::create(running);
    }
    for oldest in memory::unwritten(domain) {
        if !is_full(&made) {
            break;
        }
        say("there is no room for the last seconds: what a killed black box kept is dropped");
        memory::remove(&oldest);
        made = memory::create(running);
    }
    made
}

fn is_full(made: &io::Result<RingWriter>) -> bool {
    let error = made.as_ref().err();
    error.is_some_and(|error| error.kind() == io::ErrorKind::StorageFull)
}

/// Keeps the last seconds, and writes them when there is a reason. Missed cycles were last one at
/// `miss_ns`.
fn keep(
    material: &Arc<Material>,
    ring: RingWriter,
    miss_ns: Option<u64>,
    rescues: &mut Vec<Rescue>,
) -> Result<(), Box<dyn Error>> {
    let (domain, setup) = (&material.running.domain, &material.running.setup);
    let settings = &setup.file.blackbox;
    let mut feeds = Feeds::open(&Graph::SharedMemory(Link::join(domain, "blackbox")?))?;
    let mut blackbox = Blackbox {
        before_ns: (settings.before_s * NS) as u64,
        after_ns: (settings.after_s * NS) as u64,
        miss_pause_ns: (settings.miss_pause_s * NS) as u64,
        miss_ns,
        material: Arc::clone(material),
        ring,
        recordings: Vec::new(),
    };
    let pause = setup.observer_pause();
    let mut ends = false;
    while !ends {
        // The last look comes after the order to stop.
        ends = signal::stop_requested() || feeds.is_deserted();
        if !ends {
            thread::sleep(pause);
        }
        blackbox.look(&mut feeds)?;
        let over = rescues.extract_if(.., |rescue| rescue.is_over());
        over.for_each(|rescue| {
            rescue.finish();
            material.destination.prune(0);
        });
    }
    let last = blackbox.recordings.into_iter();
    last.map(Recording::finish).for_each(tell);
    Ok(())
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
    /// Those that are being written; the last may still be put off.
    recordings: Vec<Recording>,
}

impl Blackbox {
    /// Takes what has come. Begins a recording, or puts off the end of the present one, if there is
    /// a reason.
    fn look(&mut self, feeds: &mut Feeds) -> Result<(), Box<dyn Error>> {
        let mut news = Vec::new();
        feeds.drain(&mut self.ring, &mut news)?;
        self.material.lost.store(feeds.lost(), Ordering::Relaxed);
        let over = self.recordings.extract_if(.., |of| of.is_over());
        over.map(Recording::finish).for_each(tell);
        for (reason, text) in news.iter().filter_map(reason) {
            if reason != Reason::Miss || feeds.has_frames() {
                self.note(reason, text);
            }
        }
        let request = self.material.running.domain.request_file();
        let taken = request.with_extension("taken");
        if fs::rename(&request, &taken).is_ok() {
            let text = fs::read_to_string(&taken).unwrap_or_default();
            let _ = fs::remove_file(&taken);
            match text.strip_prefix(Domain::CRASH_REQUEST) {
                Some(crash) => self.note(Reason::Crash, crash.to_owned()),
                None => self.note(Reason::Request, text),
            }
        }
        Ok(())
    }

    fn note(&mut self, reason: Reason, text: String) {
        let now_ns = Monotonic.now_ns();
        let cause = Cause {
            reason,
            t_ns: now_ns,
            text,
        };
        let until_ns = now_ns + self.after_ns;
        if let Some(recording) = self.recordings.last() {
            // Misses alone do not make a recording longer.
            if reason == Reason::Miss || recording.put_off(&cause, until_ns) {
                return;
            }
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
            until_ns,
            until_ns_max: now_ns + AFTER_MAX * self.after_ns,
        };
        let ring = self.ring.reader();
        self.recordings
            .push(Recording::start(&self.material, ring, order));
    }
}

/// The reason that news is of, in words.
fn reason(news: &News) -> Option<(Reason, String)> {
    let (reason, service) = Reason::find(news)?;
    let name = service.as_str();
    let text = match news {
        News::Replaced(_) => format!("{name} was replaced by a new process"),
        News::Silent(_) => format!("{name} no longer reports"),
        News::Event(..) => format!("{reason}, says {name}"),
    };
    Some((reason, text))
}
