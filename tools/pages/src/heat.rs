//! Shares in rows and columns as a heat map: the greater a share, the stronger its shade.

use crate::chart::{Chart, LETTER, Plot};
use crate::colour::{Colour, SHADES, on_shade};
use crate::spectrum::{Spectrum, begin, steps};
use crate::svg::{Anchor, Drawing, Point};

/// Width of a letter.
const LETTER_WIDTH: f64 = 12.5;
/// Room for the key above a heat map.
const KEY_HEIGHT: f64 = 44.0;
/// Width of the key's strip, and of the label after it.
const STRIP: f64 = 306.0;
const STRIP_HEIGHT: f64 = 20.0;
const STRIP_LABEL: f64 = 90.0;
/// Least share that a logarithmic scale tells from a smaller one.
const SHARE_LEAST: f64 = 1e-6;

/// What the shades mean. A share above none always has one, however small it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Shares of what.
    title: &'static str,
    /// Up to the first, shares have the weakest shade; from the second on, the strongest.
    ends: [f64; 2],
    is_logarithmic: bool,
}

/// A share, as a label.
fn percent(share: f64) -> String {
    let text = format!("{:.6}", 100.0 * share);
    let text = text.trim_end_matches('0').trim_end_matches('.');
    format!("{text} %")
}

impl Scale {
    /// From nothing to all, in equal steps.
    #[must_use]
    pub const fn linear(title: &'static str) -> Self {
        Self {
            title,
            ends: [0.0, 1.0],
            is_logarithmic: false,
        }
    }

    /// From the least to the greatest of these shares, in steps of an equal factor.
    #[must_use]
    pub fn logarithmic(title: &'static str, shares: &[f64]) -> Self {
        let some = shares.iter().copied().filter(|share| *share > 0.0);
        let [least, most] = some.fold([1.0_f64, 0.0], |ends, share| {
            [ends[0].min(share), ends[1].max(share)]
        });
        let power = least.max(SHARE_LEAST).log10();
        let least = 10.0_f64.powf((power + 1e-9).floor()).min(0.1);
        // Round ones above the greatest.
        let round = [0.02, 0.05, 0.1, 0.2, 0.5].into_iter();
        let round = round.filter(|share| *share >= 10.0 * least);
        let most = round.filter(|share| *share >= most).fold(1.0, f64::min);
        Self {
            title,
            ends: [least, most],
            is_logarithmic: true,
        }
    }

    /// The shade of a share; none of nothing.
    fn shade(&self, share: f64) -> Option<usize> {
        let [least, most] = self.ends;
        let at = match self.is_logarithmic {
            true => (share / least).ln() / (most / least).ln(),
            false => (share - least) / (most - least),
        };
        let shade = (at * SHADES as f64).clamp(0.0, (SHADES - 1) as f64);
        (share > 0.0 && at.is_finite()).then_some(shade as usize)
    }

    /// Style of the cell of a table: shade and text; nothing for a share of nothing.
    #[must_use]
    pub fn style(&self, share: f64) -> String {
        let style = |shade: usize| {
            let (back, text) = (Colour::Shade(shade).css(), on_shade(shade));
            format!("background:{back};color:{text}")
        };
        self.shade(share).map_or_else(String::new, style)
    }

    /// The key alone, for a table, in a drawing of this width.
    #[must_use]
    pub fn key(&self, width: u32) -> String {
        let mut drawing = Drawing::new("currentColor");
        self.draw((0.0, 0.5 * KEY_HEIGHT), &mut drawing);
        let caption = format!("Key of the shades: {}", self.words());
        drawing.element(width, KEY_HEIGHT as u32, &caption)
    }

    fn words(&self) -> String {
        let title = self.title;
        match self.is_logarithmic {
            true => format!("{title}, logarithmic scale"),
            false => format!("{title}, linear scale"),
        }
    }

    /// The key from a point of its left end on, vertically centred.
    fn draw(&self, from: Point, drawing: &mut Drawing) {
        let [least, most] = self.ends.map(percent);
        let least = match self.is_logarithmic {
            true => format!("{least} or less"),
            false => least,
        };
        let before = least.chars().count() as f64 * LETTER_WIDTH;
        let (y, left) = (from.1, from.0 + before);
        let (top, bottom) = (y - 0.5 * STRIP_HEIGHT, y + 0.5 * STRIP_HEIGHT);
        let edge = |shade: usize| left + STRIP * shade as f64 / SHADES as f64;
        drawing.text(&least, (left - 10.0, y), LETTER, Anchor::End);
        for shade in 0..SHADES {
            let corners = [(edge(shade), top), (edge(shade + 1), bottom)];
            drawing.rectangles(&[corners], &Colour::Shade(shade).css());
        }
        let right = left + STRIP;
        drawing.text(&most, (right + 10.0, y), LETTER, Anchor::Start);
        let after = (right + STRIP_LABEL, y);
        drawing.text(&self.words(), after, LETTER, Anchor::Start);
    }
}

/// Shares between edges.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Grid {
    /// Edges of the columns in units of the x axis, one more than there are columns.
    pub columns: Vec<f64>,
    /// Edges of the rows in units of the y axis, one more than there are rows.
    pub rows: Vec<f64>,
    /// Row by row, column by column.
    pub shares: Vec<Vec<f64>>,
}

impl Grid {
    /// Each spectrum a row between two of the edges; columns are the steps of a logarithmic axis.
    #[must_use]
    pub fn new(edges: Vec<f64>, spectra: &[&Spectrum]) -> Self {
        let Some([first, last]) = steps(spectra.iter().copied()) else {
            return Self::default();
        };
        let row = |of: &&Spectrum| (first..=last).map(|step| of.share(step)).collect();
        Self {
            columns: (first..=last + 1).map(begin).collect(),
            rows: edges,
            shares: spectra.iter().map(row).collect(),
        }
    }

    /// Its rows as columns.
    #[must_use]
    pub fn turned(self) -> Self {
        let width = self.shares.iter().map(Vec::len).max().unwrap_or(0);
        let column = |at: usize| {
            let shares = self.shares.iter();
            shares
                .map(|row| row.get(at).copied().unwrap_or(0.0))
                .collect()
        };
        Self {
            shares: (0..width).map(column).collect(),
            columns: self.rows,
            rows: self.columns,
        }
    }

    /// All shares.
    #[must_use]
    pub fn all(&self) -> Vec<f64> {
        self.shares.concat()
    }
}

/// A heat map.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatMap {
    /// Its axes, and what lies above the cells.
    pub chart: Chart,
    /// What the shades mean.
    pub scale: Scale,
    /// The cells.
    pub grid: Grid,
}

impl HeatMap {
    /// The heat map as an SVG element.
    #[must_use]
    pub fn svg(&self) -> String {
        let mut drawing = Drawing::new("currentColor");
        let mut plot = Plot::new(&self.chart);
        plot.top += KEY_HEIGHT;
        // Names of rows are longer than numbers.
        let labels = self.chart.y.ticks.iter();
        let longest = labels.map(|(_, text)| text.chars().count()).max();
        let names = longest.unwrap_or(0) as f64 * LETTER_WIDTH + 20.0;
        plot.left = plot.left.max(match self.chart.y.title {
            "" => names,
            _ => names + 1.5 * f64::from(LETTER),
        });
        // The last label below has its middle at the end of the axis.
        let last = self.chart.x.ticks.last();
        let last = last.map_or(0, |(_, text)| text.chars().count());
        let half = 0.5 * LETTER_WIDTH * last as f64;
        plot.right -= (half - f64::from(LETTER)).max(0.0);
        plot.axes(&mut drawing);
        for (shade, cells) in self.cells(&plot).iter().enumerate() {
            if !cells.is_empty() {
                drawing.rectangles(cells, &Colour::Shade(shade).css());
            }
        }
        plot.content(&mut drawing);
        self.scale.draw((0.0, 0.5 * KEY_HEIGHT), &mut drawing);
        let (width, height) = self.chart.size;
        drawing.element(width, height, &self.chart.caption)
    }

    /// The cells of each shade, neighbours in a row as one; none of nothing.
    fn cells(&self, plot: &Plot<'_>) -> [Vec<[Point; 2]>; SHADES] {
        let mut found: [Vec<[Point; 2]>; SHADES] = Default::default();
        let columns = &self.grid.columns;
        for (edges, shares) in self.grid.rows.windows(2).zip(&self.grid.shares) {
            let count = shares.len().min(columns.len().saturating_sub(1));
            let shades = shares
                .iter()
                .take(count)
                .map(|share| self.scale.shade(*share));
            let shades: Vec<Option<usize>> = shades.collect();
            let mut at = 0;
            for run in shades.chunk_by(|a, b| a == b) {
                let [from, to] = [at, at + run.len()].map(|edge| plot.x(columns[edge]));
                at += run.len();
                let corners = [(from, plot.y(edges[1])), (to, plot.y(edges[0]))];
                if let Some(shade) = run.first().copied().flatten().filter(|_| to > from) {
                    found[shade].push(corners);
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::Axis;

    fn map(scale: Scale, grid: Grid) -> String {
        let map = HeatMap {
            chart: Chart {
                caption: "a <b> & c".into(),
                size: (900, 300),
                x: Axis::linear("time, s", 4.0, 4.0),
                y: Axis {
                    title: "",
                    range: [2.0, 0.0],
                    ticks: vec![(0.5, "<first>".into()), (1.5, "second".into())],
                },
                ..Chart::default()
            },
            scale,
            grid,
        };
        map.svg()
    }

    /// Rectangles of the cells of a shade, without that of the key.
    fn cells(svg: &str, shade: usize) -> usize {
        let fill = format!("fill=\"{}\"", Colour::Shade(shade).css());
        let paths = svg.lines().filter(|line| line.contains(&fill));
        paths.map(|line| line.matches('M').count()).sum::<usize>() - 1
    }

    fn grid() -> Grid {
        Grid {
            columns: vec![0.0, 1.0, 2.0, 3.0, 4.0],
            rows: vec![0.0, 1.0, 2.0],
            shares: vec![vec![0.0, 0.001, 0.999, 0.0], vec![1.0, 1.0, f64::NAN, -3.0]],
        }
    }

    #[test]
    fn neighbours_of_one_shade_are_one_cell_and_nothing_is_none() {
        let svg = map(Scale::linear("share of the row"), grid());
        let drawn: Vec<usize> = (0..SHADES).map(|shade| cells(&svg, shade)).collect();
        assert_eq!(drawn, [1, 0, 0, 0, 0, 0, 0, 0, 2]);
        assert!(svg.contains("a &lt;b&gt; &amp; c") && svg.contains("&lt;first&gt;"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert!(svg.contains(">0 %<") && svg.contains(">100 %<") && svg.contains("linear scale"));
    }

    #[test]
    fn a_rare_share_is_seen_on_a_logarithmic_scale() {
        let shares = [0.0, 3e-5, 0.3, 1e-4];
        let scale = Scale::logarithmic("share of the column", &shares);
        assert_eq!(scale.ends, [1e-5, 0.5]);
        let shades = shares.map(|share| scale.shade(share));
        assert_eq!(shades, [None, Some(0), Some(8), Some(1)]);
        assert_eq!(scale.shade(1e-12), Some(0));
        assert_eq!(scale.shade(f64::INFINITY), None);
        assert!(
            scale.key(900).contains("0.001 % or less"),
            "{}",
            scale.key(900)
        );
        assert_eq!(Scale::logarithmic("", &[]).ends, [0.1, 1.0]);
        assert_eq!(Scale::logarithmic("", &[1e-30]).ends, [1e-6, 0.02]);
        assert_eq!(scale.style(0.0), "");
        assert_eq!(scale.style(0.3), "background:var(--h9);color:var(--back)");
    }

    #[test]
    fn an_empty_grid_has_axes_and_no_cell_and_a_turned_one_the_same_cells() {
        for grid in [Grid::default(), Grid::new(vec![0.0], &[])] {
            let svg = map(Scale::logarithmic("share", &grid.all()), grid);
            assert_eq!(
                (0..SHADES).map(|shade| cells(&svg, shade)).sum::<usize>(),
                0
            );
            assert!(!svg.contains("NaN") && svg.contains("time, s"));
        }
        let spectra: [Spectrum; 2] =
            [&[1.0, 1.0, 2.0][..], &[9.0]].map(|of| of.iter().copied().collect());
        let grid = Grid::new(vec![0.0, 1.0, 2.0], &[&spectra[0], &spectra[1]]);
        assert_eq!(
            (grid.shares.len(), grid.shares[0].len()),
            (2, grid.columns.len() - 1)
        );
        let turned = grid.clone().turned();
        assert_eq!(
            (turned.columns.len(), turned.shares.len()),
            (3, turned.rows.len() - 1)
        );
        assert_eq!(turned.turned(), grid);
    }
}
