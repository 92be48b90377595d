//! Curves as SVG inside a page: colours are the page's, so that they follow light and dark.

use super::svg::{Anchor, Drawing, Pen};

/// Colours of lines in the page (`--c1` ..).
pub const COLOURS: usize = 6;
/// Colour of the text, for lines that are no data.
pub const INK: usize = 0;

/// One axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// What it shows, with its unit.
    pub title: &'static str,
    /// Its ends.
    pub range: [f64; 2],
    /// Where it is labelled, and how.
    pub ticks: Vec<(f64, String)>,
}

impl Axis {
    /// From 0 to 1.
    pub fn share(title: &'static str) -> Self {
        let ticks = [0.0, 0.25, 0.5, 0.75, 1.0].map(|p| (p, p.to_string()));
        Self {
            title,
            range: [0.0, 1.0],
            ticks: ticks.to_vec(),
        }
    }

    /// From 0 to `end`, labelled in steps of 1, 2 or 5 times a power of ten, about `count` of them.
    pub fn linear(title: &'static str, end: f64, count: f64) -> Self {
        let end = if end.is_finite() && end > 0.0 {
            end
        } else {
            1.0
        };
        let rough = end / count;
        let power = 10.0_f64.powf(rough.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|m| m * power);
        let step = steps.into_iter().find(|step| *step >= rough).unwrap_or(end);
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let n = (end / step + 1e-9).floor() as usize;
        let tick = |i: usize| (i as f64 * step, format!("{:.decimals$}", i as f64 * step));
        Self {
            title,
            range: [0.0, end],
            ticks: (0..=n).map(tick).collect(),
        }
    }

    /// Labels at the given values, which `place` maps onto the axis.
    pub fn placed(title: &'static str, values: &[f64], place: impl Fn(f64) -> f64) -> Self {
        let ticks: Vec<_> = values.iter().map(|v| (place(*v), v.to_string())).collect();
        let end = |tick: Option<&(f64, String)>, other| tick.map_or(other, |tick| tick.0);
        Self {
            title,
            range: [end(ticks.first(), 0.0), end(ticks.last(), 1.0)],
            ticks,
        }
    }

    /// Where a value lies between the ends, 0 to 1.
    fn share_of(&self, value: f64) -> f64 {
        let [from, to] = self.range;
        if to > from {
            (value - from) / (to - from)
        } else {
            0.0
        }
    }
}

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// A line.
    Solid,
    /// A thin line.
    Thin,
    /// A broken line.
    Dashed,
    /// A filled circle at each point.
    Dots,
}

/// One curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Colour: [`INK`] or 1 to [`COLOURS`].
    pub colour: usize,
    /// How it is drawn.
    pub stroke: Stroke,
    /// Its points in the axes' units.
    pub points: Vec<(f64, f64)>,
}

/// A chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Said to those who cannot see it.
    pub caption: String,
    /// Width and height, in units of which a letter is 22 high.
    pub size: (u32, u32),
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// The curves; later ones lie above.
    pub curves: Vec<Curve>,
}

/// Height of a letter.
const LETTER: i32 = 22;
const GRID: &str = "var(--grid)";

/// Where the curves lie in a chart.
struct Plot<'a> {
    chart: &'a Chart,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl<'a> Plot<'a> {
    /// Between the labels and titles of the axes.
    fn new(chart: &'a Chart) -> Self {
        let letter = f64::from(LETTER);
        let title = |axis: &Axis| if axis.title.is_empty() { 0.0 } else { letter };
        let (width, height) = chart.size;
        Self {
            chart,
            left: 2.5 * letter + 16.0 + title(&chart.y),
            right: f64::from(width) - letter,
            top: 0.5 * letter,
            bottom: f64::from(height) - 1.5 * letter - 12.0 - title(&chart.x),
        }
    }

    fn x(&self, value: f64) -> f64 {
        self.left + self.chart.x.share_of(value) * (self.right - self.left)
    }

    fn y(&self, value: f64) -> f64 {
        self.bottom - self.chart.y.share_of(value) * (self.bottom - self.top)
    }

    fn axes(&self, drawing: &mut Drawing) {
        let pen = |width: f64| Pen {
            colour: GRID,
            width,
            is_dashed: false,
        };
        let letter = f64::from(LETTER);
        let &Self {
            left,
            right,
            top,
            bottom,
            ..
        } = self;
        for (value, label) in &self.chart.x.ticks {
            let x = self.x(*value);
            drawing.line(&[(x, top), (x, bottom)], pen(1.0));
            drawing.text(label, (x, bottom + letter), LETTER, Anchor::Middle);
        }
        for (value, label) in &self.chart.y.ticks {
            let y = self.y(*value);
            drawing.line(&[(left, y), (right, y)], pen(1.0));
            drawing.text(label, (left - 10.0, y), LETTER, Anchor::End);
        }
        drawing.line(&[(left, top), (left, bottom), (right, bottom)], pen(2.0));
        let (middle, centre) = (0.5 * (left + right), 0.5 * (top + bottom));
        let (x, y) = (self.chart.x.title, self.chart.y.title);
        let below = (middle, bottom + 2.0 * letter + 6.0);
        drawing.text(x, below, LETTER, Anchor::Middle);
        drawing.upward_text(y, (letter, centre), LETTER);
    }

    fn curve(&self, curve: &Curve, drawing: &mut Drawing) {
        let colour = match curve.colour {
            INK => "currentColor".to_owned(),
            colour => format!("var(--c{colour})"),
        };
        let points = curve.points.iter().map(|(x, y)| (self.x(*x), self.y(*y)));
        if curve.stroke == Stroke::Dots {
            points.for_each(|at| drawing.dot(at, 7.0, &colour));
            return;
        }
        let is_thin = curve.colour == INK || curve.stroke == Stroke::Thin;
        let pen = Pen {
            colour: &colour,
            width: if is_thin { 2.0 } else { 4.0 },
            is_dashed: curve.stroke == Stroke::Dashed,
        };
        drawing.line(&points.collect::<Vec<_>>(), pen);
    }
}

impl Chart {
    /// The chart as an SVG element for a page that defines `--c1` .. and `--grid`.
    #[must_use]
    pub fn svg(&self) -> String {
        let mut drawing = Drawing::new("currentColor");
        let plot = Plot::new(self);
        plot.axes(&mut drawing);
        for curve in &self.curves {
            plot.curve(curve, &mut drawing);
        }
        drawing.element(self.size.0, self.size.1, &self.caption)
    }
}
