//! Tells what happens: to people on standard error, and in the graph's file of events.

use std::path::Path;

use vigil_timeline::{EventWriter, MISSES_APART_NS, TimelineEntry};

/// Tells events as they come. Misses that follow each other within a second are told together.
pub struct Teller {
    /// False if standard error is for problems alone.
    shows: bool,
    file: Option<EventWriter>,
    /// Of each service that has missed cycles within the last second: what is still to be told,
    /// if anything, and when the second ends, ns.
    misses: Vec<PendingMisses>,
}

struct PendingMisses {
    service: String,
    untold: Option<TimelineEntry>,
    until_ns: u64,
}

impl Teller {
    /// Goes on with the events at `path`. Without a file events are told all the same.
    pub fn new(path: &Path, shows: bool) -> Self {
        let file = EventWriter::append(path);
        let file = file.inspect_err(|error| tell!("vigil: {}: {error}", path.display()));
        Self {
            shows,
            file: file.ok(),
            misses: Vec::new(),
        }
    }

    /// Tells an event.
    pub fn tell(&mut self, entry: &TimelineEntry) {
        if let Some(Err(error)) = self.file.as_mut().map(|file| file.write(entry)) {
            tell!("vigil: the file of events: {error}; nothing more is written there");
            self.file = None;
        }
        if !self.shows || !entry.is_told() {
            return;
        }
        if !entry.is_miss() {
            // In their order.
            self.tell_misses(u64::MAX);
            tell!("{}", entry.line());
            return;
        }
        let mut pending = self.misses.iter_mut();
        match pending.find(|misses| misses.service == entry.service) {
            Some(misses) => match &mut misses.untold {
                Some(untold) => untold.add_miss(entry),
                untold => *untold = Some(entry.clone()),
            },
            None => {
                tell!("{}", entry.line());
                self.misses.push(PendingMisses {
                    service: entry.service.clone(),
                    untold: None,
                    until_ns: entry.t_ns + MISSES_APART_NS,
                });
            }
        }
    }

    /// Tells the misses whose second is over.
    pub fn tell_misses(&mut self, now_ns: u64) {
        self.misses.retain_mut(|misses| {
            if now_ns < misses.until_ns {
                return true;
            }
            misses.until_ns = now_ns.saturating_add(MISSES_APART_NS);
            let untold = misses.untold.take();
            if let Some(untold) = &untold {
                tell!("{}", untold.line());
            }
            // Who misses on is not told at once again.
            untold.is_some() && now_ns < u64::MAX
        });
    }
}
