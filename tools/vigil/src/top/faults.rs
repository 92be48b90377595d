//! The faults, each with why below it.

use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::palette::Palette;
use crate::clipped::clipped;
use crate::faults::document::NamedFault;
use crate::faults::table::{ago, why};
use crate::status::Document;

/// The faults in at most so many lines.
pub fn lines(
    document: &Document,
    rows: usize,
    width: usize,
    palette: Palette,
) -> Vec<Line<'static>> {
    let faults = document.faults_in_order();
    if faults.is_empty() {
        let style = match document.unknown_because {
            Some(_) => palette.past(),
            None => palette.healthy(),
        };
        return vec![Line::from(vec![
            Span::styled("faults    ", palette.title()),
            Span::styled("no faults", style),
        ])];
    }
    let mut lines = Vec::new();
    for fault in &faults {
        let title = if lines.is_empty() {
            "faults    "
        } else {
            "          "
        };
        lines.push(line(fault, title, palette));
        let why = why(fault);
        if !why.is_empty() && fault.state != "cleared" {
            lines.push(Line::raw(clipped(&format!("            {why}"), width)));
        }
    }
    if lines.len() > rows || document.faults_dropped > 0 {
        lines.truncate(rows.saturating_sub(1));
        let more = "          more of them: `vigil faults` lists all";
        lines.push(Line::styled(more, palette.past()));
    }
    lines
}

fn line(fault: &NamedFault, title: &'static str, palette: Palette) -> Line<'static> {
    let Look { sign, style } = look(fault, palette);
    let NamedFault { name, state, p, .. } = fault;
    let since = ago(fault.lasts_s());
    let times = match fault.count {
        1 => "once".to_owned(),
        count => format!("{count} times"),
    };
    let action = &fault.action;
    Line::from(vec![
        Span::styled(title, palette.title()),
        Span::styled(format!("{sign} {name:<12} {}", state.to_uppercase()), style),
        Span::raw(format!("  for {since}  {times}  p {p:.3}  {action}")),
    ])
}

/// How a fault is marked.
struct Look {
    sign: char,
    style: Style,
}

fn look(fault: &NamedFault, palette: Palette) -> Look {
    let is_warning = fault.severity == "warning";
    let (sign, style) = match fault.state {
        "active" if is_warning => ('!', palette.warning()),
        "active" => ('!', palette.wrong()),
        "latched" => ('*', palette.warning()),
        "acknowledged" => ('+', palette.warning()),
        "pending" => ('?', palette.neutral()),
        _ => ('-', palette.past()),
    };
    Look { sign, style }
}
