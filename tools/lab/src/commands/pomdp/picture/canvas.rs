//! Colours of pictures, in middle tones that are readable on light and dark, and their legend.

use vigil_pages::svg::{Anchor, Drawing, Pen, Point};

/// Text and axes: contrast 4.5 to white as to black.
pub const INK: &str = "#767676";
/// A thin line of an axis.
pub const AXIS: Pen<'_> = Pen {
    colour: INK,
    width: 1.0,
    is_dashed: false,
};
/// Of states or actions, by index, again and again.
const COLOURS: [&str; 10] = [
    "#2f855a", "#3b82c4", "#d2691e", "#9467bd", "#c8464b", "#1f96a5", "#aa7d28", "#c85f9b",
    "#788732", "#6e73aa",
];

/// Colour of the `index`-th of something.
pub const fn colour(index: usize) -> &'static str {
    COLOURS[index % COLOURS.len()]
}

/// Names with their colours, one below the other.
pub fn legend(drawing: &mut Drawing, names: &[(usize, &str)], (x, y): Point) {
    for (row, (index, name)) in names.iter().enumerate() {
        let y = y + 24.0 * row as f64;
        drawing.rectangle((x, y - 8.0), (x + 16.0, y + 8.0), colour(*index), 0.8);
        drawing.text(name, (x + 24.0, y), 16, Anchor::Start);
    }
}
