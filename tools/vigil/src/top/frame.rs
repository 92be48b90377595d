//! A picture of a graph: which lines stand where.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::Line;

use super::scene::Scene;
use super::{belief, events, faults, head, help, services};

/// Lines of the beliefs at least: detector, most probable leaf, unknown, nominal.
const BELIEF_MIN: usize = 4;
/// .. and at most.
const BELIEF_MAX: usize = 14;
/// Lines of the events at least.
const EVENTS_MIN: usize = 4;
/// The picture that is printed as text.
const PRINTED: Rect = Rect::new(0, 0, 80, 24);

/// Draws the picture into an area.
pub fn draw(scene: &Scene<'_>, area: Rect, buffer: &mut Buffer) {
    let width = area.width as usize;
    let head = head::lines(scene.document, width, scene.palette);
    let rest = lines(
        scene,
        area.height as usize - head.len().min(area.height as usize),
        width,
    );
    let head_rows = head.len() as u16;
    let lines = head.iter().chain(&rest);
    for (row, line) in (area.y..area.bottom()).zip(lines) {
        buffer.set_line(area.x, row, line, area.width);
    }
    if scene.document.is_past() {
        let below = Rect {
            y: area.y + head_rows.min(area.height),
            height: area.height.saturating_sub(head_rows),
            ..area
        };
        buffer.set_style(below, scene.palette.past());
    }
    if scene.has_help {
        help::draw(area, buffer, scene.palette);
    }
}

/// The lines below the head.
fn lines(scene: &Scene<'_>, rows: usize, width: usize) -> Vec<Line<'static>> {
    let (document, palette) = (scene.document, scene.palette);
    let decision = document.decision.as_ref();
    let decision = decision.map(|it| belief::decision(it, width, palette));
    let decision = decision.unwrap_or_default();
    let services = services::lines(scene, width);
    let flow = services::flow(document, width, palette);
    let spare = rows.saturating_sub(decision.len() + services.len() + flow.len());
    let for_faults = spare.saturating_sub(BELIEF_MIN + EVENTS_MIN).max(1);
    let mut lines = faults::lines(document, for_faults, width, palette);
    let spare = spare.saturating_sub(lines.len());
    // What both can do without is shared.
    let more = spare.saturating_sub(BELIEF_MIN + EVENTS_MIN) / 2;
    let for_belief = (BELIEF_MIN + more).min(BELIEF_MAX).min(spare);
    let beliefs = belief::lines(scene, for_belief, width);
    let for_events = spare.saturating_sub(beliefs.len());
    lines.extend(beliefs);
    lines.extend(decision);
    lines.extend(services);
    lines.extend(flow);
    lines.extend(events::lines(scene, for_events, width));
    lines
}

/// The picture as text.
pub fn text(scene: &Scene<'_>) -> String {
    let mut buffer = Buffer::empty(PRINTED);
    draw(scene, PRINTED, &mut buffer);
    let row = |y: u16| {
        let cells = (0..PRINTED.width).map(|x| buffer[(x, y)].symbol());
        cells.collect::<String>().trim_end().to_owned()
    };
    let rows: Vec<String> = (0..PRINTED.height).map(row).collect();
    rows.join("\n").trim_end().to_owned()
}
