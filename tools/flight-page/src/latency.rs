//! How late actions came, counted from when their cycle was due.

use hdrhistogram::Histogram;
use vigil_blocks::{Action, CauseKind};
use vigil_pages::chart::{Axis, Chart, Curve, Label, Stroke};
use vigil_pages::colour::Colour;
use vigil_pages::page::{remark, table, titled};

use crate::belief::{TimedTrace, WIDTH};

/// Longest latency that is told apart, ns.
const LATENCY_NS_MAX: u64 = 100_000_000_000;
/// Steps of the histogram for a factor of ten.
const STEPS: f64 = 20.0;
const SIZE: (u32, u32) = (WIDTH, 380);
const MS: f64 = 1e-6;

/// How late actions came.
#[derive(Debug)]
pub(crate) struct Latencies {
    /// `None` only if the bounds were none of a histogram.
    counts: Option<Histogram<u64>>,
    trace: TimedTrace,
    /// Actions that answer no frame, because it was missed.
    missed: u64,
}

impl Default for Latencies {
    fn default() -> Self {
        Self {
            counts: Histogram::new_with_bounds(1, LATENCY_NS_MAX, 3).ok(),
            trace: TimedTrace::default(),
            missed: 0,
        }
    }
}

/// Values at which a logarithmic axis between two ends is labelled, ms.
fn labelled_ms(from_ms: f64, to_ms: f64) -> Vec<f64> {
    let powers = (-6..=6).map(|power| 10.0_f64.powi(power));
    let all = powers.flat_map(|power| [1.0, 2.0, 5.0].map(|m| round(m * power)));
    let all: Vec<f64> = all.collect();
    let first = all.iter().rposition(|ms| *ms <= from_ms).unwrap_or(0);
    let last = all.iter().position(|ms| *ms >= to_ms);
    let last = last.unwrap_or(all.len() - 1).max(first + 1);
    all.get(first..=last).unwrap_or_default().to_vec()
}

/// Without the dust of powers of ten.
fn round(ms: f64) -> f64 {
    (ms * 1e6).round() / 1e6
}

/// A broken line at a bound.
pub(crate) fn bound(points: [(f64, f64); 2]) -> Curve {
    Curve {
        colour: Colour::Alarm,
        stroke: Stroke::Dashed,
        points: points.to_vec(),
    }
}

fn histogram(counts: &Histogram<u64>, deadline_ms: f64) -> String {
    let [least, most] = [counts.min(), counts.max()].map(|ns| ns as f64 * MS);
    let ends = [least, most.max(deadline_ms)];
    let values = labelled_ms(ends[0], ends[1]);
    let x = Axis::placed(
        "from the due instant to the action, ms",
        &values,
        f64::log10,
    );
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
        curves.push(bound([(place, 0.0), (place, highest)]));
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
            self.trace.add(t_s, late_ns as f64 * MS);
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

    fn over_time(&self, time: &Axis, deadline_ms: f64) -> String {
        let highest = 1.05 * self.trace.max().max(deadline_ms);
        let mut curves = self.trace.curves(Colour::Series(0), Stroke::Thin);
        let mut labels = Vec::new();
        if deadline_ms > 0.0 {
            let [from_s, to_s] = time.range;
            curves.push(bound([(from_s, deadline_ms), (to_s, deadline_ms)]));
            let at = (from_s, 0.93 * deadline_ms);
            labels.push(Label {
                at,
                text: "deadline".to_owned(),
            });
        }
        let caption = "End-to-end latency over time";
        let chart = Chart {
            caption: caption.to_owned(),
            size: SIZE,
            x: time.clone(),
            y: Axis::linear("latency, ms", highest, 4.0),
            curves,
            labels,
        };
        titled(caption, "", &chart.svg())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::{Cause, Header};

    #[test]
    fn a_logarithmic_axis_is_labelled_around_its_ends() {
        assert_eq!(labelled_ms(0.3, 4.0), [0.2, 0.5, 1.0, 2.0, 5.0]);
        assert_eq!(labelled_ms(1.0, 1.0), [1.0, 2.0]);
        assert!(labelled_ms(0.0, 1e9).len() > 30);
    }

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
        assert!(!charts.contains("NaN") && charts.contains("deadline"));
    }
}
