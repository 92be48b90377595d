//! The first lines: which graph, how it is, and why that is not known.

use ratatui::text::{Line, Span};
use vigil_timeline::time_of_day;

use super::palette::Palette;
use crate::clipped::clipped;
use crate::list::duration_text;
use crate::status::{Document, GraphState};

/// The first line, and a second one if there is more to say.
pub fn lines(document: &Document, width: usize, palette: Palette) -> Vec<Line<'static>> {
    let up = document.up_s.map_or("?".to_owned(), duration_text);
    let rate_hz = document.present_rate_hz();
    let state = document.state_text();
    let name = format!("vigil  {}  ", document.graph);
    let rest = format!("  {rate_hz:.1} Hz  up {up}");
    let clock = time_of_day(&document.wall);
    let clock = clock.split('.').next().unwrap_or_default().to_owned();
    let taken = [&name, &state, &rest, &clock].map(|text| text.chars().count());
    let gap = width.saturating_sub(taken.iter().sum());
    let first = Line::from(vec![
        Span::styled(name, palette.title()),
        Span::styled(state, palette.state(document.state)),
        Span::raw(rest),
        Span::raw(" ".repeat(gap)),
        Span::raw(clock),
    ]);
    let second = second(document).map(|text| {
        let style = palette.state(document.state);
        Line::styled(clipped(&text, width), style)
    });
    std::iter::once(first).chain(second).collect()
}

fn second(document: &Document) -> Option<String> {
    let because = document.unknown_because.as_deref();
    if document.state == GraphState::Ended {
        return Some("the graph has ended: joined again once it is started; q quits".to_owned());
    }
    let name = &document.graph;
    because
        .map(|because| format!("how the robot is, is not known: {because}"))
        .or_else(|| {
            let text = format!("no launcher: `vigil run --adopt --graph {name}` takes over");
            document.launcher.is_none().then_some(text)
        })
}
