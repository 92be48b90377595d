//! What happened, in order.

use std::collections::BTreeMap;

use vigil_blocks::{Blindness, Event, EventKind};
use vigil_cycle::failure::Failure;
use vigil_cycle::topic::ServiceName;
use vigil_setup::Setup;

use crate::entry::TimelineEntry;
use crate::namer::Namer;
use crate::record::Record;

/// Events that are kept: a day of a robot that decides each second.
const RECORDS_MAX: usize = 100_000;

/// All events of a run.
pub struct Timeline {
    namer: Namer,
    records: Vec<Record>,
    /// What is not heard from the services: told by another launcher, or of the launcher itself.
    told: Vec<TimelineEntry>,
    /// Those records that [`Self::take_new`] has handed out.
    taken: usize,
    overwritten: u64,
    /// Of each service: until when another launcher has told its events, ns.
    told_ns: [u64; ServiceName::ALL.len()],
    origin_ns: Option<u64>,
    closed_ns: Option<u64>,
    recording_end_ns: Option<u64>,
}

impl Timeline {
    /// An empty timeline of a graph with these models.
    pub fn new(setup: &Setup) -> Self {
        Self {
            namer: Namer::new(setup),
            origin_ns: None,
            records: Vec::new(),
            told: Vec::new(),
            taken: 0,
            overwritten: 0,
            told_ns: [0; ServiceName::ALL.len()],
            closed_ns: None,
            recording_end_ns: None,
        }
    }

    /// Adds an event, unless it lies in the stopping of the graph.
    pub fn add(&mut self, service: ServiceName, event: &Event) {
        if self
            .closed_ns
            .is_none_or(|closed_ns| event.t_ns <= closed_ns)
        {
            if event.kind == EventKind::Ready as u32 {
                self.begin(event.t_ns);
            }
            if event.kind == EventKind::EndOfRecording as u32 {
                self.recording_end_ns.get_or_insert(event.value);
            }
            self.records.push(Record {
                service,
                event: *event,
                text: None,
            });
        }
    }

    /// Adds an assertion of a service that has failed, also while the graph is being stopped.
    pub fn add_failure(&mut self, service: ServiceName, failure: &Failure) {
        self.records.push(Record {
            service,
            event: Event {
                t_ns: failure.t_ns,
                kind: EventKind::Assertion as u32,
                ..Event::default()
            },
            text: Some(failure.to_string()),
        });
    }

    /// Adds that a service was started again.
    pub fn add_restart(&mut self, service: ServiceName, t_ns: u64) {
        let restart = Event {
            t_ns,
            kind: EventKind::Restarted as u32,
            ..Event::default()
        };
        self.add(service, &restart);
    }

    /// Events after `t_ns` are of no interest: the services are being stopped.
    pub const fn close(&mut self, t_ns: u64) {
        self.closed_ns = Some(t_ns);
    }

    /// Instant after which events are of no interest, ns, once it is known.
    pub const fn closed_ns(&self) -> Option<u64> {
        self.closed_ns
    }

    /// Counts events of a service that were overwritten before they could be read.
    pub fn add_overwritten(&mut self, service: ServiceName, count: u64) {
        let is_first = !self.records.iter().any(|record| record.service == service);
        // What lies before the first that is read was told by another launcher.
        if !is_first || self.told_ns[service.index()] == 0 {
            self.overwritten += count;
        }
    }

    /// Adds what no service says of itself; it is not handed out.
    pub fn add_own(&mut self, entry: TimelineEntry) {
        self.told.push(entry);
    }

    /// Adds an event that another launcher has told: it is not handed out again, nor what lies
    /// before it, and times count from where they did.
    pub fn add_told(&mut self, entry: TimelineEntry) {
        let service = ServiceName::ALL
            .into_iter()
            .find(|name| name.as_str() == entry.service);
        if let Some(service) = service {
            let told_ns = &mut self.told_ns[service.index()];
            *told_ns = entry.t_ns.max(*told_ns);
        }
        if let Some(t_s) = entry.t_s {
            self.begin((entry.t_ns as f64 - t_s * 1e9) as u64);
        }
        self.told.push(entry);
    }

    /// Events that were overwritten before they could be read.
    pub const fn overwritten(&self) -> u64 {
        self.overwritten
    }

    /// Instant from which times count, ns: the first cycle in which every service answered.
    pub const fn origin_ns(&self) -> Option<u64> {
        self.origin_ns
    }

    /// The drive began at `origin_ns`, unless it had begun before.
    pub fn begin(&mut self, origin_ns: u64) {
        self.origin_ns.get_or_insert(origin_ns);
    }

    /// Scheduled instant of a recording's last frame, ns, once it has been played.
    pub const fn recording_end_ns(&self) -> Option<u64> {
        self.recording_end_ns
    }

    /// False for what another launcher has told, and for what follows from the end of a recording
    /// alone: that input is missing.
    fn is_shown(&self, record: &Record) -> bool {
        use EventKind::{InputBack, InputLost, Miss};
        let event = &record.event;
        if event.t_ns <= self.told_ns[record.service.index()] {
            return false;
        }
        let is_missing = [Miss, InputLost, InputBack]
            .map(|kind| kind as u32)
            .contains(&event.kind);
        !is_missing
            || self
                .recording_end_ns()
                .is_none_or(|end_ns| event.t_ns <= end_ns)
    }

    /// What was broken and mended, in the words of `--inject`, with the time since the origin.
    pub fn changes(&self) -> Vec<String> {
        let mut entries = self.entries();
        entries.retain(|entry| ["injected", "restored"].contains(&entry.event.as_str()));
        let since_s = |entry: &TimelineEntry| entry.t_s.unwrap_or(0.0).max(0.0);
        let spec = |entry: &TimelineEntry| format!("{}@{}", entry.what, since_s(entry));
        entries.iter().map(spec).collect()
    }

    /// The events that have been added since the last call, in order. Before the drive has begun
    /// they are kept back, unless it `is_late`: then they have no time of the drive.
    pub fn take_new(&mut self, is_late: bool) -> Vec<TimelineEntry> {
        let origin_ns = self.origin_ns;
        if origin_ns.is_none() && !is_late {
            return Vec::new();
        }
        self.forget();
        let from = std::mem::replace(&mut self.taken, self.records.len());
        self.records[from..].sort_by_key(|record| record.event.t_ns);
        let new = self.records[from..].iter();
        let shown = new.filter(|record| self.is_shown(record));
        shown
            .map(|record| self.namer.entry(record, origin_ns))
            .collect()
    }

    /// Forgets a quarter of what has been handed out, once there is too much: a robot drives for
    /// weeks. What was broken stays, as a simulator that is restarted has to know.
    fn forget(&mut self) {
        if self.records.len() <= RECORDS_MAX {
            return;
        }
        let last = self.taken.min(RECORDS_MAX / 4);
        let stays = [EventKind::Injected, EventKind::Restored].map(|kind| kind as u32);
        let before = self.records.len();
        let mut at = 0;
        self.records.retain(|record| {
            at += 1;
            at > last || stays.contains(&record.event.kind)
        });
        let forgotten = before - self.records.len();
        self.taken -= forgotten;
        self.overwritten += forgotten as u64;
    }

    /// Seconds for which the detector was blind, by cause, until `end_ns`.
    pub fn blind_s(&self, end_ns: u64) -> BTreeMap<&'static str, f64> {
        let mut sorted: Vec<&Event> = self.records.iter().map(|record| &record.event).collect();
        sorted.sort_by_key(|event| event.t_ns);
        blind_s(sorted.into_iter(), end_ns)
    }

    /// Every event in words, in order.
    pub fn entries(&self) -> Vec<TimelineEntry> {
        let shown = self.records.iter().filter(|record| self.is_shown(record));
        let shown = shown.map(|record| self.namer.entry(record, self.origin_ns));
        let mut entries: Vec<TimelineEntry> = self.told.iter().cloned().chain(shown).collect();
        entries.sort_by_key(|entry| entry.t_ns);
        entries
    }
}

/// Adds up what lies between events of blindness.
fn blind_s<'a>(
    events: impl Iterator<Item = &'a Event>,
    end_ns: u64,
) -> BTreeMap<&'static str, f64> {
    let mut sums = BTreeMap::new();
    let mut since: Option<(u64, u32)> = None;
    let mut close = |since: &mut Option<(u64, u32)>, t_ns: u64| {
        if let Some((from_ns, cause)) = since.take() {
            let name = Blindness::from_repr(cause).map_or("unknown", Blindness::name);
            *sums.entry(name).or_insert(0.0) += t_ns.saturating_sub(from_ns) as f64 * 1e-9;
        }
    };
    for event in events.take_while(|event| event.t_ns <= end_ns) {
        match EventKind::from_repr(event.kind) {
            Some(EventKind::Blind) => {
                close(&mut since, event.t_ns);
                since = Some((event.t_ns, event.what));
            }
            Some(EventKind::BlindEnds) => close(&mut since, event.t_ns),
            _ => {}
        }
    }
    close(&mut since, end_ns);
    sums
}

#[cfg(test)]
mod tests;
