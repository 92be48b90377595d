//! Shapes as elements of SVG. Colours are the caller's: `#767676`, or a variable of the page.

use std::fmt::Write;

use crate::markup::escaped;

/// A point: to the right and down, in units of the drawing.
pub type Point = (f64, f64);

/// Which part of a text is at its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

/// How a line looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pen<'a> {
    /// Its colour.
    pub colour: &'a str,
    /// Its width.
    pub width: f64,
    /// Whether it is broken.
    pub dash: Dash,
}

/// Whether a line is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dash {
    /// It is whole.
    None,
    /// In strokes.
    Strokes,
    /// In dots.
    Dots,
}

/// Shapes, later ones above.
#[derive(Debug, Clone)]
pub struct Drawing {
    /// Colour of texts.
    ink: &'static str,
    shapes: String,
}

impl Drawing {
    /// Without a shape; `ink` is the colour of texts.
    #[must_use]
    pub const fn new(ink: &'static str) -> Self {
        Self {
            ink,
            shapes: String::new(),
        }
    }

    fn push(&mut self, shape: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = self.shapes.write_fmt(shape);
        self.shapes.push('\n');
    }

    /// A line through points.
    pub fn line(&mut self, points: &[Point], pen: Pen<'_>) {
        let (points, Pen { colour, width, .. }) = (listed(points), pen);
        let dashes = match pen.dash {
            Dash::None => "",
            Dash::Strokes => " stroke-dasharray=\"10 8\"",
            Dash::Dots => " stroke-dasharray=\"2 6\"",
        };
        self.push(format_args!(
            "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" \
             stroke-width=\"{width}\"{dashes}/>"
        ));
    }

    /// A filled area; `opacity` 0 to 1.
    pub fn area(&mut self, outline: &[Point], colour: &str, opacity: f64) {
        let outline = listed(outline);
        self.push(format_args!(
            "<polygon points=\"{outline}\" fill=\"{colour}\" fill-opacity=\"{opacity}\"/>"
        ));
    }

    /// A filled rectangle between two corners across from each other.
    pub fn rectangle(&mut self, a: Point, b: Point, colour: &str, opacity: f64) {
        self.area(&[a, (b.0, a.1), b, (a.0, b.1)], colour, opacity);
    }

    /// Filled rectangles, each between two corners across from each other. An edge of the same
    /// colour closes the seams between neighbours, and keeps the narrowest visible.
    pub fn rectangles(&mut self, corners: &[[Point; 2]], colour: &str) {
        let one = |[a, b]: &[Point; 2]| {
            format!("M{:.1} {:.1}H{:.1}V{:.1}H{:.1}Z", a.0, a.1, b.0, b.1, a.0)
        };
        let path: String = corners.iter().map(one).collect();
        self.push(format_args!(
            "<path d=\"{path}\" fill=\"{colour}\" stroke=\"{colour}\" stroke-width=\"0.7\"/>"
        ));
    }

    /// A filled circle.
    pub fn dot(&mut self, (x, y): Point, radius: f64, colour: &str) {
        self.push(format_args!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{colour}\"/>"
        ));
    }

    /// A text whose letters are `size` high, vertically centred.
    pub fn text(&mut self, words: &str, at: Point, size: i32, anchor: Anchor) {
        self.label(words, at, size, anchor, "");
    }

    /// A text that reads upwards, its middle at a point.
    pub fn upward_text(&mut self, words: &str, at: Point, size: i32) {
        let turned = format!(" transform=\"rotate(-90 {:.1} {:.1})\"", at.0, at.1);
        self.label(words, at, size, Anchor::Middle, &turned);
    }

    fn label(&mut self, words: &str, (x, y): Point, size: i32, anchor: Anchor, more: &str) {
        let (ink, words) = (self.ink, escaped(words));
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        self.push(format_args!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-family=\"sans-serif\" font-size=\"{size}\" \
             fill=\"{ink}\" text-anchor=\"{anchor}\" dominant-baseline=\"central\"{more}>{words}\
             </text>"
        ));
    }

    /// The element of a page, of this width and height; `caption` is for those who cannot see it.
    #[must_use]
    pub fn element(&self, width: u32, height: u32, caption: &str) -> String {
        format!(
            "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\">\n{}</svg>",
            escaped(caption),
            self.shapes
        )
    }

    /// A file of this width and height, pixels.
    #[must_use]
    pub fn file(&self, width: f64, height: f64) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" \
             height=\"{height:.0}\">\n{}</svg>\n",
            self.shapes
        )
    }
}

fn listed(points: &[Point]) -> String {
    let one = |(x, y): &Point| format!("{x:.1},{y:.1}");
    points.iter().map(one).collect::<Vec<_>>().join(" ")
}
