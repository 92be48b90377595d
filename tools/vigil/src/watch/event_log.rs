//! The newest events of a graph.

use std::collections::VecDeque;
use std::path::Path;

use vigil_timeline::{EventReader, TimelineEntry, told};

/// Events that are kept.
const EVENTS: usize = 200;

/// Reads the events as they are written, and keeps the newest.
pub struct EventLog {
    reader: EventReader,
    newest: VecDeque<TimelineEntry>,
}

impl EventLog {
    /// Begins with the oldest event of a graph's file.
    pub fn open(path: &Path) -> Self {
        Self {
            reader: EventReader::open(path),
            newest: VecDeque::new(),
        }
    }

    /// Reads on; true if something has happened. A file that cannot be read says nothing.
    pub fn read(&mut self) -> bool {
        let mut has_new = false;
        while let Ok(Some(entry)) = self.reader.next_entry() {
            if !entry.is_told() {
                continue;
            }
            has_new = true;
            self.newest.push_back(entry);
            if self.newest.len() > EVENTS {
                self.newest.pop_front();
            }
        }
        has_new
    }

    /// The newest events as people are told them.
    pub fn told(&mut self) -> Vec<TimelineEntry> {
        told(self.newest.make_contiguous())
    }
}
