//! Curves as SVG inside a page: colours are the page's, so that they follow light and dark.

use std::fmt::Write;

use plotters::coord::ranged1d::{KeyPointHint, Ranged};
use plotters::prelude::*;

/// The drawing library's reason not to draw.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a chart cannot be drawn: {0}")]
pub struct ChartError(String);

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

    fn label(&self, value: f64) -> String {
        let near = |tick: &&(f64, String)| (tick.0 - value).abs() < 1e-9;
        let tick = self.ticks.iter().find(near);
        tick.map(|tick| tick.1.clone()).unwrap_or_default()
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

/// Marks in the drawing that become colours of the page.
fn marker(colour: usize) -> RGBColor {
    RGBColor(1, 0, colour as u8)
}

const GRID: RGBColor = RGBColor(2, 0, 0);
const LETTER: i32 = 22;

/// An axis with labels at chosen values.
#[derive(Clone)]
struct LabelledAxis {
    coordinate: plotters::coord::types::RangedCoordf64,
    at: Vec<f64>,
}

impl LabelledAxis {
    fn new(axis: &Axis) -> Self {
        Self {
            coordinate: (axis.range[0]..axis.range[1]).into(),
            at: axis.ticks.iter().map(|tick| tick.0).collect(),
        }
    }
}

impl Ranged for LabelledAxis {
    type FormatOption = plotters::coord::ranged1d::NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.coordinate.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.at.clone()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.coordinate.range()
    }
}

impl plotters::coord::ranged1d::ValueFormatter<f64> for LabelledAxis {
    fn format_ext(&self, value: &f64) -> String {
        value.to_string()
    }
}

impl Chart {
    /// The chart as an SVG element for a page that defines `--c1` .. and `--grid`.
    ///
    /// # Errors
    /// [`ChartError`], the drawing library's.
    pub fn svg(&self) -> Result<String, ChartError> {
        let mut text = String::new();
        self.draw(&mut text)
            .map_err(|error| ChartError(error.to_string()))?;
        Ok(self.adopted(&text))
    }

    fn draw(&self, text: &mut String) -> Result<(), Box<dyn std::error::Error + '_>> {
        let root = SVGBackend::with_string(text, self.size).into_drawing_area();
        let title = |axis: &Axis| if axis.title.is_empty() { 0 } else { LETTER };
        let mut chart = ChartBuilder::on(&root)
            .margin(LETTER / 2)
            .margin_right(LETTER)
            .x_label_area_size(LETTER + 12 + title(&self.x))
            .y_label_area_size(2 * LETTER + 16 + title(&self.y))
            .build_cartesian_2d(LabelledAxis::new(&self.x), LabelledAxis::new(&self.y))?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID.stroke_width(1))
            .axis_style(GRID.stroke_width(2))
            .label_style(("sans-serif", LETTER).into_font().color(&marker(INK)))
            .axis_desc_style(("sans-serif", LETTER).into_font().color(&marker(INK)))
            .x_label_formatter(&|x| self.x.label(*x))
            .y_label_formatter(&|y| self.y.label(*y))
            .x_desc(self.x.title)
            .y_desc(self.y.title)
            .draw()?;
        for curve in &self.curves {
            let (points, colour) = (curve.points.iter().copied(), marker(curve.colour));
            let is_thin = curve.colour == INK || curve.stroke == Stroke::Thin;
            let width = if is_thin { 2 } else { 4 };
            let style = colour.stroke_width(width);
            match curve.stroke {
                Stroke::Solid | Stroke::Thin => {
                    chart.draw_series(LineSeries::new(points, style))?;
                }
                Stroke::Dashed => {
                    chart.draw_series(DashedLineSeries::new(points, 10, 8, style))?;
                }
                Stroke::Dots => {
                    chart.draw_series(points.map(|at| Circle::new(at, 7, colour.filled())))?;
                }
            }
        }
        root.present()?;
        drop(chart);
        drop(root);
        Ok(())
    }

    /// The drawing as an element of a page: its colours, its width, no address of a name space.
    fn adopted(&self, text: &str) -> String {
        let start = text.find('>').map_or(0, |end| end + 1);
        let (width, height) = self.size;
        let mut svg = String::new();
        let caption = super::page::escaped(&self.caption);
        let _ = write!(
            svg,
            "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{caption}\">"
        );
        svg.push_str(text.get(start..).unwrap_or_default());
        svg = svg.replace("\"#020000\"", "\"var(--grid)\"");
        svg = svg.replace("\"#010000\"", "\"currentColor\"");
        for colour in 1..=COLOURS {
            let found = format!("\"#0100{colour:02X}\"");
            svg = svg.replace(&found, &format!("\"var(--c{colour})\""));
        }
        svg
    }
}
