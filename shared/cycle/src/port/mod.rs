//! Ports: typed senders and receivers of blocks, over shared memory or in process.

mod carried;
mod found;
mod in_process;
mod shared_memory;

use vigil_blocks::{Block, Header};

use crate::clock::Clock;
use crate::port_error::PortError;
use crate::topic::Topic;

pub use carried::TopicBlock;
pub use found::FoundTopic;
pub use in_process::Bus;
pub use shared_memory::{EventListener, EventNotifier, Link, Wire};

/// Sends blocks on one topic; the only writer of that topic.
pub trait Sender<T: Block> {
    /// The next block, all zero when it was loaned, written in place. Loaned now unless it was
    /// before, by [`Self::prepare`].
    fn block(&mut self) -> &mut T;

    /// Loans and clears the next block: work for the time after a cycle, since a large block takes
    /// long to clear.
    ///
    /// # Errors
    /// [`PortError`] when the transport refuses.
    fn prepare(&mut self) -> Result<(), PortError>;

    /// Stamps the header (schema, epoch, next sequence number, times), sends the block, wakes the
    /// listeners. Returns the publication instant that it wrote, ns.
    ///
    /// # Errors
    /// [`PortError`] when the transport refuses.
    fn send(&mut self, stamp: Stamp, clock: &dyn Clock) -> Result<u64, PortError>;

    /// Epoch under which this sender writes.
    fn epoch(&self) -> u64;

    /// Sequence number of the next block.
    fn next_seq(&self) -> u64;
}

/// Receives the blocks of one topic.
pub trait Receiver<T: Block> {
    /// Drops the held block, and takes and holds the next waiting one; `None` if none waits.
    /// Call it at most [`Self::buffer`] times a turn, so that a flood cannot hold the cycle.
    fn take_next(&mut self) -> Option<&T>;

    /// The held block, read in place.
    fn held(&self) -> Option<&T>;

    /// Blocks that can wait at once.
    fn buffer(&self) -> usize;

    /// True if a block waits; takes nothing and costs no system call.
    fn is_waiting(&self) -> bool;
}

/// The times that a block carries on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Stamp {
    /// See [`Header::t_schedule_ns`].
    pub t_schedule_ns: u64,
    /// See [`Header::t_capture_ns`].
    pub t_capture_ns: u64,
}

impl Stamp {
    /// The times of an input block.
    #[must_use]
    pub const fn from_header(header: &Header) -> Self {
        Self {
            t_schedule_ns: header.t_schedule_ns,
            t_capture_ns: header.t_capture_ns,
        }
    }
}

/// The transport of a graph.
pub enum Graph {
    /// Shared memory between processes.
    SharedMemory(Link),
    /// Queues inside one thread, for tests under the virtual clock.
    InProcess(Bus),
}

impl Graph {
    /// Opens the writing side of a topic.
    ///
    /// # Errors
    /// [`PortError::Open`], among others when the topic already has a living writer.
    pub fn sender<T: TopicBlock>(&self, topic: Topic) -> Result<Box<dyn Sender<T>>, PortError> {
        Ok(match self {
            Self::SharedMemory(link) => T::sender(link, topic)?,
            Self::InProcess(bus) => Box::new(bus.sender::<T>(topic)),
        })
    }

    /// Opens a reading side of a topic.
    ///
    /// # Errors
    /// [`PortError::Open`].
    pub fn receiver<T: TopicBlock>(&self, topic: Topic) -> Result<Box<dyn Receiver<T>>, PortError> {
        Ok(match self {
            Self::SharedMemory(link) => T::receiver(link, topic)?,
            Self::InProcess(bus) => Box::new(bus.receiver::<T>(topic)),
        })
    }
}

/// Stamps the blocks of one writer.
#[derive(Debug)]
struct Stamper {
    epoch: u64,
    /// Number of the next block.
    seq: u64,
    published_ns: u64,
}

impl Stamper {
    /// For the writer that starts under this epoch.
    fn new(epoch: u64) -> Self {
        assert!(epoch != 0, "a writer has an epoch: 0 stands for none");
        Self {
            epoch,
            seq: 0,
            published_ns: 0,
        }
    }

    /// Fills the header of the next block, which is about to go out; returns the publication
    /// instant, ns.
    fn stamp<T: Block>(&mut self, block: &mut T, stamp: Stamp, clock: &dyn Clock) -> u64 {
        let t_publish_ns = clock.now_ns();
        assert!(
            t_publish_ns >= self.published_ns,
            "publications of a writer never go back: {t_publish_ns} after {} ns",
            self.published_ns
        );
        *block.header_mut() = Header {
            schema: T::SCHEMA,
            epoch: self.epoch,
            seq: self.seq,
            t_schedule_ns: stamp.t_schedule_ns,
            t_capture_ns: stamp.t_capture_ns,
            t_publish_ns,
        };
        self.seq += 1;
        self.published_ns = t_publish_ns;
        t_publish_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::VirtualClock;
    use vigil_blocks::SensorFrame;

    #[test]
    fn a_writers_blocks_carry_its_schema_and_epoch_and_count_up() {
        let (mut stamper, clock) = (Stamper::new(7), VirtualClock::default());
        let mut frame = SensorFrame::default();
        for seq in 0..3 {
            clock.advance(10);
            stamper.stamp(&mut frame, Stamp::default(), &clock);
            let header = frame.header;
            assert_eq!((header.schema, header.epoch), (SensorFrame::SCHEMA, 7));
            assert_eq!((header.seq, header.t_publish_ns), (seq, 10 * (seq + 1)));
        }
    }

    #[test]
    #[should_panic(expected = "a writer has an epoch")]
    fn a_writer_without_an_epoch_is_found() {
        Stamper::new(0);
    }

    #[test]
    #[should_panic(expected = "publications of a writer never go back")]
    fn a_publication_in_the_past_is_found() {
        let (mut stamper, clock) = (Stamper::new(7), VirtualClock::default());
        stamper.published_ns = 1;
        stamper.stamp(&mut SensorFrame::default(), Stamp::default(), &clock);
    }
}
