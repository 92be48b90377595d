//! What keys do, and what words mean.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::palette::Palette;

const LINES: [&str; 18] = [
    " q, Esc, Ctrl-C    quit; the graph goes on                    ",
    " up, down, PgUp..  scroll the events; End: the newest         ",
    " ?, h              this help                                  ",
    "                                                              ",
    " p(fault)          the detector: something is wrong           ",
    " UNKNOWN           no known fault explains what is measured   ",
    " ND                no fault at all                            ",
    " nat               evidence: 2.3 nat is a factor of 10        ",
    " compensate        steers against a stuck wheel, and drives on",
    " worth             reward that the decision model expects     ",
    " us, worst         cycle time: the last, and the longest      ",
    " missed            cycles whose deadline passed               ",
    " over              cycles longer than their budget            ",
    " lo/la/re          input lost, late, rejected                 ",
    " time              from when a cycle was due to its action    ",
    " curves            the last 60 s, the largest of each column  ",
    " ! active  * over, not acknowledged  + acknowledged           ",
    " ? pending  - cleared                    `vigil ack` answers  ",
];

/// Draws it over the middle.
pub fn draw(area: Rect, buffer: &mut Buffer, palette: Palette) {
    let columns = LINES[0].chars().count() as u16;
    let left = area.x + area.width.saturating_sub(columns) / 2;
    let top = area.y + area.height.saturating_sub(LINES.len() as u16) / 2;
    let room = area.right().saturating_sub(left) as usize;
    for (row, line) in (top..area.bottom()).zip(LINES) {
        let here = Rect::new(left, row, columns, 1).intersection(area);
        buffer.set_style(here, ratatui::style::Style::reset());
        buffer.set_stringn(left, row, line, room, palette.title());
    }
}
