//! How late actions came, counted from when their cycle was due.

use hdrhistogram::Histogram;
use vigil_blocks::{Action, CauseKind};
use vigil_pages::chart::{Axis, Chart, Curve, Label, Stroke};
use vigil_pages::colour::Colour;
use vigil_pages::columns::Columns;
use vigil_pages::heat::{Grid, HeatMap, Scale};
use vigil_pages::page::{KeyEntry, key, remark, table, titled};
use vigil_pages::spectrum::{Spectrum, ends};

use crate::belief::WIDTH;

/// Longest latency that is told apart, ns.
const LATENCY_NS_MAX: u64 = 100_000_000_000;
/// Steps of the histogram for a factor of ten.
const STEPS: f64 = 20.0;
const SIZE: (u32, u32) = (WIDTH, 380);
const HEAT_SIZE: (u32, u32) = (WIDTH, 460);
/// Labels of a logarithmic axis at most: to the right, and upwards.
const LABELS_MAX: [usize; 2] = [20, 9];
/// Columns of the heat map at most, and their width at first, s.
const COLUMNS: u32 = 512;
const COLUMN_S: f64 = 0.01;
/// With fewer actions in each, columns are made wider, as long as so many are left.
const ACTIONS_LEAST: u64 = 25;
const COLUMNS_LEAST: u64 = 64;
const MS: f64 = 1e-6;

/// How late actions came.
#[derive(Debug)]
pub(crate) struct Latencies {
    /// `None` only if the bounds were none of a histogram.
    counts: Option<Histogram<u64>>,
    /// The same over time, ms.
    over_time: Columns<Spectrum>,
    /// Actions that answer no frame, because it was missed.
    missed: u64,
}

impl Default for Latencies {
    fn default() -> Self {
        Self {
            counts: Histogram::new_with_bounds(1, LATENCY_NS_MAX, 3).ok(),
            over_time: Columns::new(COLUMNS, COLUMN_S),
            missed: 0,
        }
    }
}

fn histogram(counts: &Histogram<u64>, deadline_ms: f64) -> String {
    let [least, most] = [counts.min(), counts.max()].map(|ns| ns as f64 * MS);
    let ends = [least, most.max(deadline_ms)];
    let title = "from the due instant to the action, ms";
    let x = Axis::logarithmic(title, ends, LABELS_MAX[0]);
    let [from, to] = x.range;
    let bins = ((to - from) * STEPS).ceil().max(1.0) as usize;
    let edge = |bin: usize| from + (to - from) * bin as f64 / bins as f64;
    let ns = |place: f64| (10.0_f64.powf(place) / MS) as u64;
    let share = |bin: usize| {
        let [begin, end] = [edge(bin), edge(bin + 1)].map(ns);
        let count = counts.count_between(begin.max(1), end.saturating_sub(1).max(1));
        100.0 * count as f64 / counts.len() as f64
    };
    let shares: Vec<f64> = (0..bins).map(share).collect();
    let highest = shares.iter().copied().fold(0.0, f64::max);
    let drawn = shares.iter().enumerate().filter(|(_, share)| **share > 0.0);
    let bars = drawn.map(|(bin, share)| Curve {
        colour: Colour::Series(0),
        stroke: Stroke::Area,
        points: [(bin, 0.0), (bin, *share), (bin + 1, *share), (bin + 1, 0.0)]
            .map(|(bin, share)| (edge(bin), share))
            .to_vec(),
    });
    let mut curves: Vec<Curve> = bars.collect();
    let mut labels = Vec::new();
    if deadline_ms > 0.0 {
        let place = deadline_ms.log10();
        curves.push(Curve::bound([(place, 0.0), (place, highest)]));
        // Beside the line, on the side that has room.
        let aside = if place > from + 0.9 * (to - from) {
            0.08
        } else {
            0.0
        };
        let at = (place - aside * (to - from), 0.94 * highest);
        labels.push(Label {
            at,
            text: "deadline".to_owned(),
        });
    }
    let caption = "End-to-end latency: share of the actions by how late they came";
    let chart = Chart {
        caption: caption.to_owned(),
        size: SIZE,
        x,
        y: Axis::linear("actions, %", highest, 4.0),
        curves,
        labels,
    };
    titled(caption, "", &chart.svg())
}

impl Latencies {
    /// Takes an action.
    pub(crate) fn take(&mut self, t_s: f64, action: &Action) {
        let header = &action.header;
        if action.cause.kind() != Some(CauseKind::Frame) {
            self.missed += 1;
            return;
        }
        if let Some(late_ns) = header.t_publish_ns.checked_sub(header.t_schedule_ns) {
            if let Some(counts) = &mut self.counts {
                counts.saturating_record(late_ns.max(1));
            }
            let late_ms = late_ns.max(1) as f64 * MS;
            let spectrum = [late_ms].into_iter().collect();
            self.over_time.add(t_s, spectrum, false);
        }
    }

    /// The charts; `deadline_ns` is what the supervisor has to keep, 0 if that is not known.
    pub(crate) fn charts(&self, time: &Axis, deadline_ns: u64) -> String {
        let Some(counts) = self.counts.as_ref().filter(|counts| !counts.is_empty()) else {
            return remark("The recording holds no action that answers a frame.");
        };
        let deadline_ms = deadline_ns as f64 * MS;
        let at = |quantile: f64| format!("{:.3}", counts.value_at_quantile(quantile) as f64 * MS);
        let late = counts.count_between(deadline_ns.max(1), LATENCY_NS_MAX);
        let known = |text: String| match deadline_ns {
            0 => "?".to_owned(),
            _ => text,
        };
        let mut row: Vec<String> = [0.5, 0.9, 0.99, 0.999, 1.0].map(at).to_vec();
        row.extend([
            known(format!("{deadline_ms:.3}")),
            known(late.to_string()),
            counts.len().to_string(),
            self.missed.to_string(),
        ]);
        let heads = [
            "p50, ms",
            "p90, ms",
            "p99, ms",
            "p99.9, ms",
            "longest, ms",
            "deadline, ms",
            "later than that",
            "actions",
            "without a frame",
        ];
        let [histogram, over_time] = [
            histogram(counts, deadline_ms),
            self.over_time(time, deadline_ms),
        ];
        format!("{}{histogram}{over_time}", table(&heads, &[row]))
    }

    /// Columns with enough actions in each to speak of shares.
    fn columns(&self) -> Columns<Spectrum> {
        let mut columns = self.over_time.clone();
        let actions: u64 = columns.iter().map(|(_, of)| of.total()).sum();
        while columns.span() >= 2 * COLUMNS_LEAST && actions < ACTIONS_LEAST * columns.span() {
            columns.widen();
        }
        columns
    }

    fn over_time(&self, time: &Axis, deadline_ms: f64) -> String {
        let columns = self.columns();
        let (count, width_s) = (columns.span() as usize, columns.width_s());
        let nothing = Spectrum::default();
        let mut spectra = vec![&nothing; count];
        for (at, spectrum) in columns.iter() {
            spectra[at as usize] = spectrum;
        }
        let edges = (0..=count).map(|edge| edge as f64 * width_s).collect();
        let grid = Grid::new(edges, &spectra).turned();
        let [least, most] = ends(spectra).unwrap_or([1.0; 2]);
        let y = Axis::logarithmic("latency, ms", [least, most.max(deadline_ms)], LABELS_MAX[1]);
        let (mut curves, mut names) = (Vec::new(), String::new());
        if deadline_ms > 0.0 {
            let place = deadline_ms.log10();
            curves.push(Curve::bound(time.range.map(|t_s| (t_s, place))));
            names = key(&[KeyEntry::bound(format!("deadline, {deadline_ms} ms"))]);
        }
        let caption = "End-to-end latency over time";
        let map = HeatMap {
            chart: Chart {
                caption: format!("{caption}: share of the actions at each time"),
                size: HEAT_SIZE,
                x: time.clone(),
                y,
                curves,
                labels: Vec::new(),
            },
            scale: Scale::logarithmic("share of the actions at that time", &grid.all()),
            grid,
        };
        titled(caption, &names, &map.svg())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::{Cause, Header};

    #[test]
    fn late_actions_are_counted_and_nothing_is_drawn_of_none() {
        let time = Axis::linear("time, s", 10.0, 5.0);
        let mut latencies = Latencies::default();
        assert!(latencies.charts(&time, 0).contains("no action"));
        for i in 0..1000_u64 {
            let action = Action {
                header: Header {
                    t_schedule_ns: 1_000_000_000,
                    t_publish_ns: 1_000_300_000 + 1000 * i + 10_000_000 * (i / 999),
                    ..Header::default()
                },
                cause: Cause {
                    kind: if i == 5 { 2 } else { 1 },
                    ..Cause::default()
                },
                ..Action::default()
            };
            latencies.take(i as f64 * 0.01, &action);
        }
        let charts = latencies.charts(&time, 5_000_000);
        assert!(
            charts.contains("<td>5.000</td><td>1</td><td>999</td><td>1</td>"),
            "{charts}"
        );
        assert!(!charts.contains("NaN") && charts.contains("deadline, 5 ms"));
        let weakest = charts.matches("fill=\"var(--h1)\"").count();
        assert_eq!(
            weakest, 2,
            "one late action is a cell, beside that of the key"
        );
    }

    #[test]
    fn columns_are_bounded_however_long_a_recording_is_and_few_actions_have_wide_ones() {
        let columns = |count: u64, step_s: f64| {
            let mut latencies = Latencies::default();
            let mut action = Action::default();
            action.header.t_publish_ns = 1_000_000;
            action.cause.kind = 1;
            (0..count).for_each(|i| latencies.take(i as f64 * step_s, &action));
            let charts = latencies.charts(&Axis::linear("time, s", 9.0, 5.0), 0);
            assert!(!charts.contains("NaN") && !charts.contains("stroke-dasharray"));
            (latencies.over_time.span(), latencies.columns().span())
        };
        let (kept, drawn) = columns(100_000, 0.5);
        assert!((256..=512).contains(&kept) && drawn == kept);
        let (_, drawn) = columns(300, 0.05);
        assert!((64..128).contains(&drawn), "{drawn}");
        assert!((64..128).contains(&columns(2, 1e9).1));
        assert_eq!(columns(1, 0.0), (1, 1));
    }
}
