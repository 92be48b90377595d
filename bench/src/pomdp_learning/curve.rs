//! The learning curve as a figure.

use plotters::prelude::{
    ChartBuilder, Color, IntoDrawingArea, LineSeries, Polygon, RGBColor, SVGBackend,
};
use plotters::style::{BLACK, Palette, Palette99, TRANSPARENT, WHITE};
use serde_json::Value;

use super::Failure;

const SIZE: (u32, u32) = (900, 560);
const LEARNER: RGBColor = RGBColor(33, 102, 172);

/// Mean reward of the learned policy over missions, with the 95 % interval over learners, between
/// the true model's policy, the prior's and the escalation. Missions are placed by their logarithm.
///
/// # Errors
/// Numbers that are missing, or the drawing library's.
pub fn draw(online: &Value) -> Result<String, Failure> {
    let number = |value: &Value, key: &str| {
        let found = value[key].as_f64();
        found.ok_or_else(|| -> Failure { format!("no number '{key}'").into() })
    };
    let place = |missions: f64| (1.0 + missions).log10();
    let (mut line, mut upper, mut lower) = (Vec::new(), Vec::new(), Vec::new());
    for point in online["curve"].as_array().into_iter().flatten() {
        let x = place(number(point, "missions")?);
        let (mean, half) = (number(point, "mean")?, number(point, "half_width_95")?);
        line.push((x, mean));
        upper.push((x, mean + half));
        lower.push((x, mean - half));
    }
    let levels = [
        ("true_policy", "policy of the true model"),
        ("escalation", "escalation"),
        ("prior_policy", "policy of the prior"),
    ];
    let mut low = lower.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let mut high = upper.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
    for (key, _) in levels {
        low = low.min(number(online, key)?);
        high = high.max(number(online, key)?);
    }
    let margin = 0.05 * (high - low);
    let end = line.last().map_or(1.0, |p| p.0);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&root)
            .caption(
                "Posterior sampling from a wrong prior: mean reward of a mission, 95 % over learners",
                ("sans-serif", 20),
            )
            .margin(12)
            .x_label_area_size(48)
            .y_label_area_size(60)
            .build_cartesian_2d(0.0..end, low - margin..high + margin)?;
        chart
            .configure_mesh()
            .x_desc("missions so far")
            .y_desc("discounted reward of a mission")
            .x_label_formatter(&|x| format!("{:.0}", 10.0_f64.powf(*x) - 1.0))
            .label_style(("sans-serif", 16))
            .axis_desc_style(("sans-serif", 18))
            .light_line_style(TRANSPARENT)
            .draw()?;
        let band: Vec<(f64, f64)> = upper.iter().chain(lower.iter().rev()).copied().collect();
        chart.draw_series([Polygon::new(band, LEARNER.mix(0.2).filled())])?;
        let learner = LineSeries::new(line, LEARNER.stroke_width(3));
        chart
            .draw_series(learner)?
            .label("policy of the learner's mean model")
            .legend(|(x, y)| {
                let path = vec![(x, y), (x + 24, y)];
                plotters::prelude::PathElement::new(path, LEARNER.stroke_width(3))
            });
        for (index, (key, name)) in levels.iter().enumerate() {
            let level = number(online, key)?;
            let colour = Palette99::pick(index + 2).to_rgba();
            chart
                .draw_series(LineSeries::new(
                    [(0.0, level), (end, level)],
                    colour.stroke_width(2),
                ))?
                .label(*name)
                .legend(move |(x, y)| {
                    let path = vec![(x, y), (x + 24, y)];
                    plotters::prelude::PathElement::new(path, colour.stroke_width(2))
                });
        }
        chart
            .configure_series_labels()
            .position(plotters::prelude::SeriesLabelPosition::MiddleRight)
            .label_font(("sans-serif", 16))
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK.mix(0.3))
            .draw()?;
        root.present()?;
    }
    Ok(svg)
}
