//! A drawing in pixels: transparent, in middle tones that are readable on light and dark alike.

use plotters::coord::Shift;
use plotters::element::{PathElement, Polygon, Rectangle, Text};
use plotters::prelude::{DrawingArea, IntoDrawingArea, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoFont, RGBColor};

/// Text and axes: contrast 4.5 to white as to black.
pub const INK: RGBColor = RGBColor(118, 118, 118);
/// Of states or actions, by index, again and again.
const COLOURS: [RGBColor; 10] = [
    RGBColor(47, 133, 90),
    RGBColor(59, 130, 196),
    RGBColor(210, 105, 30),
    RGBColor(148, 103, 189),
    RGBColor(200, 70, 75),
    RGBColor(31, 150, 165),
    RGBColor(170, 125, 40),
    RGBColor(200, 95, 155),
    RGBColor(120, 135, 50),
    RGBColor(110, 115, 170),
];

/// Colour of the `index`-th of something.
pub fn colour(index: usize) -> RGBColor {
    COLOURS[index % COLOURS.len()]
}

/// A point, pixels to the right and down.
pub type Point = (f64, f64);

/// Where a text lies at its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    Left,
    /// Its middle is there.
    Middle,
    /// It ends there.
    Right,
}

/// The drawing.
pub struct Canvas<'a> {
    root: DrawingArea<SVGBackend<'a>, Shift>,
    failure: Option<String>,
}

/// A drawing of so many pixels as an SVG.
///
/// # Errors
/// The drawing library's.
pub fn drawing(size: (u32, u32), draw: impl FnOnce(&mut Canvas<'_>)) -> Result<String, String> {
    let mut svg = String::new();
    let mut canvas = Canvas {
        root: SVGBackend::with_string(&mut svg, size).into_drawing_area(),
        failure: None,
    };
    draw(&mut canvas);
    let presented = canvas.root.present().map_err(|error| error.to_string());
    let failure = canvas.failure.take();
    drop(canvas);
    presented?;
    match failure {
        Some(failure) => Err(format!("cannot be drawn: {failure}")),
        None => Ok(svg),
    }
}

fn pixel((x, y): Point) -> (i32, i32) {
    (x.round() as i32, y.round() as i32)
}

impl Canvas<'_> {
    fn note<E: std::fmt::Display>(&mut self, result: Result<(), E>) {
        if let (Err(error), None) = (result, &self.failure) {
            self.failure = Some(error.to_string());
        }
    }

    /// A line through points.
    pub fn line(&mut self, points: &[Point], colour: RGBColor, width: u32) {
        let path: Vec<_> = points.iter().map(|p| pixel(*p)).collect();
        let result = self
            .root
            .draw(&PathElement::new(path, colour.stroke_width(width)));
        self.note(result);
    }

    /// A broken line.
    pub fn dashes(&mut self, points: &[Point], colour: RGBColor) {
        for pair in points.windows(2).step_by(2) {
            self.line(pair, colour, 1);
        }
    }

    /// A filled area; `opacity` 0 to 1.
    pub fn area(&mut self, points: &[Point], colour: RGBColor, opacity: f64) {
        let path: Vec<_> = points.iter().map(|p| pixel(*p)).collect();
        let result = self
            .root
            .draw(&Polygon::new(path, colour.mix(opacity).filled()));
        self.note(result);
    }

    /// The outline of a rectangle, two pixels wide.
    pub fn frame(&mut self, [a, b]: [Point; 2], colour: RGBColor) {
        let style = colour.stroke_width(2);
        let result = self.root.draw(&Rectangle::new([pixel(a), pixel(b)], style));
        self.note(result);
    }

    /// A text of `size` pixels, vertically centred.
    pub fn text(&mut self, words: &str, at: Point, size: i32, anchor: Anchor) {
        let side = match anchor {
            Anchor::Left => HPos::Left,
            Anchor::Middle => HPos::Center,
            Anchor::Right => HPos::Right,
        };
        let style = ("sans-serif", size).into_font().color(&INK);
        let style = style.pos(Pos::new(side, VPos::Center));
        let result = self
            .root
            .draw(&Text::new(words.to_owned(), pixel(at), style));
        self.note(result);
    }

    /// Names with their colours, one below the other.
    pub fn legend(&mut self, names: &[(usize, &str)], (x, y): Point) {
        for (row, (index, name)) in names.iter().enumerate() {
            let y = y + 24.0 * row as f64;
            let corners = [
                (x, y - 8.0),
                (x + 16.0, y - 8.0),
                (x + 16.0, y + 8.0),
                (x, y + 8.0),
            ];
            self.area(&corners, colour(*index), 0.8);
            self.text(name, (x + 24.0, y), 16, Anchor::Left);
        }
    }
}
