//! Axes of pictures, in a middle tone that is readable on light and dark, and their legend.

use vigil_pages::colour::middle as colour;
use vigil_pages::svg::{Anchor, Dash, Drawing, Pen, Point};

/// Text and axes: contrast 4.5 to white as to black.
pub const INK: &str = "#767676";
/// A thin line of an axis.
pub const AXIS: Pen<'_> = Pen {
    colour: INK,
    width: 1.0,
    dash: Dash::None,
};
/// Names with their colours, one below the other.
pub fn legend(drawing: &mut Drawing, names: &[(usize, &str)], (x, y): Point) {
    for (row, (index, name)) in names.iter().enumerate() {
        let y = y + 24.0 * row as f64;
        drawing.rectangle((x, y - 8.0), (x + 16.0, y + 8.0), colour(*index), 0.8);
        drawing.text(name, (x + 24.0, y), 16, Anchor::Start);
    }
}
