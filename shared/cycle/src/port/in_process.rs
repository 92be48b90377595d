//! Queues inside one thread: the ports of tests under the virtual clock.

use std::any::Any;
use std::cell::RefCell;
use std::collections::{HashMap, VecDeque};
use std::rc::Rc;

use vigil_blocks::Block;

use super::{PortError, Receiver, Sender, Stamp, Stamper};
use crate::clock::{Clock, VirtualClock};
use crate::topic::Topic;

/// Blocks that a queue holds before the oldest is overwritten: the virtual clock runs every stage
/// before the next frame, so that one is the rule.
const BUFFER: usize = 16;

/// What waits for one reader. Blocks that were read go round, so that a steady cycle in process
/// allocates as little as one over shared memory.
struct ReaderQueue<T> {
    blocks: VecDeque<Box<T>>,
    spare: Vec<Box<T>>,
}

impl<T: Block> ReaderQueue<T> {
    fn new() -> Self {
        Self {
            blocks: VecDeque::with_capacity(BUFFER),
            // One more than can wait: the held one.
            spare: (0..=BUFFER)
                .map(|_| bytemuck::allocation::zeroed_box())
                .collect(),
        }
    }

    fn push(&mut self, block: &T) {
        let overwritten = if self.blocks.len() == BUFFER {
            self.blocks.pop_front()
        } else {
            None
        };
        let slot = overwritten.or_else(|| self.spare.pop());
        let mut slot = slot.unwrap_or_else(bytemuck::allocation::zeroed_box);
        *slot = *block;
        self.blocks.push_back(slot);
    }
}

type Queue<T> = Rc<RefCell<ReaderQueue<T>>>;
type Readers<T> = Rc<RefCell<Vec<Queue<T>>>>;

/// All topics of one in-process graph. Clones share them. A block is visible from the instant of
/// its publication on, by the virtual clock.
#[derive(Clone)]
pub struct Bus {
    clock: VirtualClock,
    topics: Rc<RefCell<HashMap<Topic, Box<dyn Any>>>>,
    epochs: Rc<RefCell<u64>>,
}

impl Bus {
    /// An empty bus under `clock`.
    #[must_use]
    pub fn new(clock: VirtualClock) -> Self {
        Self {
            clock,
            topics: Rc::default(),
            epochs: Rc::default(),
        }
    }

    fn readers<T: Block>(&self, topic: Topic) -> Readers<T> {
        let mut topics = self.topics.borrow_mut();
        let entry = topics
            .entry(topic)
            .or_insert_with(|| Box::new(Readers::<T>::default()));
        // A topic has one type by construction of `Topic`; another type gets a topic of its own
        // that nobody reads.
        entry
            .downcast_ref::<Readers<T>>()
            .cloned()
            .unwrap_or_default()
    }

    pub(super) fn sender<T: Block>(&self, topic: Topic) -> LocalSender<T> {
        *self.epochs.borrow_mut() += 1;
        LocalSender {
            readers: self.readers(topic),
            loaned: bytemuck::allocation::zeroed_box(),
            stamper: Stamper::new(*self.epochs.borrow()),
        }
    }

    pub(super) fn receiver<T: Block>(&self, topic: Topic) -> LocalReceiver<T> {
        let queue = Rc::new(RefCell::new(ReaderQueue::new()));
        self.readers::<T>(topic)
            .borrow_mut()
            .push(Rc::clone(&queue));
        LocalReceiver {
            clock: self.clock.clone(),
            queue,
            held: None,
        }
    }
}

pub(super) struct LocalSender<T> {
    readers: Readers<T>,
    loaned: Box<T>,
    stamper: Stamper,
}

impl<T: Block> Sender<T> for LocalSender<T> {
    fn block(&mut self) -> &mut T {
        &mut self.loaned
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        Ok(())
    }

    fn send(&mut self, stamp: Stamp, clock: &dyn Clock) -> Result<u64, PortError> {
        let published_ns = self.stamper.stamp(&mut *self.loaned, stamp, clock);
        for queue in self.readers.borrow().iter() {
            queue.borrow_mut().push(&self.loaned);
        }
        *self.loaned = T::zeroed();
        Ok(published_ns)
    }

    fn epoch(&self) -> u64 {
        self.stamper.epoch
    }

    fn next_seq(&self) -> u64 {
        self.stamper.seq
    }
}

pub(super) struct LocalReceiver<T> {
    clock: VirtualClock,
    queue: Queue<T>,
    held: Option<Box<T>>,
}

impl<T: Block> Receiver<T> for LocalReceiver<T> {
    fn take_next(&mut self) -> Option<&T> {
        let mut queue = self.queue.borrow_mut();
        let now_ns = self.clock.now_ns();
        let is_out = |block: &T| block.header().t_publish_ns <= now_ns;
        queue.spare.extend(self.held.take());
        let visible = queue.blocks.front().is_some_and(|block| is_out(block));
        self.held = if visible {
            queue.blocks.pop_front()
        } else {
            None
        };
        let schema = self.held.as_ref().map(|block| block.header().schema);
        assert!(
            schema.is_none_or(|schema| schema == T::SCHEMA),
            "a queue holds the blocks of its topic, stamped"
        );
        self.held()
    }

    fn held(&self) -> Option<&T> {
        self.held.as_deref()
    }

    fn buffer(&self) -> usize {
        BUFFER
    }

    fn is_waiting(&self) -> bool {
        let queue = self.queue.borrow();
        let next = queue.blocks.front();
        next.is_some_and(|block| block.header().t_publish_ns <= self.clock.now_ns())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::SensorFrame;

    #[test]
    #[should_panic(expected = "a queue holds the blocks of its topic, stamped")]
    fn a_block_without_a_stamp_is_found() {
        let bus = Bus::new(VirtualClock::default());
        let mut receiver = bus.receiver::<SensorFrame>(Topic::Sensor);
        receiver.queue.borrow_mut().push(&SensorFrame::default());
        receiver.take_next();
    }
}
