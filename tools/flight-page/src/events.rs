//! What the services told.

use vigil_pages::bands::Row;
use vigil_pages::colour::Colour;
use vigil_pages::page::{remark, table};
use vigil_timeline::TimelineEntry;

/// Events of the table: so many from the beginning, and so many from the end.
const FIRST: usize = 150;
const LAST: usize = 50;
/// Ticks of the row.
const TICKS_MAX: usize = 2000;
/// Kinds that say that something is wrong.
const GRAVE: [&str; 9] = [
    "alarm",
    "safe-stop",
    "input-lost",
    "watchdog",
    "assertion",
    "blind",
    "restarted",
    "miss",
    "degraded",
];

/// What the services told, in the order of the file.
#[derive(Debug, Default)]
pub(crate) struct Events {
    first: Vec<Vec<String>>,
    last: std::collections::VecDeque<Vec<String>>,
    ticks: Vec<(f64, Colour)>,
    /// Those that are told, and how many of them are missed cycles.
    count: usize,
    misses: usize,
}

/// Time of day of an instant as RFC 3339 has it, UTC.
pub(crate) fn time_of_day(rfc3339: &str) -> &str {
    rfc3339.get(11..23).unwrap_or("?")
}

fn words(entry: &TimelineEntry) -> String {
    let mut words = format!("{} {}", entry.event, entry.what).trim().to_owned();
    if let Some(set) = &entry.fault_set {
        words.push_str(&format!(" {set}"));
    }
    if let Some(p) = entry.p {
        words.push_str(&format!(", p = {p:.3}"));
    }
    words
}

impl Events {
    /// Takes an event; those that only programs read are left out.
    pub(crate) fn take(&mut self, t_s: f64, rfc3339: &str, entry: &TimelineEntry) {
        if !entry.is_told() {
            return;
        }
        self.count += 1;
        if self.ticks.len() < TICKS_MAX {
            let colour = match GRAVE.contains(&entry.event.as_str()) {
                true => Colour::Alarm,
                false => Colour::Ink,
            };
            self.ticks.push((t_s, colour));
        }
        if entry.is_miss() {
            self.misses += 1;
            return;
        }
        let row = vec![
            time_of_day(rfc3339).to_owned(),
            format!("{t_s:.3}"),
            entry.service.clone(),
            words(entry),
        ];
        if self.first.len() < FIRST {
            return self.first.push(row);
        }
        self.last.push_back(row);
        if self.last.len() > LAST {
            self.last.pop_front();
        }
    }

    /// The row of ticks.
    pub(crate) fn row(&self) -> Row {
        Row {
            name: format!("events ({}; see the table below)", self.count),
            ticks: self.ticks.clone(),
            ..Row::default()
        }
    }

    /// The table.
    pub(crate) fn table(&self) -> String {
        if self.count == 0 {
            return remark("The recording holds no events.");
        }
        let heads = ["time of day, UTC", "s", "service", "what"];
        let mut found = table(&heads, &self.first);
        let left_out = self.count - self.misses - self.first.len() - self.last.len();
        if left_out > 0 {
            found.push_str(&remark(&format!(
                "{left_out} further events are left out here."
            )));
        }
        if !self.last.is_empty() {
            let last: Vec<Vec<String>> = self.last.iter().cloned().collect();
            found.push_str(&table(&heads, &last));
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_events_leave_out_their_middle_and_say_so() {
        let mut events = Events::default();
        let mut entry = TimelineEntry {
            event: "alarm".into(),
            ..TimelineEntry::default()
        };
        for i in 0..1000 {
            entry.what = format!("<{i}>");
            events.take(f64::from(i), "2023-11-14T22:13:32.345Z", &entry);
        }
        let table = events.table();
        assert!(
            table.contains("<td>22:13:32.345</td><td>149.000</td>"),
            "{table}"
        );
        assert!(table.contains("alarm &lt;999&gt;") && !table.contains("&lt;500&gt;"));
        assert!(table.contains("800 further events"));
        assert_eq!(events.row().ticks.len(), 1000);
        entry.event = "miss".into();
        events.take(2000.0, "2023-11-14T22:13:32.345Z", &entry);
        assert!(events.table().contains("800 further events"));
        assert_eq!(events.row().ticks.len(), 1001);
        assert_eq!(time_of_day("ä?"), "?");
    }
}
