//! The figure.

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::{
    Cartesian2d, ChartBuilder, Circle, Color, DrawingArea, IntoDrawingArea, LineSeries, RGBColor,
    SVGBackend, Text,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{BLACK, IntoFont, WHITE};

/// Pixels of the figure.
const SIZE: (u32, u32) = (900, 900);
/// Half the side of the square shown around the middle of all paths, as a share of their extent.
const MARGIN: f64 = 0.62;
/// Least distance between two labels, as a share of the side shown.
const LABEL_APART: f64 = 0.028;
/// Colours of the nominal path and of the six wheels': each side shares a family.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 0, 0),
    RGBColor(178, 24, 43),
    RGBColor(230, 97, 1),
    RGBColor(197, 27, 125),
    RGBColor(33, 102, 172),
    RGBColor(0, 136, 110),
    RGBColor(84, 39, 136),
];

/// A named path, m.
pub type Path = (String, Vec<(f64, f64)>);
type Chart<'a> =
    plotters::chart::ChartContext<'a, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Draws paths that begin at the origin into one SVG, axes of equal scale, each labelled at its
/// end; the first one is the nominal path.
///
/// # Errors
/// A description of what could not be drawn.
pub fn draw(title: &str, paths: &[Path]) -> Result<String, String> {
    let mut svg = String::new();
    let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
    draw_into(&root, title, paths).map_err(|error| error.to_string())?;
    root.present().map_err(|error| error.to_string())?;
    drop(root);
    Ok(svg)
}

type Failure = Box<dyn std::error::Error>;

fn draw_into(
    root: &DrawingArea<SVGBackend<'_>, Shift>,
    title: &str,
    paths: &[Path],
) -> Result<(), Failure> {
    let text = |e: &dyn std::error::Error| -> Failure { e.to_string().into() };
    root.fill(&WHITE).map_err(|e| text(&e))?;
    let ([x0, x1], [y0, y1]) = square(paths);
    let mut chart = ChartBuilder::on(root)
        .caption(title, ("sans-serif", 22))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(56)
        .build_cartesian_2d(x0..x1, y0..y1)
        .map_err(|e| text(&e))?;
    chart
        .configure_mesh()
        .x_desc("x, m (ahead at the start)")
        .y_desc("y, m (to the left)")
        .label_style(("sans-serif", 16))
        .axis_desc_style(("sans-serif", 18))
        .light_line_style(WHITE)
        .draw()
        .map_err(|e| text(&e))?;
    for ((_, path), colour) in paths.iter().zip(COLOURS) {
        let line = LineSeries::new(path.iter().copied(), colour.stroke_width(3));
        chart.draw_series(line).map_err(|e| text(&e))?;
    }
    let start = Circle::new((0.0, 0.0), 5, BLACK.filled());
    chart.draw_series([start]).map_err(|e| text(&e))?;
    label(&mut chart, paths, y1 - y0).map_err(|e| text(&*e))
}

/// Writes each name ahead of the end of its path, labels kept apart.
fn label(chart: &mut Chart<'_>, paths: &[Path], side_m: f64) -> Result<(), Failure> {
    let mut ends: Vec<(usize, (f64, f64), bool)> = paths
        .iter()
        .enumerate()
        .filter_map(|(i, (_, path))| {
            let [.., before, end] = path[..] else {
                return None;
            };
            Some((i, end, end.0 < before.0))
        })
        .collect();
    ends.sort_by(|a, b| a.1.1.total_cmp(&b.1.1));
    let mut placed: Vec<(f64, f64)> = Vec::new();
    for (i, (x, mut y), goes_back) in ends {
        let (side, offset_m) = match goes_back {
            true => (HPos::Right, -0.01 * side_m),
            false => (HPos::Left, 0.01 * side_m),
        };
        let close = |y: f64, other: &&(f64, f64)| {
            (other.1 - y).abs() < LABEL_APART * side_m && (other.0 - x).abs() < 0.2 * side_m
        };
        while let Some(other) = placed.iter().find(|other| close(y, other)) {
            y = other.1 + LABEL_APART * side_m * 1.01;
        }
        placed.push((x, y));
        let style = ("sans-serif", 18)
            .into_font()
            .color(&COLOURS[i % COLOURS.len()]);
        let style = style.pos(Pos::new(side, VPos::Center));
        let text = Text::new(paths[i].0.clone(), (x + offset_m, y), style);
        chart
            .draw_series([text])
            .map_err(|e| -> Failure { e.to_string().into() })?;
    }
    Ok(())
}

/// A square that holds all paths, m.
fn square(paths: &[Path]) -> ([f64; 2], [f64; 2]) {
    let points = || paths.iter().flat_map(|(_, path)| path.iter());
    let range = |of: fn(&(f64, f64)) -> f64| {
        points().map(of).fold([0.0_f64, 0.0], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
    };
    let (x, y) = (range(|p| p.0), range(|p| p.1));
    let half = MARGIN * (x[1] - x[0]).max(y[1] - y[0]).max(1e-3);
    let around = |[low, high]: [f64; 2]| {
        let middle = 0.5 * (low + high);
        [middle - half, middle + half]
    };
    (around(x), around(y))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn every_path_is_drawn_and_named() {
        let line = |name: &str, slope: f64| {
            let points = (0..50).map(|k| (f64::from(k), slope * f64::from(k)));
            (name.to_owned(), points.collect())
        };
        let svg = draw(
            "title",
            &[line("one", 0.0), line("two", 0.001), line("three", 1.0)],
        );
        let svg = svg.unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        for name in ["title", "one", "two", "three"] {
            assert!(svg.contains(&format!("\n{name}\n")), "{name}: {svg}");
        }
        let paths = svg.matches("stroke-width=\"3\"").count();
        assert_eq!(paths, 3);
    }
}
