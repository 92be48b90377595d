//! The newest block of a topic.

use vigil_blocks::Block;
use vigil_cycle::Receiver;

/// Reads a topic of which only the newest block counts.
pub(super) struct Newest<T: Block> {
    receiver: Box<dyn Receiver<T>>,
    /// Allocated once: a cycle only copies into it.
    block: Box<T>,
}

impl<T: Block + Default> Newest<T> {
    pub(super) fn new(receiver: Box<dyn Receiver<T>>) -> Self {
        Self {
            receiver,
            block: Box::default(),
        }
    }

    /// Takes the blocks that have arrived, and shows each to `each`; true if there were any.
    pub(super) fn take(&mut self, mut each: impl FnMut(&T)) -> bool {
        let mut is_new = false;
        for _ in 0..self.receiver.buffer() {
            let Some(block) = self.receiver.take_next() else {
                break;
            };
            if block.header().schema != T::SCHEMA {
                continue;
            }
            *self.block = *block;
            is_new = true;
            each(block);
        }
        is_new
    }

    /// The newest; all zero before the first.
    pub(super) fn block(&self) -> &T {
        &self.block
    }
}
