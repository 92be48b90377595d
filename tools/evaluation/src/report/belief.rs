//! What was believed over time, run by run.

use super::{Report, words};
use crate::scoring::{Case, Taxonomy, UNKNOWN, Verdict};
use vigil_pages::chart::{Axis, Chart, Curve, Stroke};
use vigil_pages::colour::Colour;
use vigil_pages::page::{KeyEntry, Section, beside, escaped, key};

/// Modes drawn of a run.
const MODES: usize = 5;
/// A mode that never gets more is not drawn, unless it is true.
const P_LEAST: f64 = 0.1;
/// A change of less than this is not drawn.
const P_STEP: f64 = 0.02;
/// Bytes that these charts may take; further runs are named only.
const BYTES_MAX: usize = 7_000_000;
const SIZE: (u32, u32) = (900, 270);

/// A mode: where its probability stands in a verdict.
#[derive(Clone, Copy, PartialEq)]
enum Explanation {
    Node(usize),
    Unknown,
}

impl Explanation {
    fn p(self, verdict: &Verdict) -> f64 {
        match self {
            Self::Node(i) => verdict.p_nodes.get(i).copied().unwrap_or(0.0),
            Self::Unknown => verdict.p_unknown,
        }
    }

    const fn colour(self) -> Colour {
        match self {
            Self::Node(i) => Colour::node(i),
            Self::Unknown => Colour::Unknown,
        }
    }
}

/// A mode to draw.
struct Mode<'a> {
    of: Explanation,
    name: &'a str,
    is_true: bool,
}

impl Mode<'_> {
    fn key(&self) -> KeyEntry {
        let mark = if self.is_true { " (true)" } else { "" };
        let colour = self.of.colour();
        KeyEntry {
            colour,
            stroke: colour.stroke(),
            name: format!("{}{mark}", self.name),
        }
    }
}

/// The true mode first, then the others that reached most.
fn leading<'a>(case: &Case, taxonomy: &'a Taxonomy) -> Vec<Mode<'a>> {
    let nodes = taxonomy
        .leaf_names()
        .map(|(i, name)| (Explanation::Node(i), name));
    let all = nodes.chain([(Explanation::Unknown, UNKNOWN)]);
    let highest = |of: Explanation| case.verdicts.iter().map(|v| of.p(v)).fold(0.0, f64::max);
    // Of a run without a label nothing is known to be true.
    let label = Some(case.label.mode.as_str()).filter(|mode| !mode.is_empty());
    let expected = label.map(|mode| taxonomy.expected(mode));
    let mut found: Vec<(f64, Explanation, &str)> = all
        .map(|(of, name)| match expected == Some(name) {
            true => (f64::INFINITY, of, name),
            false => (highest(of), of, name),
        })
        .filter(|mode| mode.0 >= P_LEAST)
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(MODES);
    let modes = found.into_iter().map(|(highest, of, name)| Mode {
        of,
        name,
        is_true: highest.is_infinite(),
    });
    modes.collect()
}

/// Points of a curve without those that change nothing to the eye.
fn thinned(case: &Case, of: Explanation) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    let mut last: Option<(f64, f64)> = None;
    for verdict in &case.verdicts {
        let now = (verdict.t_s, of.p(verdict));
        let before = kept.last().copied();
        if before.is_none_or(|before| (before.1 - now.1).abs() > P_STEP) {
            // Level until the frame before.
            kept.extend(last.filter(|last| before.is_some_and(|kept| kept.0 < last.0)));
            kept.push(now);
        }
        last = Some(now);
    }
    kept.extend(last.filter(|last| kept.last() != Some(last)));
    kept
}

fn chart(case: &Case, taxonomy: &Taxonomy, set: &str) -> String {
    let modes = leading(case, taxonomy);
    let end_s = case.verdicts.last().map_or(1.0, |last| last.t_s);
    let mut curves = Vec::new();
    if let Some(onset_s) = case.label.onset_s {
        curves.push(Curve {
            colour: Colour::Ink,
            stroke: Stroke::Dashed,
            points: vec![(onset_s, 0.0), (onset_s, 1.0)],
        });
    }
    // The true mode lies on top.
    curves.extend(modes.iter().rev().map(|mode| Curve {
        colour: mode.of.colour(),
        stroke: mode.of.colour().stroke(),
        points: thinned(case, mode.of),
    }));
    let chart = Chart {
        caption: format!("Belief over time, run {}, {set}", case.label.run),
        size: SIZE,
        x: Axis::linear("", end_s, 6.0),
        y: Axis {
            ticks: [0.0, 0.5, 1.0].map(|p: f64| (p, p.to_string())).to_vec(),
            ..Axis::share("")
        },
        curves,
        ..Chart::default()
    };
    let names: Vec<_> = modes.iter().map(Mode::key).collect();
    format!("{}{}\n", key(&names), chart.svg())
}

/// The same run in all sets.
fn run(report: &Report<'_>, i: usize) -> String {
    let mut parts = Vec::new();
    let mut heading = String::new();
    for set in &report.sets {
        let Some(case) = set.cases.get(i) else {
            continue;
        };
        let label = &case.label;
        heading = match label.onset_s {
            Some(s) => format!(
                "run {}: {} ({}), onset {s:.2} s",
                label.run, label.mode, label.kind
            ),
            None => format!("run {}: nominal", label.run),
        };
        parts.push(format!(
            "<span class=\"soft\">{}</span>\n{}",
            escaped(words(set.name)),
            chart(case, report.taxonomy, set.name)
        ));
    }
    let (heading, charts) = (escaped(&heading), beside(&parts));
    format!("<div class=\"run\"><h3>{heading}</h3>\n{charts}</div>\n")
}

/// When the alarm, the reported name or the action changed in a run, as a table.
fn changes(case: &Case) -> String {
    let said = |verdict: &Verdict| {
        let alarm = if verdict.alarm { "alarm" } else { "" };
        [alarm, &verdict.reported, &verdict.action].map(escaped)
    };
    let mut rows = String::new();
    let mut last = None;
    for verdict in &case.verdicts {
        let now = said(verdict);
        if last.as_ref() != Some(&now) {
            let (t_s, cells) = (verdict.t_s, now.join("</td><td>"));
            rows.push_str(&format!("<tr><td>{t_s:.2}</td><td>{cells}</td></tr>\n"));
            last = Some(now);
        }
    }
    format!(
        "<table><thead><tr><th>s</th><th>alarm</th><th>reported</th><th>action</th></tr></thead>\n\
         <tbody>\n{rows}</tbody></table>\n"
    )
}

/// Runs without labels: what was believed in each, and what changed.
pub fn unlabelled(cases: &[Case], set: &str, taxonomy: &Taxonomy) -> Section {
    let run = |case: &Case| {
        let (id, changes) = (case.label.run, changes(case));
        let chart = chart(case, taxonomy, set);
        format!("<div class=\"run\"><h3>run {id}</h3>\n{chart}{changes}</div>\n")
    };
    let (mut inside, mut left_out) = (String::new(), Vec::new());
    for case in cases {
        if inside.len() < BYTES_MAX {
            inside.push_str(&run(case));
        } else {
            left_out.push(case.label.run.to_string());
        }
    }
    inside.push_str(&not_drawn(&left_out));
    let about = "Probability of the leading modes over time, s; before an alarm, of nominal \
                 driving and unknown. Below it, each change of the alarm, the reported name and \
                 the action.";
    Section {
        id: "belief",
        heading: "Runs",
        about: about.to_owned(),
        inside,
    }
}

/// True if anything was wrong about the run: a false alarm, a fault missed, a wrong leaf after 2 s.
fn is_wrong(report: &Report<'_>, i: usize) -> bool {
    report.sets.iter().any(|set| {
        let id = set.cases.get(i).map(|case| case.label.run);
        let has = |ids: &[u32]| id.is_some_and(|id| ids.contains(&id));
        let score = set.score;
        let missed = score
            .detection
            .get("all")
            .map(|found| &found.missed_run_ids);
        let named = score.identification.get("all");
        has(&score.false_alarms.run_ids)
            || missed.is_some_and(|ids| has(ids))
            || named.is_some_and(|found| has(&found.wrong_run_ids_after_2_s))
    })
}

/// A line that names the runs beyond [`BYTES_MAX`]; nothing if there are none.
fn not_drawn(runs: &[String]) -> String {
    if runs.is_empty() {
        return String::new();
    }
    let list = escaped(&runs.join(", "));
    format!("<p class=\"soft\">Not drawn, to keep the file small: runs {list}.</p>\n")
}

/// All runs, the wrong ones first.
pub fn section(report: &Report<'_>) -> Section {
    let count = report.sets.first().map_or(0, |set| set.cases.len());
    let (wrong, right): (Vec<usize>, Vec<usize>) = (0..count).partition(|i| is_wrong(report, *i));
    let (mut inside, mut left_out) = (String::new(), Vec::new());
    for (name, runs) in [("Something was wrong", wrong), ("All was right", right)] {
        let total = runs.len();
        inside.push_str(&format!(
            "<details><summary>{name}: {total} runs</summary>\n"
        ));
        for i in runs {
            if inside.len() < BYTES_MAX {
                inside.push_str(&run(report, i));
            } else {
                let case = report.sets.first().and_then(|set| set.cases.get(i));
                left_out.extend(case.map(|case| case.label.run.to_string()));
            }
        }
        inside.push_str("</details>\n");
    }
    inside.push_str(&not_drawn(&left_out));
    let about = "Probability of the leading modes over time, s; before an alarm, of nominal \
                 driving and unknown. The first name is the true one; the broken line is the \
                 onset. First the runs with a false alarm, a missed fault or a wrong leaf 2 s \
                 after the onset, with any of the channels.";
    Section {
        id: "belief",
        heading: "Belief over time",
        about: about.to_owned(),
        inside,
    }
}
