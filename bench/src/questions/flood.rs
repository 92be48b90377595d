//! What does a flood of frames cost? That of a stranger should cost nothing.
//!
//! A publisher sends frames to the graph's UDP socket on its schedule; in one half of each pair
//! another process sends good frames as fast as it can: to the graph's Unix socket, or to the same
//! socket from another port. Or the publisher itself sends old frames besides, through the socket
//! that the graph listens to: each of those has to be read and refused.

use std::error::Error;
use std::net::UdpSocket;
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use clap::ValueEnum;
use vigil_bench::latency::graph::{Change, Prepared, root};
use vigil_bench::latency::halves::{self, Half};
use vigil_bench::latency::load::{Load, Running};
use vigil_blocks::{Block, SensorFrame, datagram};
use vigil_cycle::placement::{self, Wanted};
use vigil_cycle::{Clock, Monotonic, clock, signal};
use vigil_recording::frames;
use vigil_setup::schema::Source;

/// The word with which the program is the flood.
pub const FLOOD_WORD: &str = "frame-flood";
/// Where the publisher runs: below the graph, above ordinary processes.
const PUBLISHER: Wanted = Wanted {
    core: 0,
    priority: 50,
};
/// Datagrams between two looks at whether to stop.
const BATCH: usize = 100;

/// Where the flood arrives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Through {
    /// At the Unix socket.
    Unix,
    /// At the publisher's UDP socket.
    Udp,
    /// There too, from the publisher itself.
    Source,
}

/// Measures in interleaved pairs.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Pairs.
    #[arg(long, value_name = "N", default_value_t = 10)]
    pairs: usize,
    /// Time of each half, s.
    #[arg(long, value_name = "S", default_value_t = 30.0)]
    seconds: f64,
    /// Rate of the publisher, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 100.0)]
    rate: f64,
    /// Load beside the graph.
    #[arg(long, default_value = "keep-awake")]
    load: Load,
    /// Where the flood arrives.
    #[arg(long, default_value = "unix")]
    through: Through,
}

/// Sends good frames to `address` as fast as it can.
pub fn be_flood(address: &str) -> Result<(), Box<dyn Error>> {
    let udp = UdpSocket::bind("127.0.0.1:0")?;
    let unix = UnixDatagram::unbound()?;
    // One that waits for room is no flood.
    unix.set_nonblocking(true)?;
    let mut frame = SensorFrame::default();
    frame.header.schema = SensorFrame::SCHEMA;
    frame.header.epoch = Monotonic.now_ns();
    signal::install();
    while !signal::stop_requested() {
        for _ in 0..BATCH {
            frame.header.seq += 1;
            frame.header.t_capture_ns = Monotonic.now_ns();
            // Refused by the kernel, or not: all the same to a flood.
            let bytes = datagram::encode(&frame);
            let _ = if address.contains('/') {
                unix.send_to(&bytes, address)
            } else {
                udp.send_to(&bytes, address)
            };
        }
    }
    Ok(())
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let pairs = vigil_bench::in_folder("flood", |folder| measure(args, folder))?;
    let (n, seconds, rate, load) = (args.pairs, args.seconds, args.rate, args.load.name());
    let (through, flood) = match args.through {
        Through::Unix => ("unix", "a second sender floods the graph's Unix socket"),
        Through::Udp => (
            "udp",
            "a second sender floods the same socket from another port",
        ),
        Through::Source => (
            "source",
            "the sender floods its socket with old frames besides",
        ),
    };
    let about = format!(
        "`scripts/bench flood --pairs {n} --seconds {seconds} --rate {rate} --load {load} \
         --through {through}`\n\nFrames by UDP; in the halves of one run that are `with`, {flood}."
    );
    halves::archive(&format!("flood-{through}"), &about, &pairs)
}

fn measure(args: &Args, folder: &Path) -> Result<Vec<[Half; 2]>, Box<dyn Error>> {
    let change = Change {
        rate_hz: args.rate,
        particles: 1000,
        is_fifo: true,
        source: Source::Socket,
        is_faulty: false,
    };
    let prepared = Prepared::new(change, folder)?;
    let load = Running::start(args.load, &prepared.cores(), folder, None)?;
    let pairs = pairs(args, &prepared);
    load.finish()?;
    pairs
}

fn pairs(args: &Args, prepared: &Prepared) -> Result<Vec<[Half; 2]>, Box<dyn Error>> {
    let setup = prepared.setup();
    let socket = &setup.file.sensor.socket;
    let address = socket.udp.clone();
    let flooded = match args.through {
        Through::Udp | Through::Source => address.clone(),
        Through::Unix => {
            let path = setup.domain()?.folder().join(&socket.unix);
            path.display().to_string()
        }
    };
    let robot = &setup.robot;
    let runs = frames::read(&root().join("tests/data/rover/learn_frames.csv.gz"), robot)?;
    let first = runs.into_iter().next();
    let recorded = first.ok_or("the recording is empty")?.frames;
    let (mut publisher, mut flooding): (Option<Publisher>, Option<Flooding>) = (None, None);
    halves::alternating(prepared, (args.pairs, args.seconds), |with| {
        let publisher = match &mut publisher {
            Some(publisher) => publisher,
            none => {
                let (recorded, address) = (recorded.clone(), address.clone());
                none.insert(Publisher::start(recorded, address, setup.period_ns())?)
            }
        };
        let is_wanted = with == Some(true);
        if args.through == Through::Source {
            publisher.floods.store(is_wanted, Ordering::Relaxed);
        } else if !is_wanted {
            flooding = None;
        } else if flooding.is_none() {
            flooding = Some(Flooding::start(&flooded)?);
        } else if flooding.as_mut().is_some_and(Flooding::has_ended) {
            return Err("the flood ended before its time".into());
        }
        Ok(())
    })
}

/// Sends frames on an absolute schedule until dropped.
struct Publisher {
    stop: Arc<AtomicBool>,
    /// Sends old frames besides while this is set.
    floods: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Publisher {
    fn start(recorded: Vec<SensorFrame>, address: String, period_ns: u64) -> std::io::Result<Self> {
        let socket = UdpSocket::bind("127.0.0.1:0")?;
        let [stop, floods] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
        let epoch = Monotonic.now_ns();
        let old = (socket.try_clone()?, address.clone(), epoch);
        let asked = (Arc::clone(&stop), Arc::clone(&floods));
        let flood = std::thread::Builder::new().name("flood".into());
        let flood = flood.spawn(move || send_old(&old, &asked))?;
        let asked = Arc::clone(&stop);
        let thread = std::thread::Builder::new().name("publisher".into());
        let thread = thread.spawn(move || {
            let _ = placement::apply(PUBLISHER);
            let mut due_ns = epoch;
            let rounds = (1_u64..).zip(recorded.iter().cycle());
            for (seq, frame) in rounds.take_while(|_| !asked.load(Ordering::Relaxed)) {
                due_ns += period_ns;
                clock::sleep_until(due_ns);
                let mut frame = *frame;
                // Each round of the recording is a run of its own.
                frame.run_id = 1 + seq / recorded.len() as u64;
                let header = &mut frame.header;
                header.schema = SensorFrame::SCHEMA;
                (header.epoch, header.seq) = (epoch, seq);
                (header.t_schedule_ns, header.t_capture_ns) = (due_ns, due_ns);
                // Nobody may listen any more.
                let _ = socket.send_to(&datagram::encode(&frame), &address);
            }
        })?;
        Ok(Self {
            stop,
            floods,
            threads: vec![thread, flood],
        })
    }
}

/// Sends the frame before the first again and again while that is wanted.
fn send_old(
    (socket, address, epoch): &(UdpSocket, String, u64),
    (stop, floods): &(Arc<AtomicBool>, Arc<AtomicBool>),
) {
    let mut frame = SensorFrame::default();
    (frame.header.schema, frame.header.epoch) = (SensorFrame::SCHEMA, *epoch);
    while !stop.load(Ordering::Relaxed) {
        if !floods.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(5));
            continue;
        }
        for _ in 0..BATCH {
            frame.header.t_schedule_ns = Monotonic.now_ns();
            frame.header.t_capture_ns = frame.header.t_schedule_ns;
            let _ = socket.send_to(&datagram::encode(&frame), address);
        }
    }
}

impl Drop for Publisher {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// The flood: ended when dropped.
struct Flooding(Child);

impl Flooding {
    fn start(address: &str) -> std::io::Result<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args([FLOOD_WORD, address]).stdin(Stdio::null());
        Ok(Self(command.spawn()?))
    }

    fn has_ended(&mut self) -> bool {
        !matches!(self.0.try_wait(), Ok(None))
    }
}

impl Drop for Flooding {
    fn drop(&mut self) {
        if !self.has_ended() {
            signal::terminate(self.0.id());
        }
        let _ = self.0.wait();
    }
}
