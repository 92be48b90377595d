//! Beliefs as bars, with the last minute as curves; and the decision.

use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::chart::{bar, curve};
use super::palette::Palette;
use super::scene::Scene;
use crate::clipped::clipped;
use crate::status::{Decision, Diagnosis, NamedNode};
use crate::watch::History;

/// Columns before the bars: title, name and number.
const BEFORE: usize = 30;
/// Columns after the curves at least.
const AFTER: usize = 15;
/// What was never more probable within the last minute is not told; nearer ones are not told apart.
const P_TOLD: f64 = 0.01;

/// What is above the leaves is told if it is so much more probable than each of them.
const SAYS_MORE: f64 = 0.05;

/// A probability with its name.
struct Bar<'a> {
    name: &'a str,
    p: f64,
    history: Option<&'a History>,
    style: Style,
}

/// The beliefs in at most so many lines.
pub fn lines(scene: &Scene<'_>, rows: usize, width: usize) -> Vec<Line<'static>> {
    let (document, palette) = (scene.document, scene.palette);
    let mut lines = Vec::new();
    if let Some(detector) = &document.detector {
        let count = detector.alarm_count;
        let (style, text) = match (detector.alarm, detector.readiness) {
            _ if detector.is_silent => (palette.wrong(), "SILENT".to_owned()),
            (true, _) => (palette.wrong(), format!("ALARM ({count})")),
            (false, readiness) => (palette.healthy(), format!("{readiness} ({count})")),
        };
        let first = Bar {
            name: "p(fault)",
            p: detector.p_fault,
            history: Some(&scene.histories.p_fault),
            style,
        };
        let mut line = line(&first, "belief    ", scene, width);
        line.push_span(Span::styled(format!(" {text}"), style));
        lines.push(line);
    }
    if let Some(diagnosis) = &document.diagnosis {
        let several = diagnosis.several();
        let several = several.map(|text| format!("          together: {text}"));
        let room = rows.saturating_sub(lines.len() + usize::from(several.is_some()));
        let bars = bars(diagnosis, scene, room);
        let bars = bars.iter().map(|bar| line(bar, "          ", scene, width));
        lines.extend(bars);
        lines.extend(several.map(|text| Line::raw(clipped(&text, width))));
    }
    lines.truncate(rows);
    lines
}

/// The leaves that are, or were, most probable, and what is above them where no leaf is as
/// probable; then what is not known, then nominal.
fn bars<'a>(diagnosis: &'a Diagnosis, scene: &'a Scene<'_>, room: usize) -> Vec<Bar<'a>> {
    let (histories, palette) = (scene.histories, scene.palette);
    let leaves = diagnosis.nodes.iter().filter(|node| node.is_leaf);
    let best_p = leaves.map(|node| node.p).fold(0.0, f64::max);
    let is_drawn = |node: &&NamedNode| node.is_leaf || node.p > best_p + SAYS_MORE;
    let mut drawn: Vec<&NamedNode> = diagnosis.nodes.iter().filter(is_drawn).collect();
    drawn.sort_by_key(|node| node.at);
    let drawn = drawn.into_iter();
    let mut bars: Vec<Bar<'a>> = drawn
        .map(|node| Bar {
            name: &node.name,
            p: node.p,
            history: histories.nodes.get(node.at),
            style: palette.warning(),
        })
        .collect();
    let recent = |bar: &Bar<'_>| bar.history.and_then(History::largest).unwrap_or(bar.p);
    // By what can be seen, then by place, so that rows do not change places for nothing.
    let order = |bar: &Bar<'_>| [bar.p, recent(bar)].map(|p| (p / P_TOLD).round() as i64);
    bars.retain(|bar| recent(bar) >= P_TOLD);
    bars.sort_by_key(|bar| std::cmp::Reverse(order(bar)));
    bars.truncate(room.saturating_sub(2));
    bars.push(Bar {
        name: "UNKNOWN",
        p: diagnosis.p_unknown,
        history: Some(&histories.p_unknown),
        style: palette.neutral(),
    });
    bars.push(Bar {
        name: &diagnosis.nominal,
        p: diagnosis.p_nominal,
        history: histories.nodes.first(),
        style: palette.healthy(),
    });
    bars
}

fn line(of: &Bar<'_>, title: &'static str, scene: &Scene<'_>, width: usize) -> Line<'static> {
    let room = width.saturating_sub(BEFORE + AFTER);
    // The minute in whole seconds a column, as many columns as fit beside the bar.
    let fits = [60, 30, 20, 10];
    let columns = fits.into_iter().find(|columns| columns + 14 <= room);
    let columns = columns.unwrap_or(0);
    let bar_columns = room.saturating_sub(columns + 1).min(40);
    let history = of.history.map(|it| it.columns(columns, scene.now_ns));
    let history = history.unwrap_or_default();
    let name = clipped(of.name, 12);
    let p = of.p;
    Line::from(vec![
        Span::styled(title, scene.palette.title()),
        Span::raw(format!("{name:<12} {p:.3}  ")),
        Span::styled(bar(p, bar_columns), of.style),
        Span::styled(format!(" {}", curve(&history, 1.0)), of.style),
    ])
}

/// The decision in two lines.
pub fn decision(decision: &Decision, width: usize, palette: Palette) -> Vec<Line<'static>> {
    let why = decision.why();
    let action = decision.action_text();
    let style = match decision.has_expired {
        true => palette.wrong(),
        false => palette.title(),
    };
    let room = width.saturating_sub(12 + action.chars().count());
    vec![
        Line::from(vec![
            Span::styled("decision  ", palette.title()),
            Span::styled(action, style),
            Span::raw(format!("  {}", clipped(&why, room))),
        ]),
        Line::raw(clipped(
            &format!("          believed: {}", decision.states_text()),
            width,
        )),
    ]
}
