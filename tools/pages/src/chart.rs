//! Curves as SVG inside a page: colours are the page's, so that they follow light and dark.

use super::svg::{Anchor, Dash, Drawing, Pen};
use crate::colour::Colour;
pub use crate::stroke::Stroke;

/// One axis.
#[derive(Debug, Clone, PartialEq, Default)]
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
        let is_some = end.is_finite() && end > 0.0;
        Self::between(title, [0.0, if is_some { end } else { 1.0 }], count)
    }

    /// The same between two ends.
    pub fn between(title: &'static str, range: [f64; 2], count: f64) -> Self {
        let [from, to] = range;
        let extent = to - from;
        if !(extent.is_finite() && extent > 0.0) {
            return Self::linear(title, 1.0, count);
        }
        let rough = extent / count;
        let power = 10.0_f64.powf(rough.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|m| m * power);
        let step = steps
            .into_iter()
            .find(|step| *step >= rough)
            .unwrap_or(extent);
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let first = (from / step - 1e-9).ceil();
        let n = (to / step + 1e-9).floor() - first;
        let tick = |i: usize| {
            // No minus before a zero.
            let value = (first + i as f64) * step + 0.0;
            (value, format!("{value:.decimals$}"))
        };
        let ticks = (0..=n.max(0.0) as usize).map(tick).collect();
        Self {
            title,
            range,
            ticks,
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

    /// Logarithmic around two ends, in powers of ten: a value lies at its logarithm. It is labelled
    /// at 1, 2 and 5 times each power of ten; if these are more than `count`, at powers alone.
    pub fn logarithmic(title: &'static str, ends: [f64; 2], count: usize) -> Self {
        let is_end = |end: f64| end.is_finite() && end > 0.0;
        let [from, to] = match ends {
            [from, to] if is_end(from) && is_end(to) => [from, to.max(from)],
            _ => [1.0, 10.0],
        };
        let [first, last] = [from.log10().floor(), to.log10().ceil()].map(|power| power as i32);
        let powers = first..=last.max(first + 1);
        // From texts: powers of ten alone are not exact.
        let text = |power: i32| [1, 2, 5].map(|m| format!("{m}e{power}"));
        let all = powers.flat_map(text);
        let all = all.filter_map(|text| Some((text.starts_with('1'), text.parse::<f64>().ok()?)));
        let all: Vec<(bool, f64)> = all.collect();
        let begin = all
            .iter()
            .rposition(|(_, value)| *value <= from * (1.0 + 1e-9));
        let end = all
            .iter()
            .position(|(_, value)| *value >= to * (1.0 - 1e-9));
        let begin = begin.unwrap_or(0);
        let end = end.unwrap_or(all.len() - 1).max(begin + 1);
        let shown = all.get(begin..=end).unwrap_or_default();
        let place = |at: usize| shown.get(at).map_or(0.0, |(_, value)| value.log10());
        let range = [place(0), place(shown.len().saturating_sub(1))];
        let is_labelled = |(is_power, _): &&(bool, f64)| *is_power || shown.len() <= count;
        let labelled: Vec<f64> = shown.iter().filter(is_labelled).map(|of| of.1).collect();
        let apart = labelled.len().div_ceil(count.max(1)).max(1);
        let ticks = labelled.iter().step_by(apart);
        Self {
            title,
            range,
            ticks: ticks.map(|v| (v.log10(), v.to_string())).collect(),
        }
    }

    /// Where a value lies between the ends, 0 to 1; what lies beyond is at an end.
    pub(crate) fn share_of(&self, value: f64) -> f64 {
        let [from, to] = self.range;
        let share = (value - from) / (to - from);
        if share.is_nan() {
            0.0
        } else {
            share.clamp(0.0, 1.0)
        }
    }
}

/// One curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Its colour.
    pub colour: Colour,
    /// How it is drawn.
    pub stroke: Stroke,
    /// Its points in the axes' units.
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    /// A broken line at a bound, such as a deadline.
    #[must_use]
    pub fn bound(points: [(f64, f64); 2]) -> Self {
        Self {
            colour: Colour::Alarm,
            stroke: Stroke::Dashed,
            points: points.to_vec(),
        }
    }
}

/// Words in a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Label {
    /// Where they begin, in the axes' units.
    pub at: (f64, f64),
    /// The words.
    pub text: String,
}

/// A chart.
#[derive(Debug, Clone, PartialEq, Default)]
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
    /// Words above all curves.
    pub labels: Vec<Label>,
}

/// Height of a letter.
pub(crate) const LETTER: i32 = 22;
const GRID: &str = "var(--grid)";

/// Where the curves lie in a chart.
pub(crate) struct Plot<'a> {
    chart: &'a Chart,
    pub(crate) left: f64,
    pub(crate) right: f64,
    pub(crate) top: f64,
    pub(crate) bottom: f64,
}

/// Left and right end of what is drawn between the axes.
pub(crate) fn sides(width: u32, has_y_title: bool) -> [f64; 2] {
    let letter = f64::from(LETTER);
    let title = if has_y_title { letter } else { 0.0 };
    [2.5 * letter + 16.0 + title, f64::from(width) - letter]
}

impl<'a> Plot<'a> {
    /// Between the labels and titles of the axes.
    pub(crate) fn new(chart: &'a Chart) -> Self {
        let letter = f64::from(LETTER);
        let title = |axis: &Axis| if axis.title.is_empty() { 0.0 } else { letter };
        let (width, height) = chart.size;
        let [left, right] = sides(width, !chart.y.title.is_empty());
        Self {
            chart,
            left,
            right,
            top: 0.5 * letter,
            bottom: f64::from(height) - 1.5 * letter - 12.0 - title(&chart.x),
        }
    }

    pub(crate) fn x(&self, value: f64) -> f64 {
        self.left + self.chart.x.share_of(value) * (self.right - self.left)
    }

    pub(crate) fn y(&self, value: f64) -> f64 {
        self.bottom - self.chart.y.share_of(value) * (self.bottom - self.top)
    }

    pub(crate) fn axes(&self, drawing: &mut Drawing) {
        let pen = |width: f64| Pen {
            colour: GRID,
            width,
            dash: Dash::None,
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

    /// Curves and words.
    pub(crate) fn content(&self, drawing: &mut Drawing) {
        for curve in &self.chart.curves {
            self.curve(curve, drawing);
        }
        for label in &self.chart.labels {
            let at = (self.x(label.at.0) + 12.0, self.y(label.at.1) - 4.0);
            drawing.text(&label.text, at, LETTER, Anchor::Start);
        }
    }

    fn curve(&self, curve: &Curve, drawing: &mut Drawing) {
        let colour = curve.colour.css();
        let is_place = |(x, y): &&(f64, f64)| x.is_finite() && y.is_finite();
        let points = curve.points.iter().filter(is_place);
        let points = points.map(|(x, y)| (self.x(*x), self.y(*y)));
        let points: Vec<_> = points.collect();
        let dash = match curve.stroke {
            Stroke::Dots => {
                points
                    .into_iter()
                    .for_each(|at| drawing.dot(at, 7.0, &colour));
                return;
            }
            Stroke::Area => return drawing.area(&points, &colour, 0.35),
            Stroke::Solid | Stroke::Thin => Dash::None,
            Stroke::Dashed => Dash::Strokes,
            Stroke::Dotted => Dash::Dots,
        };
        let is_thin = curve.colour == Colour::Ink || curve.stroke == Stroke::Thin;
        let pen = Pen {
            colour: &colour,
            width: if is_thin { 2.0 } else { 4.0 },
            dash,
        };
        drawing.line(&points, pen);
    }
}

impl Chart {
    /// Makes both axes equally long for equal values: the shorter range grows on both sides.
    #[must_use]
    pub fn with_equal_scales(mut self) -> Self {
        let plot = Plot::new(&self);
        let lengths = [plot.right - plot.left, plot.bottom - plot.top];
        let ranges = [self.x.range, self.y.range];
        let extents = ranges.map(|[from, to]| to - from);
        let scale = (extents[0] / lengths[0]).max(extents[1] / lengths[1]);
        let widened = |[from, to]: [f64; 2], length: f64| {
            let (middle, half) = (0.5 * (from + to), 0.5 * scale * length);
            [middle - half, middle + half]
        };
        self.x = Axis::between(self.x.title, widened(ranges[0], lengths[0]), 8.0);
        self.y = Axis::between(self.y.title, widened(ranges[1], lengths[1]), 6.0);
        self
    }

    /// The chart as an SVG element for a page that defines `--c1` .. and `--grid`.
    #[must_use]
    pub fn svg(&self) -> String {
        let mut drawing = Drawing::new("currentColor");
        let plot = Plot::new(self);
        plot.axes(&mut drawing);
        plot.content(&mut drawing);
        drawing.element(self.size.0, self.size.1, &self.caption)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|(_, text)| text.as_str()).collect()
    }

    #[test]
    fn labels_stand_at_round_values_within_the_ends() {
        assert_eq!(
            ticks(&Axis::linear("", 1.0, 5.0)),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(
            ticks(&Axis::between("", [-12.0, 7.0], 4.0)),
            ["-10", "-5", "0", "5"]
        );
        assert_eq!(
            ticks(&Axis::between("", [f64::NAN, 7.0], 2.0)),
            ["0.0", "0.5", "1.0"]
        );
        assert_eq!(Axis::linear("", f64::NAN, 2.0).range, [0.0, 1.0]);
    }

    #[test]
    fn a_logarithmic_axis_is_labelled_around_its_ends() {
        let labels = |ends: [f64; 2], count: usize| {
            let axis = Axis::logarithmic("", ends, count);
            ticks(&axis).join(" ")
        };
        assert_eq!(labels([0.3, 4.0], 9), "0.2 0.5 1 2 5");
        assert_eq!(labels([1.0, 1.0], 9), "1 2");
        assert_eq!(labels([0.000_3, 40.0], 9), "0.001 0.01 0.1 1 10");
        assert_eq!(labels([1e-9, 1e9], 10).split(' ').count(), 10);
        assert_eq!(labels([0.0, f64::NAN], 9), "1 2 5 10");
        let range = Axis::logarithmic("", [0.1, 1000.0], 9).range;
        assert_eq!(range, [-1.0, 3.0]);
    }

    #[test]
    fn equal_scales_keep_all_that_was_within() {
        let chart = Chart {
            size: (900, 700),
            x: Axis::between("x, m", [0.0, 1.0], 5.0),
            y: Axis::between("y, m", [-4.0, 4.0], 5.0),
            ..Chart::default()
        };
        let chart = chart.with_equal_scales();
        let plot = Plot::new(&chart);
        let scale = |range: [f64; 2], length: f64| (range[1] - range[0]) / length;
        let x = scale(chart.x.range, plot.right - plot.left);
        let y = scale(chart.y.range, plot.bottom - plot.top);
        assert!((x - y).abs() < 1e-9);
        assert!((chart.y.range[1] - 4.0).abs() < 1e-9 && chart.x.range[0] < 0.0);
    }

    #[test]
    fn what_is_no_number_is_not_drawn() {
        let chart = Chart {
            size: (300, 200),
            curves: vec![Curve {
                colour: Colour::Healthy,
                stroke: Stroke::Solid,
                points: vec![(0.0, f64::NAN), (f64::INFINITY, 1.0), (0.5, 9.0)],
            }],
            ..Chart::default()
        };
        let svg = chart.svg();
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }
}
