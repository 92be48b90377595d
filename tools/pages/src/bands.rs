//! What lasts from one instant to another, row by row over a common axis of time.

use crate::chart::{Axis, LETTER, sides};
use crate::colour::Colour;
use crate::svg::{Anchor, Dash, Drawing, Pen};

/// Height of a row: its name, and its bars below.
const ROW: f64 = 72.0;
const BAR: f64 = 28.0;
/// Width of a letter within a bar.
const LETTER_WIDTH: f64 = 10.5;
const IN_BAR: i32 = 19;

/// Something that lasts.
#[derive(Debug, Clone, PartialEq)]
pub struct Bar {
    /// From when to when, in the axis' unit.
    pub span: [f64; 2],
    /// In which colour.
    pub colour: Colour,
    /// How much of it shows, 0 to 1.
    pub opacity: f64,
    /// What it is, written in it or after it where there is room.
    pub text: String,
}

/// What stands in one row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Row {
    /// Its name.
    pub name: String,
    /// What lasts, in the order of time.
    pub bars: Vec<Bar>,
    /// Instants, each with its colour.
    pub ticks: Vec<(f64, Colour)>,
}

/// Rows below each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Bands {
    /// Said to those who cannot see it.
    pub caption: String,
    /// Width, as a chart's.
    pub width: u32,
    /// The axis below all rows.
    pub x: Axis,
    /// The rows.
    pub rows: Vec<Row>,
}

impl Bands {
    /// The rows as an SVG element, aligned with charts of the same width whose y axis has a title.
    #[must_use]
    pub fn svg(&self) -> String {
        let mut drawing = Drawing::new("currentColor");
        let letter = f64::from(LETTER);
        let [left, right] = sides(self.width, true);
        let bottom = ROW * self.rows.len() as f64 + 6.0;
        let place = |value: f64| left + self.x.share_of(value) * (right - left);
        let grid = Pen {
            colour: "var(--grid)",
            width: 1.0,
            dash: Dash::None,
        };
        for (value, label) in &self.x.ticks {
            let x = place(*value);
            drawing.line(&[(x, 0.0), (x, bottom)], grid);
            drawing.text(label, (x, bottom + letter), LETTER, Anchor::Middle);
        }
        drawing.line(
            &[(left, bottom), (right, bottom)],
            Pen { width: 2.0, ..grid },
        );
        let middle = 0.5 * (left + right);
        let below = (middle, bottom + 2.0 * letter + 6.0);
        drawing.text(self.x.title, below, LETTER, Anchor::Middle);
        for (at, row) in self.rows.iter().enumerate() {
            let top = ROW * at as f64;
            drawing.text(&row.name, (left, top + 0.7 * letter), LETTER, Anchor::Start);
            row.draw(top + 1.3 * letter, &place, &mut drawing);
        }
        let height = bottom + 2.5 * letter + 12.0;
        drawing.element(self.width, height as u32, &self.caption)
    }
}

impl Row {
    fn draw(&self, top: f64, place: &impl Fn(f64) -> f64, drawing: &mut Drawing) {
        let bottom = top + BAR;
        for (at, bar) in self.bars.iter().enumerate() {
            let colour = bar.colour.css();
            let [from, to] = bar.span.map(place);
            let to = to.max(from + 2.0);
            drawing.rectangle((from, top), (to, bottom), &colour, bar.opacity);
            let edge = Pen {
                colour: &colour,
                width: 2.0,
                dash: Dash::None,
            };
            let outline = [
                (from, top),
                (to, top),
                (to, bottom),
                (from, bottom),
                (from, top),
            ];
            drawing.line(&outline, edge);
            let needed = LETTER_WIDTH * bar.text.chars().count() as f64 + 12.0;
            let next = self
                .bars
                .get(at + 1)
                .map_or(place(f64::MAX), |next| place(next.span[0]));
            let begin = match () {
                () if needed < to - from => from + 6.0,
                () if needed < next - to => to + 6.0,
                () => continue,
            };
            drawing.text(&bar.text, (begin, top + 0.5 * BAR), IN_BAR, Anchor::Start);
        }
        for (at, colour) in &self.ticks {
            let pen = Pen {
                colour: &colour.css(),
                width: 3.0,
                dash: Dash::None,
            };
            let x = place(*at);
            drawing.line(&[(x, top), (x, bottom)], pen);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_stands_in_its_bar_or_after_it_or_nowhere() {
        let bar = |span: [f64; 2]| Bar {
            span,
            colour: Colour::Fault(1),
            opacity: 0.4,
            text: "RM_STUCK".into(),
        };
        let drawn = |bars: &[[f64; 2]]| {
            let bands = Bands {
                caption: "a".into(),
                width: 1200,
                x: Axis::linear("time, s", 10.0, 5.0),
                rows: vec![Row {
                    name: "faults".into(),
                    bars: bars.iter().map(|span| bar(*span)).collect(),
                    ticks: vec![(3.0, Colour::Alarm)],
                }],
            };
            bands.svg()
        };
        assert_eq!(drawn(&[[0.0, 9.0]]).matches("RM_STUCK").count(), 1);
        assert_eq!(drawn(&[[0.0, 0.1]]).matches("RM_STUCK").count(), 1);
        assert_eq!(
            drawn(&[[0.0, 0.1], [0.2, 0.3]]).matches("RM_STUCK").count(),
            1
        );
        assert!(!drawn(&[[f64::NAN, f64::INFINITY]]).contains("NaN"));
    }
}
