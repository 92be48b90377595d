//! Tells what happens: to people on standard error, and in the graph's file of events.

use std::path::Path;

use vigil_timeline::{EventWriter, PendingMisses, TimelineEntry};

/// Tells events as they come.
pub struct Teller {
    /// False if standard error is for problems alone.
    shows: bool,
    file: Option<EventWriter>,
    misses: PendingMisses,
}

impl Teller {
    /// Goes on with the events at `path`. Without a file events are told all the same.
    pub fn new(path: &Path, shows: bool) -> Self {
        let file = EventWriter::append(path);
        let file = file.inspect_err(|error| tell!("vigil: {}: {error}", path.display()));
        Self {
            shows,
            file: file.ok(),
            misses: PendingMisses::default(),
        }
    }

    /// Tells an event.
    pub fn tell(&mut self, entry: &TimelineEntry) {
        if let Some(Err(error)) = self.file.as_mut().map(|file| file.write(entry)) {
            tell!("vigil: the file of events: {error}; nothing more is written there");
            self.file = None;
        }
        let told = self.misses.add(entry);
        self.show(&told);
    }

    /// Tells the misses whose time is over.
    pub fn tell_misses(&mut self, now_ns: u64) {
        let told = self.misses.due(now_ns);
        self.show(&told);
    }

    fn show(&self, told: &[TimelineEntry]) {
        for entry in told.iter().filter(|_| self.shows) {
            tell!("{}", entry.line());
        }
    }
}
