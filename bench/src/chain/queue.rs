//! The chain over queues between threads of one process: a block changes hands, nothing is copied.

use std::error::Error;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use super::carriers::Message;
use super::{Incoming, Outgoing, Role, STAGES};

/// Blocks that may wait.
const DEPTH: usize = 8;

/// Runs all roles as threads.
pub fn run(roles: &[Role; STAGES]) -> Result<(), Box<dyn Error>> {
    let mut readers = vec![None];
    let mut writers = Vec::new();
    for role in roles {
        let size = role.chain.sizes[role.stage];
        let (full, waiting) = sync_channel(DEPTH);
        let (empty, used) = sync_channel(DEPTH + 1);
        for _ in 0..DEPTH {
            empty.send(Message::new(size))?;
        }
        let is_last = role.stage + 1 == STAGES;
        writers.push(QueueWriter {
            block: Message::new(size),
            used,
            full: (!is_last).then_some(full),
        });
        readers.push(Some(QueueReader {
            waiting,
            empty,
            block: Message::default(),
        }));
    }
    std::thread::scope(|scope| {
        let stages: Vec<_> = roles
            .iter()
            .zip(readers.into_iter().zip(writers))
            .map(|(role, (mut reader, mut writer))| {
                scope.spawn(move || {
                    role.place();
                    let input = reader.as_mut().map(|r| r as &mut dyn Incoming);
                    role.play(input, &mut writer).map_err(|e| e.to_string())
                })
            })
            .collect();
        for stage in stages {
            stage.join().map_err(|_| "a stage has died")??;
        }
        Ok(())
    })
}

struct QueueReader {
    waiting: Receiver<Message>,
    empty: SyncSender<Message>,
    block: Message,
}

impl Incoming for QueueReader {
    fn receive(&mut self, limit: Duration) -> Result<Option<(u64, u64)>, Box<dyn Error>> {
        let next = match self.waiting.recv_timeout(limit) {
            Ok(block) => block,
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return Ok(None),
        };
        let used = std::mem::replace(&mut self.block, next);
        if !used.0.is_empty() {
            let _ = self.empty.try_send(used);
        }
        Ok(Some(self.block.instants()))
    }

    fn checksum(&self) -> u64 {
        self.block.checksum()
    }
}

struct QueueWriter {
    block: Message,
    used: Receiver<Message>,
    full: Option<SyncSender<Message>>,
}

impl Outgoing for QueueWriter {
    fn fill(&mut self, byte: u8) {
        self.block.fill(byte);
    }

    fn publish(&mut self, t_schedule_ns: u64) -> Result<u64, Box<dyn Error>> {
        let t_publish_ns = self.block.stamp(t_schedule_ns);
        if let Some(full) = &self.full {
            let next = self.used.recv()?;
            full.send(std::mem::replace(&mut self.block, next))?;
        }
        Ok(t_publish_ns)
    }
}
