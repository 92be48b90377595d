//! The cells of a run as one page to read: no script, nothing loaded.

use std::fmt::Write as _;

use serde_json::Value;
use vigil_cycle::Latency;
use vigil_evaluation::report::ChartError;
use vigil_evaluation::report::chart::{Axis, Chart, Curve, INK, Stroke};
use vigil_evaluation::report::page::{beside, escaped, key, page, section};

use super::attribution::Miss;
use super::cell::Cell;
use super::parts::{self, Part};
use crate::percentile;

/// Colours: end to end, hand-over, the floor's hand-over, compute, the machine's misses, ours.
const WHOLE: usize = 1;
const HAND_OVER: usize = 2;
const FLOOR: usize = 3;
const COMPUTE: usize = 4;
const MACHINE: usize = 5;
const OURS: usize = 6;

/// Misses shown over time, the longest of each kind.
const DOTS: usize = 200;
/// Points of the curve over time.
const MOMENTS: u64 = 300;
/// Latencies of the axes, us.
const TICKS_US: [f64; 7] = [1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6];

/// The page of these cells; `facts` is what is to be known of the machine, name and value.
///
/// # Errors
/// [`ChartError`], the drawing library's.
pub fn html(title: &str, facts: &[(String, String)], cells: &[Cell]) -> Result<String, ChartError> {
    let mut body = format!("<h1>{}</h1>\n", escaped(title));
    body.push_str(ABOUT);
    body.push_str(&section("cells", "All cells", ALL_CELLS, &table(cells)));
    for (cell, name) in cells.iter().zip(&names(cells)) {
        body.push_str(&one(cell, name)?);
    }
    let checklist = rows(facts.iter().map(|(n, v)| (n.as_str(), v.clone())));
    let known = "What the figures depend on, read from the machine.";
    body.push_str(&section("machine", "The machine", known, &checklist));
    Ok(page(title, &body))
}

/// Names of cells: those of their specifications, numbered where one is repeated.
#[must_use]
pub fn names(cells: &[Cell]) -> Vec<String> {
    let name = |(i, cell): (usize, &Cell)| {
        let earlier = cells[..i].iter().filter(|c| c.spec == cell.spec).count();
        match earlier {
            0 => cell.spec.name(),
            n => format!("{}-{}", cell.spec.name(), n + 1),
        }
    };
    cells.iter().enumerate().map(name).collect()
}

const ABOUT: &str = "<p>Every latency counts from the instant at which the cycle was <em>due</em> \
    to the publication of the action, on CLOCK_MONOTONIC, for every instant of the schedule: one \
    that was slept through has the latency until the next answer. The first two seconds are left \
    out as warm-up. <em>Hand-over</em> is the part in which no stage computes: waking up and \
    passing on, four times. <em>Floor</em> is the same part of four processes on the same cores, \
    with the same priorities and block sizes, that do nothing but hand over by a futex, measured \
    before and after the graph in the same cell. A sensor flood needs a graph's topic: in its \
    cells the floor is measured without the flood. Canaries are threads that do nothing but be on \
    time, one on each core, one priority above the graph. A missed deadline is the \
    <em>machine's</em> if canaries were overdue, beyond what nine of ten of their wake-ups keep \
    to, for half the overrun or more between schedule and end (time in which two were overdue \
    counts once, as the chain passes over their cores in turn); else it is Vigil's \
    <em>own</em>.</p>\n";

const ALL_CELLS: &str = "Times in us. Folded: instants that only a later one's answer ended. \
    Ratio: hand-over against the floor, median and 99th percentile. No one stall: misses, of \
    either kind, that no single late wake-up of a canary explains. Canary: wake-ups of the \
    canaries, in a million, that would have missed the deadline of a usual cycle. Machine / \
    canary: misses of the machine over that. Own, by stage: instants that each stage answered \
    after its own deadline and that are not the machine's.";

/// Heads of the table's columns.
const HEADS: [&str; 22] = [
    "rate, Hz",
    "load",
    "scheduling",
    "cycles",
    "folded",
    "end to end p50",
    "p99",
    "p99.9",
    "max",
    "compute p50",
    "hand-over p50",
    "p99",
    "floor p50",
    "p99",
    "ratio p50",
    "p99",
    "missed: own",
    "machine",
    "no one stall",
    "canary, ppm",
    "machine / canary",
    "own, by stage",
];

fn table(cells: &[Cell]) -> String {
    let mut text = String::from("<div class=\"wide\"><table class=\"close\"><thead><tr>");
    for head in HEADS {
        let _ = write!(text, "<th>{head}</th>");
    }
    text.push_str("</tr></thead><tbody>\n");
    for (cell, name) in cells.iter().zip(names(cells)) {
        let (whole, compute) = (
            cell.graph.end_to_end.percentiles(),
            cell.graph.compute.percentiles(),
        );
        let (hand, floor) = (
            cell.graph.hand_over.percentiles(),
            cell.floor.hand_over.percentiles(),
        );
        let (ours, machine) = cell.missed();
        let (p50, p99) = cell.over_floor();
        let us = |ns: u64| format!("{:.1}", ns as f64 * 1e-3);
        let scheduling = cell.summary["services"]["supervisor"]["scheduling"].as_str();
        let _ = write!(
            text,
            "<tr><td class=\"n\"><a href=\"#{name}\">{}</a></td><td>{}</td><td>{}</td>",
            cell.spec.rate_hz,
            escaped(&cell.spec.load.name()),
            escaped(scheduling.unwrap_or("?")),
        );
        for value in [
            cell.cycles.len().to_string(),
            cell.folded().to_string(),
            us(whole.p50_ns),
            percentile(0.99, whole.n, us(whole.p99_ns)),
            percentile(0.999, whole.n, us(whole.p999_ns)),
            us(whole.max_ns),
            us(compute.p50_ns),
            us(hand.p50_ns),
            percentile(0.99, hand.n, us(hand.p99_ns)),
            us(floor.p50_ns),
            percentile(0.99, floor.n, us(floor.p99_ns)),
            format!("{p50:.2}"),
            percentile(0.99, hand.n.min(floor.n), format!("{p99:.2}")),
            ours.to_string(),
            machine.to_string(),
            cell.not_one_stall().to_string(),
            cell.canary_late_ppm
                .map_or_else(|| "-".into(), |ppm| format!("{ppm:.0}")),
            cell.machine_over_canary()
                .map_or_else(|| "-".into(), |times| format!("{times:.2}")),
            cell.own_by_stage(),
        ] {
            let _ = write!(text, "<td class=\"n\">{value}</td>");
        }
        text.push_str("</tr>\n");
    }
    text.push_str("</tbody></table></div>\n");
    text
}

fn one(cell: &Cell, name: &str) -> Result<String, ChartError> {
    let names = [
        (WHOLE, "end to end", false),
        (HAND_OVER, "hand-over", false),
        (FLOOR, "floor's hand-over", true),
        (COMPUTE, "compute", false),
    ];
    let misses = [
        (WHOLE, "median and largest of each moment", false),
        (FLOOR, "floor, median end to end", true),
        (INK, "deadline", true),
        (OURS, "missed, Vigil's own", false),
        (MACHINE, "missed, the machine's", false),
    ];
    let charts = beside(&[
        format!(
            "<h3>Percentiles</h3>\n{}{}",
            key(&names),
            spectrum(cell)?.svg()?
        ),
        format!(
            "<h3>Histogram</h3>\n{}{}",
            key(&names),
            histogram(cell).svg()?
        ),
    ]);
    let time = format!(
        "<h3>Over time</h3>\n{}{}",
        key(&misses),
        over_time(cell).svg()?
    );
    let document = cell.json();
    let of = |value: &Value| match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let facts = [
        "load_arguments",
        "deadline_us",
        "missed",
        "missed_without_one_long_stall",
        "whole_run",
        "parts",
        "folded",
        "seed",
        "over_floor",
        "system",
        "stages",
        "canaries",
        "config_hash",
        "release_build",
        "particles",
    ];
    let facts = rows(facts.iter().map(|name| (*name, of(&document[name]))));
    let details = format!("<details><summary>All figures</summary>\n{facts}</details>\n");
    Ok(section(
        name,
        name,
        &misses_in_words(cell),
        &format!("{charts}{time}{details}"),
    ))
}

fn misses_in_words(cell: &Cell) -> String {
    let (ours, machine) = cell.missed();
    let nobody = if cell.is_attributed {
        ""
    } else {
        " No canary could be placed above the graph: every miss counts as Vigil's own."
    };
    format!(
        "{} cycles; {ours} missed by Vigil itself (a rate below {:.2e} with 95 % confidence if \
         none), {machine} by the machine.{nobody}{}",
        cell.cycles.len(),
        3.0 / cell.cycles.len().max(1) as f64,
        limit_in_words(cell),
    )
}

/// Which part of the cycles that Vigil missed itself is longer than usual.
fn limit_in_words(cell: &Cell) -> String {
    let parts = parts::of(cell);
    let excess = |part: &Part| part.own_misses_p50_us - part.p50_us;
    let longest = parts.iter().max_by(|a, b| excess(a).total_cmp(&excess(b)));
    let longest = longest.filter(|part| part.own_misses > 0);
    longest.map_or_else(String::new, |part| {
        format!(
            " Of its own misses {} have an answer of their own; in these the {} of {} stands out: \
             {:.0} us at the median, {:.0} us in all cycles.",
            part.own_misses, part.what, part.stage, part.own_misses_p50_us, part.p50_us,
        )
    })
}

/// Latency in us on a logarithmic axis.
fn log_us(title: &'static str, max_us: f64) -> Axis {
    let last = TICKS_US
        .iter()
        .position(|t| *t >= max_us)
        .unwrap_or(TICKS_US.len() - 1);
    Axis::placed(title, &TICKS_US[..=last.max(2)], |us| us.log10())
}

fn place(ns: u64) -> f64 {
    (ns as f64 * 1e-3).max(1.0).log10()
}

/// The largest of the four spectra, us.
fn largest_us(cell: &Cell) -> f64 {
    let largest = [&cell.graph.end_to_end, &cell.floor.hand_over]
        .map(|latency| latency.percentiles().max_ns)
        .into_iter()
        .max();
    largest.unwrap_or(0) as f64 * 1e-3
}

fn curves(cell: &Cell) -> [(&Latency, usize, Stroke); 4] {
    [
        (&cell.graph.end_to_end, WHOLE, Stroke::Solid),
        (&cell.graph.hand_over, HAND_OVER, Stroke::Solid),
        (&cell.floor.hand_over, FLOOR, Stroke::Dashed),
        (&cell.graph.compute, COMPUTE, Stroke::Solid),
    ]
}

fn spectrum(cell: &Cell) -> Result<Chart, ChartError> {
    let nines = |quantile: f64| -(1.0 - quantile).max(1e-9).log10();
    let last = nines(1.0 - 1.0 / cell.cycles.len().max(10) as f64);
    let line = |(latency, colour, stroke): (&Latency, usize, Stroke)| {
        let values = latency.histogram().iter_quantiles(8);
        let points = values.filter(|v| v.quantile_iterated_to() < 1.0).map(|v| {
            (
                nines(v.quantile_iterated_to()),
                place(v.value_iterated_to()),
            )
        });
        let points = points.filter(|(x, _)| *x <= last).collect();
        Curve {
            colour,
            stroke,
            points,
        }
    };
    let shown = [0.0, 0.5, 0.9, 0.99, 0.999, 0.9999, 0.99999, 0.999_999];
    let shown: Vec<f64> = shown
        .into_iter()
        .filter(|q| nines(*q) <= last + 0.01)
        .collect();
    let mut x = Axis::placed("percentile", &shown, nines);
    for (tick, quantile) in x.ticks.iter_mut().zip(&shown) {
        tick.1 = format!("{} %", (quantile * 1e6).round() / 1e4);
    }
    x.range[1] = last;
    Ok(Chart {
        caption: format!("{}: latency by percentile", cell.spec.name()),
        size: (900, 620),
        x,
        y: log_us("us", largest_us(cell)),
        curves: curves(cell).map(line).into(),
    })
}

fn histogram(cell: &Cell) -> Chart {
    let line = |(latency, colour, stroke): (&Latency, usize, Stroke)| {
        // Twenty bins a decade.
        let bins = latency.histogram().iter_log(1000, 10.0_f64.powf(0.05));
        let points = bins
            .filter(|bin| bin.count_since_last_iteration() > 0)
            .map(|bin| {
                let count = bin.count_since_last_iteration() as f64;
                (place(bin.value_iterated_to()), count.log10())
            });
        Curve {
            colour,
            stroke,
            points: points.collect(),
        }
    };
    let most = (cell.cycles.len().max(10) as f64).log10().ceil() as i32;
    let counts: Vec<f64> = (0..=most).map(|n| 10.0_f64.powi(n)).collect();
    Chart {
        caption: format!("{}: how often each latency occurs", cell.spec.name()),
        size: (900, 620),
        x: log_us("us", largest_us(cell)),
        y: Axis::placed("cycles", &counts, |n| n.log10()),
        curves: curves(cell).map(line).into(),
    }
}

fn over_time(cell: &Cell) -> Chart {
    let start_ns = cell.cycles.first().map_or(0, |c| c.t_schedule_ns);
    let s = |ns: u64| (ns.saturating_sub(start_ns)) as f64 * 1e-9;
    let end_s = cell.cycles.last().map_or(1.0, |c| s(c.t_schedule_ns));
    let (mut median, mut largest) = (Vec::new(), Vec::new());
    let each = (cell.cycles.len() as u64).div_ceil(MOMENTS).max(1) as usize;
    for moment in cell.cycles.chunks(each) {
        let mut latencies: Vec<u64> = moment.iter().map(|c| c.end_to_end_ns()).collect();
        latencies.sort_unstable();
        let x = s(moment[0].t_schedule_ns);
        median.push((x, place(latencies[latencies.len() / 2])));
        largest.push((x, place(latencies[latencies.len() - 1])));
    }
    let missed = |of_machine: bool| {
        let of = cell.misses.iter();
        let mut of: Vec<_> = of.filter(|m| m.is_machine == of_machine).collect();
        of.sort_by_key(|miss| std::cmp::Reverse(miss.overrun_ns));
        let shown = of.iter().take(DOTS);
        let dot = |m: &&Miss| (s(m.t_schedule_ns), place(m.t_done_ns - m.t_schedule_ns));
        shown.map(dot).collect()
    };
    let flat = |ns: u64| vec![(0.0, place(ns)), (end_s, place(ns))];
    let curve = |colour, stroke, points| Curve {
        colour,
        stroke,
        points,
    };
    Chart {
        caption: format!("{}: latency over time", cell.spec.name()),
        size: (1840, 520),
        x: Axis::linear("s", end_s, 10.0),
        y: log_us("us", largest_us(cell)),
        curves: vec![
            curve(WHOLE, Stroke::Thin, largest),
            curve(WHOLE, Stroke::Solid, median),
            curve(
                FLOOR,
                Stroke::Dashed,
                flat(cell.floor.end_to_end.percentiles().p50_ns),
            ),
            curve(INK, Stroke::Dashed, flat(cell.deadline_ns)),
            curve(MACHINE, Stroke::Dots, missed(true)),
            curve(OURS, Stroke::Dots, missed(false)),
        ],
    }
}

/// Names and values below each other.
fn rows<'a>(facts: impl Iterator<Item = (&'a str, String)>) -> String {
    let row = |(name, value): (&str, String)| {
        format!(
            "<tr><th>{}</th><td><code>{}</code></td></tr>\n",
            escaped(name),
            escaped(&value)
        )
    };
    format!(
        "<table><tbody>\n{}</tbody></table>\n",
        facts.map(row).collect::<String>()
    )
}
