//! The newest events.

use ratatui::style::Style;
use ratatui::text::Line;
use vigil_timeline::TimelineEntry;

use super::palette::Palette;
use super::scene::Scene;
use crate::clipped::clipped;

/// A title and the newest events, the newest last, in at most so many lines.
pub fn lines(scene: &Scene<'_>, rows: usize, width: usize) -> Vec<Line<'static>> {
    let Some(room) = rows.checked_sub(1) else {
        return Vec::new();
    };
    let palette = scene.palette;
    let back = scene.scroll.min(scene.events.len().saturating_sub(room));
    let title = match back {
        0 => "events".to_owned(),
        back => format!("events, {back} newer below"),
    };
    let to = scene.events.len() - back;
    let told = &scene.events[to.saturating_sub(room)..to];
    let line = |entry: &TimelineEntry| {
        let text = clipped(&entry.line(), width);
        Line::styled(text, style(entry, palette))
    };
    let mut lines = vec![Line::styled(title, palette.title())];
    lines.extend(told.iter().map(line));
    lines
}

/// The word of the event says the same.
fn style(entry: &TimelineEntry, palette: Palette) -> Style {
    match entry.event.as_str() {
        "alarm" | "safe-stop" | "blind" | "input-lost" | "watchdog" => palette.wrong(),
        "assertion" | "miss" | "rejected" | "degraded" => palette.warning(),
        "cleared" | "input-back" | "blind-ends" | "safe-stop-ends" => palette.healthy(),
        _ => Style::new(),
    }
}
