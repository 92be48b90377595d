//! What services said about themselves.

use vigil_blocks::{Health, Rejection};
use vigil_cycle::topic::ServiceName;
use vigil_pages::chart::{Axis, Chart, Curve, Stroke};
use vigil_pages::colour::Colour;
use vigil_pages::page::{KeyEntry, key, remark, table, titled};
use vigil_timeline::{degraded_text, service_state_text};

use crate::belief::{TimedTrace, WIDTH};

const SIZE: (u32, u32) = (WIDTH, 340);
const MS: f64 = 1e-6;
/// How the curves of services differ, beside their colours.
const STROKES: [Stroke; 4] = [Stroke::Solid, Stroke::Dashed, Stroke::Dotted, Stroke::Thin];

/// Counters of a service that are told, in the order of the table.
const COUNTERS: [&str; 7] = [
    "cycles",
    "missed",
    "over budget",
    "input lost",
    "input late",
    "input twice",
    "input refused",
];

fn counters(health: &Health) -> [u64; COUNTERS.len()] {
    [
        health.cycles,
        health.missed,
        health.over_budget,
        health.lost,
        health.late,
        health.duplicate,
        health.invalid,
    ]
}

/// What is known of a service.
#[derive(Debug, Default)]
struct ServiceHealth {
    last: Option<Health>,
    /// Counted within the recording.
    counted: [u64; COUNTERS.len()],
    restarts: u64,
    cycle_ms: TimedTrace,
    missed: TimedTrace,
}

impl ServiceHealth {
    fn take(&mut self, t_s: f64, health: &Health) {
        let last = self.last.replace(*health);
        let is_new_start = last.is_some_and(|last| last.header.epoch != health.header.epoch);
        self.restarts += u64::from(is_new_start);
        // What was counted before the recording is not of it.
        let before = match last {
            Some(last) if !is_new_start => counters(&last),
            Some(_) => [0; COUNTERS.len()],
            None => counters(health),
        };
        let now = counters(health);
        for (counted, (now, before)) in self.counted.iter_mut().zip(now.iter().zip(before)) {
            *counted = counted.saturating_add(now.saturating_sub(before));
        }
        if health.cycles > 0 {
            self.cycle_ms.add(t_s, health.last_cycle_ns as f64 * MS);
        }
        self.missed.add(t_s, self.counted[1] as f64);
    }

    fn row(&self, name: ServiceName) -> Option<Vec<String>> {
        let last = self.last.as_ref()?;
        let state = match last.degraded {
            0 => service_state_text(last.state).to_owned(),
            bits => format!("degraded: {}", degraded_text(bits)),
        };
        let ms = |ns: u64| format!("{:.3}", ns as f64 * MS);
        let mut row = vec![name.as_str().to_owned(), state, self.restarts.to_string()];
        row.extend(self.counted.map(|count| count.to_string()));
        row.extend([last.worst_cycle_ns, last.budget_ns, last.deadline_ns].map(ms));
        Some(row)
    }

    /// Refused input by cause, since the service's start.
    fn refused(&self, name: ServiceName) -> Vec<Vec<String>> {
        let Some(last) = &self.last else {
            return Vec::new();
        };
        let causes = Rejection::ALL.iter().zip(last.rejected);
        let causes = causes.filter(|(_, count)| *count > 0);
        let row = |(cause, count): (&Rejection, u64)| {
            let name = name.as_str().to_owned();
            vec![name, cause.as_str().to_owned(), count.to_string()]
        };
        causes.map(row).collect()
    }
}

/// What all services said about themselves.
#[derive(Debug, Default)]
pub(crate) struct Healths([ServiceHealth; ServiceName::ALL.len()]);

impl Healths {
    /// Takes what a service says.
    pub(crate) fn take(&mut self, t_s: f64, service: ServiceName, health: &Health) {
        self.0[service.index()].take(t_s, health);
    }

    /// The supervisor's deadline, which is that of the whole chain, ns; 0 if it is not known.
    pub(crate) fn deadline_ns(&self) -> u64 {
        let supervisor = &self.0[ServiceName::Supervisor.index()];
        supervisor.last.map_or(0, |last| last.deadline_ns)
    }

    fn named(&self) -> impl Iterator<Item = (ServiceName, &ServiceHealth)> {
        ServiceName::ALL.into_iter().zip(&self.0)
    }

    /// The tables.
    pub(crate) fn tables(&self) -> String {
        let rows = self.named().filter_map(|(name, of)| of.row(name));
        let rows: Vec<Vec<String>> = rows.collect();
        if rows.is_empty() {
            return remark("The recording holds no word of the services.");
        }
        let mut heads = vec!["service", "state at the end", "restarts"];
        heads.extend(COUNTERS);
        heads.extend(["longest cycle, ms", "budget, ms", "deadline, ms"]);
        let mut found = table(&heads, &rows);
        let refused: Vec<_> = self
            .named()
            .flat_map(|(name, of)| of.refused(name))
            .collect();
        if refused.is_empty() {
            found.push_str(&remark("No input was refused."));
        } else {
            let heads = ["service", "refused because", "since its start"];
            found.push_str(&table(&heads, &refused));
        }
        found
    }

    /// Cycle times and misses over time.
    pub(crate) fn charts(&self, time: &Axis) -> String {
        let title = "Time of a cycle, from wake-up to publication";
        let cycles = self.chart(title, "cycle, ms", time, |of| &of.cycle_ms);
        let is_missed = self.0.iter().any(|of| of.counted[1] > 0);
        let missed = match is_missed {
            true => self.chart("Cycles missed so far", "missed", time, |of| &of.missed),
            false => remark("No service missed a cycle in this recording."),
        };
        format!("{cycles}{missed}")
    }

    fn chart(
        &self,
        title: &str,
        unit: &'static str,
        time: &Axis,
        trace: fn(&ServiceHealth) -> &TimedTrace,
    ) -> String {
        let drawn = self.named().enumerate();
        let drawn = drawn.filter(|(_, (_, of))| !trace(of).is_empty());
        let drawn: Vec<_> = drawn.collect();
        if drawn.is_empty() {
            return String::new();
        }
        let highest = drawn.iter().map(|(_, (_, of))| trace(of).max());
        let highest = highest.fold(0.0, f64::max);
        let look = |at: usize| (Colour::Series(at), STROKES[at % STROKES.len()]);
        let curves = drawn.iter().flat_map(|(at, (_, of))| {
            let (colour, stroke) = look(*at);
            trace(of).curves(colour, stroke)
        });
        let curves: Vec<Curve> = curves.collect();
        let entries = drawn.iter().map(|(at, (name, _))| {
            let (colour, stroke) = look(*at);
            KeyEntry {
                colour,
                stroke,
                name: name.as_str().to_owned(),
            }
        });
        let entries: Vec<KeyEntry> = entries.collect();
        let chart = Chart {
            caption: title.to_owned(),
            size: SIZE,
            x: time.clone(),
            y: Axis::linear(unit, 1.05 * highest, 4.0),
            curves,
            labels: Vec::new(),
        };
        titled(title, &key(&entries), &chart.svg())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::Header;

    #[test]
    fn only_what_was_counted_within_the_recording_is_told() {
        let mut healths = Healths::default();
        for (epoch, missed) in [(1, 100), (1, 103), (2, 4)] {
            let mut health = Health {
                header: Header {
                    epoch,
                    ..Header::default()
                },
                cycles: 5,
                missed,
                ..Health::default()
            };
            health.rejected[Rejection::Jump as usize] = 9;
            healths.take(1.0, ServiceName::Detector, &health);
        }
        let tables = healths.tables();
        assert!(
            tables.contains("<td>1</td><td>5</td><td>7</td>"),
            "{tables}"
        );
        assert!(tables.contains("<td>jump</td><td>9</td>"), "{tables}");
        assert!(!healths.charts(&Axis::default()).contains("NaN"));
    }
}
