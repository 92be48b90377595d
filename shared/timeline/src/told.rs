//! What people are told: misses in a row are one line.

use crate::entry::TimelineEntry;
use crate::words::cycles;

/// Misses of a service that lie closer are told together, ns.
const MISSES_APART_NS: u64 = 10_000_000_000;

/// The entries for people: without what only programs read, and misses of a service that follow
/// each other within ten seconds as one.
#[must_use]
pub fn told(entries: &[TimelineEntry]) -> Vec<TimelineEntry> {
    let mut told: Vec<TimelineEntry> = Vec::new();
    // For each miss at the end of `told`, when the last that it stands for was, ns.
    let mut last_ns: Vec<u64> = Vec::new();
    for entry in entries.iter().filter(|entry| entry.is_told()) {
        if !entry.is_miss() {
            last_ns.clear();
        } else {
            let misses = told.len() - last_ns.len();
            let goes_on = |(miss, last_ns): (&TimelineEntry, &u64)| {
                miss.service == entry.service && entry.t_ns - last_ns <= MISSES_APART_NS
            };
            if let Some(at) = told[misses..].iter().zip(&last_ns).position(goes_on) {
                told[misses + at].add_miss(entry);
                last_ns[at] = entry.t_ns;
                continue;
            }
            last_ns.push(entry.t_ns);
        }
        told.push(entry.clone());
    }
    told
}

impl TimelineEntry {
    /// True of missed cycles.
    #[must_use]
    pub fn is_miss(&self) -> bool {
        self.event == "miss"
    }

    /// Stands from now on for this later miss, too.
    pub fn add_miss(&mut self, later: &Self) {
        let count = self.count.unwrap_or(0) + later.count.unwrap_or(0);
        let during_s = later.t_ns.saturating_sub(self.t_ns) as f64 * 1e-9;
        self.count = Some(count);
        self.what = format!("{} in {during_s:.1} s", cycles(count));
    }
}

/// Misses while they come: the first of a service is told at once, those of the ten seconds that
/// follow together when these are over.
#[derive(Debug, Default)]
pub struct PendingMisses(Vec<ServiceMisses>);

#[derive(Debug)]
struct ServiceMisses {
    service: String,
    untold: Option<TimelineEntry>,
    until_ns: u64,
}

impl PendingMisses {
    /// What is to be told now that this has happened, in order.
    pub fn add(&mut self, entry: &TimelineEntry) -> Vec<TimelineEntry> {
        if !entry.is_told() {
            return Vec::new();
        }
        if !entry.is_miss() {
            let mut told = self.due(u64::MAX);
            told.push(entry.clone());
            return told;
        }
        let mut pending = self.0.iter_mut();
        match pending.find(|misses| misses.service == entry.service) {
            Some(misses) => {
                match &mut misses.untold {
                    Some(untold) => untold.add_miss(entry),
                    untold => *untold = Some(entry.clone()),
                }
                Vec::new()
            }
            None => {
                self.0.push(ServiceMisses {
                    service: entry.service.clone(),
                    untold: None,
                    until_ns: entry.t_ns.saturating_add(MISSES_APART_NS),
                });
                vec![entry.clone()]
            }
        }
    }

    /// The misses whose ten seconds are over at `now_ns`.
    pub fn due(&mut self, now_ns: u64) -> Vec<TimelineEntry> {
        let mut told = Vec::new();
        self.0.retain_mut(|misses| {
            if now_ns < misses.until_ns {
                return true;
            }
            misses.until_ns = now_ns.saturating_add(MISSES_APART_NS);
            let untold = misses.untold.take();
            // Who misses on is not told at once again.
            let goes_on = untold.is_some() && now_ns < u64::MAX;
            told.extend(untold);
            goes_on
        });
        told
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(t_s: f64, service: &str, event: &str) -> TimelineEntry {
        TimelineEntry {
            t_s: Some(t_s),
            t_ns: (t_s * 1e9) as u64,
            service: service.to_owned(),
            event: event.to_owned(),
            count: (event == "miss").then_some(2),
            what: "2 cycles".to_owned(),
            ..TimelineEntry::default()
        }
    }

    #[test]
    fn misses_in_a_row_are_one_line_for_each_service() {
        let entries = [
            entry(1.0, "detector", "miss"),
            entry(1.2, "identifier", "miss"),
            entry(1.5, "detector", "miss"),
            entry(11.4, "detector", "miss"),
            entry(22.0, "detector", "miss"),
            entry(22.1, "detector", "alarm"),
            entry(22.2, "detector", "miss"),
        ];
        let told = told(&entries);
        let lines: Vec<_> = told
            .iter()
            .map(|entry| (entry.service.as_str(), entry.what.as_str(), entry.count))
            .collect();
        assert_eq!(
            lines,
            [
                ("detector", "6 cycles in 10.4 s", Some(6)),
                ("identifier", "2 cycles", Some(2)),
                ("detector", "2 cycles", Some(2)),
                ("detector", "2 cycles", None),
                ("detector", "2 cycles", Some(2)),
            ]
        );
        assert_eq!(told[0].t_s, Some(1.0));
    }

    #[test]
    fn misses_are_told_at_once_and_then_every_ten_seconds() {
        let mut pending = PendingMisses::default();
        let lines = |told: Vec<TimelineEntry>| -> Vec<String> {
            let line = |entry: TimelineEntry| format!("{} {}", entry.service, entry.what);
            told.into_iter().map(line).collect()
        };
        let miss = |t_s| entry(t_s, "detector", "miss");
        assert_eq!(lines(pending.add(&miss(1.0))), ["detector 2 cycles"]);
        assert_eq!(lines(pending.add(&miss(1.1))), [""; 0]);
        assert_eq!(lines(pending.add(&miss(10.9))), [""; 0]);
        assert_eq!(lines(pending.due(10_900_000_000)), [""; 0]);
        let together = "detector 4 cycles in 9.8 s";
        assert_eq!(lines(pending.due(11_000_000_000)), [together]);
        assert_eq!(lines(pending.add(&miss(11.5))), [""; 0]);
        let alarm = entry(11.6, "detector", "alarm");
        let told = lines(pending.add(&alarm));
        assert_eq!(told, ["detector 2 cycles", "detector 2 cycles"]);
        assert_eq!(lines(pending.add(&miss(11.7))), ["detector 2 cycles"]);
    }
}
