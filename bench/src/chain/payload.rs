//! The chain over Vigil's own ports, with blocks of four sizes.

use std::error::Error;
use std::path::Path;
use std::time::Duration;

use vigil_blocks::Header;
use vigil_cycle::domain::Queues;
use vigil_cycle::port::TopicBlock;
use vigil_cycle::port::{EventListener, Link};
use vigil_cycle::wake::{self, Inputs, Timer, Wake};
use vigil_cycle::{Clock, Domain, Graph, Monotonic, Receiver, Sender, Stamp, Topic};

use super::{Incoming, Outgoing, sum_lines};

/// Queues as in the default graph, but for the readers: a block of 1 MiB takes its size for each
/// place in them.
const QUEUES: Queues = Queues {
    buffer: 4,
    history: 1,
    max_subscribers: 4,
};

vigil_blocks::block! {
    /// 64 bytes.
    pub struct Payload64, size 64 {
        /// Common header.
        pub header: Header,
        /// The rest.
        pub bytes: [u8; 16],
    }
}
vigil_blocks::block! {
    /// 4 KiB.
    pub struct Payload4k, size 4096 {
        /// Common header.
        pub header: Header,
        /// The rest.
        pub bytes: [u8; 4048],
    }
}
vigil_blocks::block! {
    /// 64 KiB.
    pub struct Payload64k, size 65536 {
        /// Common header.
        pub header: Header,
        /// The rest.
        pub bytes: [u8; 65488],
    }
}
vigil_blocks::block! {
    /// 1 MiB.
    pub struct Payload1m, size 1048576 {
        /// Common header.
        pub header: Header,
        /// The rest.
        pub bytes: [u8; 1_048_528],
    }
}

/// A block with bytes to fill and to look at.
trait Payload: TopicBlock {
    fn bytes(&self) -> &[u8];
    fn bytes_mut(&mut self) -> &mut [u8];
}

macro_rules! payload {
    ($($block:ty),*) => { $(impl Payload for $block {
        fn bytes(&self) -> &[u8] { &self.bytes }
        fn bytes_mut(&mut self) -> &mut [u8] { &mut self.bytes }
    })* };
}
payload!(Payload64, Payload4k, Payload64k, Payload1m);
vigil_cycle::carried!(Payload64, Payload4k, Payload64k, Payload1m);

const TOPICS: [Topic; 4] = [
    Topic::Sensor,
    Topic::Detection,
    Topic::Diagnosis,
    Topic::Action,
];

/// Opens the reading side behind stage `before`.
pub fn incoming(
    shared: &Path,
    before: usize,
    size: usize,
) -> Result<Box<dyn Incoming>, Box<dyn Error>> {
    Ok(match size {
        64 => Box::new(Reader::<Payload64>::open(shared, before)?),
        4096 => Box::new(Reader::<Payload4k>::open(shared, before)?),
        65_536 => Box::new(Reader::<Payload64k>::open(shared, before)?),
        1_048_576 => Box::new(Reader::<Payload1m>::open(shared, before)?),
        _ => return Err(format!("there is no block of {size} bytes").into()),
    })
}

/// Opens the writing side of `stage`.
pub fn outgoing(
    shared: &Path,
    stage: usize,
    size: usize,
) -> Result<Box<dyn Outgoing>, Box<dyn Error>> {
    Ok(match size {
        64 => Box::new(Writer::<Payload64>::open(shared, stage)?),
        4096 => Box::new(Writer::<Payload4k>::open(shared, stage)?),
        65_536 => Box::new(Writer::<Payload64k>::open(shared, stage)?),
        1_048_576 => Box::new(Writer::<Payload1m>::open(shared, stage)?),
        _ => return Err(format!("there is no block of {size} bytes").into()),
    })
}

/// The chain's own graph.
fn domain(shared: &Path) -> Result<Domain, Box<dyn Error>> {
    let name = shared.file_name().unwrap_or_default().to_string_lossy();
    // Names of graphs are short.
    let name = name.replace("vigil-chain-", "chain-");
    Ok(Domain::new(&name, QUEUES)?)
}

fn join(shared: &Path, side: &str) -> Result<Graph, Box<dyn Error>> {
    Ok(Graph::SharedMemory(Link::join(&domain(shared)?, side)?))
}

/// Removes what the chain's graph has left, once nobody is on it.
pub fn clean(shared: &Path) {
    if let Ok(domain) = domain(shared) {
        domain.remove_residue();
        let _ = std::fs::remove_dir_all(domain.folder());
    }
}

struct Reader<T: Payload> {
    // Dropped before the graph that they belong to.
    receiver: Box<dyn Receiver<T>>,
    listener: EventListener,
    timer: Timer,
    _graph: Graph,
}

impl<T: Payload> Reader<T> {
    fn open(shared: &Path, before: usize) -> Result<Self, Box<dyn Error>> {
        let graph = join(shared, &format!("reader-{before}"))?;
        let Graph::SharedMemory(link) = &graph else {
            return Err("not shared memory".into());
        };
        Ok(Self {
            receiver: graph.receiver(TOPICS[before])?,
            listener: link.listener::<T>(TOPICS[before])?,
            timer: Timer::new()?,
            _graph: graph,
        })
    }
}

impl<T: Payload> Incoming for Reader<T> {
    fn receive(&mut self, limit: Duration) -> Result<Option<(u64, u64)>, Box<dyn Error>> {
        let until_ns = Monotonic.now_ns() + limit.as_nanos() as u64;
        if wake::wait(&self.timer, self.listener.descriptors(), until_ns) == Wake::Input {
            self.listener.drain();
        }
        // The newest, as a stage does.
        let mut newest = None;
        while let Some(block) = self.receiver.take_next() {
            newest = Some((block.header().t_schedule_ns, block.header().t_publish_ns));
            if !self.receiver.is_waiting() {
                break; // Keep holding it: it is looked at in place.
            }
        }
        Ok(newest)
    }

    fn checksum(&self) -> u64 {
        self.receiver
            .held()
            .map_or(0, |block| sum_lines(block.bytes()))
    }
}

struct Writer<T: Payload> {
    sender: Box<dyn Sender<T>>,
    _graph: Graph,
}

impl<T: Payload> Writer<T> {
    fn open(shared: &Path, stage: usize) -> Result<Self, Box<dyn Error>> {
        let graph = join(shared, &format!("writer-{stage}"))?;
        Ok(Self {
            sender: graph.sender(TOPICS[stage])?,
            _graph: graph,
        })
    }
}

impl<T: Payload> Outgoing for Writer<T> {
    fn fill(&mut self, byte: u8) {
        self.sender.block().bytes_mut().fill(byte);
    }

    fn publish(&mut self, t_schedule_ns: u64) -> Result<u64, Box<dyn Error>> {
        let stamp = Stamp {
            t_schedule_ns,
            t_capture_ns: t_schedule_ns,
        };
        let t_publish_ns = self.sender.send(stamp, &Monotonic)?;
        // The next block is loaned and cleared now, as by a stage: not when it is to be filled.
        self.sender.prepare()?;
        Ok(t_publish_ns)
    }
}
