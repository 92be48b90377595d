//! The newest events of a graph.

use std::collections::VecDeque;
use std::path::Path;

use vigil_timeline::{EventReader, TimelineEntry};

/// Events that are kept.
const EVENTS: usize = 200;

/// Reads the events as they are written, and keeps the newest. Missed cycles would hide all others:
/// they are told with their service.
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
            if !entry.is_told() || entry.is_miss() {
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

    /// The newest events, the newest last.
    pub fn newest(&self) -> Vec<TimelineEntry> {
        self.newest.iter().cloned().collect()
    }
}
