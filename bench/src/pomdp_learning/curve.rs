//! The learning curve as a figure.

use plotters::element::PathElement;
use plotters::prelude::{
    ChartBuilder, Color, IntoDrawingArea, LineSeries, Polygon, RGBColor, SVGBackend,
    SeriesLabelPosition,
};
use plotters::style::{BLACK, TRANSPARENT, WHITE};
use serde_json::Value;

use super::Failure;

const SIZE: (u32, u32) = (900, 560);
const LEARNER: RGBColor = RGBColor(33, 102, 172);
/// Of the levels: true model, escalation, prior.
const COLOURS: [RGBColor; 3] = [
    RGBColor(0, 136, 110),
    RGBColor(120, 120, 120),
    RGBColor(178, 24, 43),
];

/// What the curve lies between.
const LEVELS: [(&str, &str); 3] = [
    ("true_policy", "policy of the true model"),
    ("escalation", "escalation"),
    ("prior_policy", "policy of the prior"),
];
const TITLE: &str =
    "Posterior sampling from a wrong prior: mean reward of a mission, 95 % over learners";

/// The numbers of the figure; missions by the logarithm of 1 + their number.
struct Curve {
    line: Vec<(f64, f64)>,
    upper: Vec<(f64, f64)>,
    lower: Vec<(f64, f64)>,
    levels: Vec<f64>,
}

fn number(value: &Value, key: &str) -> Result<f64, Failure> {
    let found = value[key].as_f64();
    found.ok_or_else(|| format!("no number '{key}'").into())
}

impl Curve {
    fn of(online: &Value) -> Result<Self, Failure> {
        let mut curve = Self {
            line: Vec::new(),
            upper: Vec::new(),
            lower: Vec::new(),
            levels: Vec::new(),
        };
        for point in online["curve"].as_array().into_iter().flatten() {
            let x = (1.0 + number(point, "missions")?).log10();
            let (mean, half) = (number(point, "mean")?, number(point, "half_width_95")?);
            curve.line.push((x, mean));
            curve.upper.push((x, mean + half));
            curve.lower.push((x, mean - half));
        }
        for (key, _) in LEVELS {
            curve.levels.push(number(online, key)?);
        }
        Ok(curve)
    }

    /// Least and largest value, with some room.
    fn range(&self) -> (f64, f64) {
        let values = || {
            let edges = self.upper.iter().chain(&self.lower).map(|p| p.1);
            edges.chain(self.levels.iter().copied())
        };
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        let room = 0.05 * (high - low);
        (low - room, high + room)
    }
}

/// Mean reward of the learned policy over missions, with the 95 % interval over learners, between
/// the true model's policy, the prior's and the escalation. Missions are placed by their logarithm.
///
/// # Errors
/// Numbers that are missing, or the drawing library's.
pub fn draw(online: &Value) -> Result<String, Failure> {
    let curve = Curve::of(online)?;
    let (low, high) = curve.range();
    let end = curve.line.last().map_or(1.0, |p| p.0);
    let mut svg = String::new();
    let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(TITLE, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(48)
        .y_label_area_size(60)
        .build_cartesian_2d(0.0..end, low..high)?;
    chart
        .configure_mesh()
        .x_desc("missions so far")
        .y_desc("discounted reward of a mission")
        .x_label_formatter(&|x| format!("{:.0}", 10.0_f64.powf(*x) - 1.0))
        .label_style(("sans-serif", 16))
        .axis_desc_style(("sans-serif", 18))
        .light_line_style(TRANSPARENT)
        .draw()?;
    let band = curve.upper.iter().chain(curve.lower.iter().rev());
    let band: Vec<(f64, f64)> = band.copied().collect();
    chart.draw_series([Polygon::new(band, LEARNER.mix(0.2).filled())])?;
    let key = |(x, y), style| PathElement::new(vec![(x, y), (x + 24, y)], style);
    chart
        .draw_series(LineSeries::new(curve.line, LEARNER.stroke_width(3)))?
        .label("policy of the learner's mean model")
        .legend(move |at| key(at, LEARNER.stroke_width(3)));
    for ((level, (_, name)), colour) in curve.levels.iter().zip(LEVELS).zip(COLOURS) {
        let style = colour.stroke_width(2);
        chart
            .draw_series(LineSeries::new([(0.0, *level), (end, *level)], style))?
            .label(name)
            .legend(move |at| key(at, style));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::MiddleRight)
        .label_font(("sans-serif", 16))
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    root.present()?;
    drop(chart);
    drop(root);
    Ok(svg)
}
