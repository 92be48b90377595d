//! The services, how long actions take, and the input.

use ratatui::text::{Line, Span};

use super::chart::curve;
use super::palette::Palette;
use super::scene::Scene;
use crate::clipped::clipped;
use crate::status::{Document, Service, percent_text};

/// Columns before the curve.
const BEFORE: usize = 71;

/// A line of titles, and one for each service.
pub fn lines(scene: &Scene<'_>, width: usize) -> Vec<Line<'static>> {
    let palette = scene.palette;
    let columns = width.saturating_sub(BEFORE).min(60);
    let titles = format!(
        "{:<11}{:<9}{:>5}{:>6}{:>7}{:>7}{:>5} {:<8} {:<11}{}",
        "services", "", "us", "worst", "budget", "missed", "over", "lo/la/re", "core", "us, 60 s"
    );
    let mut lines = vec![Line::styled(clipped(&titles, width), palette.title())];
    for service in &scene.document.services {
        let mut line = line(service, palette);
        if let Some(history) = scene.history(service.name) {
            let values = history.columns(columns, scene.now_ns);
            let full = history.largest().unwrap_or(1.0);
            line.push_span(Span::styled(curve(&values, full), palette.neutral()));
        }
        lines.push(line);
    }
    lines
}

fn line(service: &Service, palette: Palette) -> Line<'static> {
    let (name, is_well) = (service.name, service.is_well());
    let (state, style) = match is_well {
        true => (service.state.to_owned(), palette.healthy()),
        false => (service.state.to_uppercase(), palette.wrong()),
    };
    let mut spans = vec![
        Span::raw(format!("{name:<11}")),
        Span::styled(format!("{state:<9}"), style),
    ];
    if let Some(of) = &service.health {
        let (last, worst, budget) = (of.cycle_us_last, of.cycle_us_max, of.budget_us);
        let refused = format!("{}/{}/{}", of.lost, of.late, of.rejected);
        let place = format!("{} {}", of.core, of.scheduling);
        let style = match of.missed + of.over_budget + of.lost + of.late + of.rejected {
            0 => palette.healthy(),
            _ => palette.warning(),
        };
        spans.push(Span::raw(format!("{last:>5.0}{worst:>6.0}{budget:>7.0}")));
        spans.push(Span::styled(
            format!("{:>7}{:>5} {refused:<8} ", of.missed, of.over_budget),
            style,
        ));
        spans.push(Span::raw(format!("{place:<11}")));
    }
    Line::from(spans)
}

/// How long actions take, and what of the frames can be used.
pub fn flow(document: &Document, width: usize, palette: Palette) -> Vec<Line<'static>> {
    let times = document.end_to_end.as_ref().map(percent_text);
    let times = times.unwrap_or_else(|| "no actions".to_owned());
    let (input, style) = match &document.input {
        None => ("NO FRAMES".to_owned(), palette.wrong()),
        Some(input) if input.is_wrong() => (input.text(), palette.wrong()),
        Some(input) => (input.text(), palette.healthy()),
    };
    let room = width.saturating_sub(10);
    vec![
        Line::from(vec![
            Span::styled("time      ", palette.title()),
            Span::raw(clipped(&times, room)),
        ]),
        Line::from(vec![
            Span::styled("input     ", palette.title()),
            Span::styled(clipped(&input, room), style),
        ]),
    ]
}
