//! The page of a measurement: the latency of every cell at a glance, as heat maps.

use vigil_cycle::Latency;
use vigil_pages::chart::{Axis, Chart, Curve};
use vigil_pages::heat::{Grid, HeatMap, Scale};
use vigil_pages::page::{KeyEntry, Section, beside, key, page, remark, table, titled};
use vigil_pages::spectrum::{Spectrum, ends};

use super::cell::Cell;
use crate::chain::{STAGE_NAMES, STAGES};
use crate::has_percentile;

/// What the table below [`HEADS`] says.
pub const ABOUT: &str = "Times in us; every latency from the schedule, hand-over and floor without \
                         compute; folded are instants that only a later one's answer ended. Own, \
                         by stage: instants that each stage answered after its own deadline and \
                         that are not the machine's. Raw data of an archive hold every \
                         cycle.";
/// Heads of the table of all cells.
pub const HEADS: [&str; 16] = [
    "cell",
    "cycles",
    "folded",
    "end to end p50",
    "p99",
    "p99.9",
    "max",
    "hand-over p50",
    "p99",
    "floor p50",
    "p99",
    "missed: own",
    "machine",
    "no one stall",
    "machine / canary",
    "own, by stage",
];

const CELLS: &str = "From the schedule to the action, every instant. Each row is a cell: its \
                     shades are shares of its own cycles, and one late cycle alone is seen. The \
                     broken line is the cell's deadline.";
const PARTS: &str = "Of each cell, from above: the whole, and then for each stage the time from \
                     its input to its wake-up and from there to its answer. Parts are those of \
                     instants that every stage answered. All maps have one axis and one scale.";
/// Cells that the verdict names.
const NAMES_MAX: usize = 4;
/// Width of the map of all cells and of that of one cell; height of a row in either.
const WIDTH: u32 = 1800;
const PART_WIDTH: u32 = 1000;
const ROW_HEIGHT: u32 = 32;
/// Height of what stands above and below the rows.
const AROUND: u32 = 134;
/// Labels of the axis at most: of all cells, of one.
const LABELS_MAX: [usize; 2] = [18, 9];
const US: f64 = 1e-3;

/// What is kept of a cell for the page.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CellFigures {
    /// Its rate, load and scheduling.
    pub name: String,
    /// Its deadline, us.
    pub deadline_us: f64,
    /// Its p99 from the schedule to the action, us; `None` of too few cycles.
    pub p99_us: Option<f64>,
    /// How many cycles Vigil missed by itself.
    pub own_misses: u64,
    /// False if no canary could tell whose a miss is: then all are Vigil's own.
    pub is_attributed: bool,
    /// Times from the schedule to the action, us.
    pub end_to_end: Spectrum,
    /// Times of each stage before its wake-up and after it, us.
    pub stages: [[Spectrum; 2]; STAGES],
}

/// What is on the page.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LatencyPage {
    /// What was measured, and on what: name and value.
    pub facts: Vec<Vec<String>>,
    /// Cells that were measured.
    pub cells: Vec<CellFigures>,
    /// The row of each cell below [`HEADS`], also of one that was not measured.
    pub rows: Vec<Vec<String>>,
}

/// The times of a histogram, us.
fn spectrum(latency: &Latency) -> Spectrum {
    let mut found = Spectrum::default();
    for step in latency.histogram().iter_recorded() {
        let us = step.value_iterated_to() as f64 * US;
        found.add(us, step.count_at_value());
    }
    found
}

impl CellFigures {
    /// Of a cell; `run` is the number of its run if there are several.
    #[must_use]
    pub fn new(cell: &Cell, run: Option<usize>) -> Self {
        let name = cell.spec.name();
        let whole = cell.graph.end_to_end.percentiles();
        Self {
            name: run.map_or_else(|| name.clone(), |run| format!("{name}, run {run}")),
            deadline_us: cell.deadline_ns as f64 * US,
            p99_us: has_percentile(0.99, whole.n).then_some(whole.p99_ns as f64 * US),
            own_misses: cell.missed().0,
            is_attributed: cell.is_attributed,
            end_to_end: spectrum(&cell.graph.end_to_end),
            stages: std::array::from_fn(|stage| {
                let (hand_over, compute) = &cell.graph.stages[stage];
                [hand_over, compute].map(spectrum)
            }),
        }
    }

    fn spectra(&self) -> impl Iterator<Item = &Spectrum> {
        let stages = self.stages.iter().flatten();
        stages.chain([&self.end_to_end])
    }

    /// The heat map of its parts on an axis of all cells.
    fn map(&self, x: &Axis, scale: Scale) -> String {
        let mut rows = vec![("end to end".to_owned(), &self.end_to_end)];
        for (name, [before, after]) in STAGE_NAMES.iter().zip(&self.stages) {
            rows.push((format!("to {name}"), before));
            rows.push((format!("{name} itself"), after));
        }
        let (names, spectra): (Vec<String>, Vec<&Spectrum>) = rows.into_iter().unzip();
        let map = HeatMap {
            chart: Chart {
                caption: format!("Latency of {} and its parts", self.name),
                size: (PART_WIDTH, ROW_HEIGHT * names.len() as u32 + AROUND),
                x: x.clone(),
                y: named_rows(&names),
                curves: vec![deadline(self, 0)],
                labels: Vec::new(),
            },
            scale,
            grid: Grid::new(edges(names.len()), &spectra),
        };
        titled(&self.name, "", &map.svg())
    }
}

/// An axis of rows below each other, each with its name.
fn named_rows(names: &[String]) -> Axis {
    let tick = |(row, name): (usize, &String)| (row as f64 + 0.5, name.clone());
    Axis {
        title: "",
        range: [names.len() as f64, 0.0],
        ticks: names.iter().enumerate().map(tick).collect(),
    }
}

fn edges(rows: usize) -> Vec<f64> {
    (0..=rows).map(|row| row as f64).collect()
}

/// The deadline of a cell as a broken line through its row.
fn deadline(cell: &CellFigures, row: usize) -> Curve {
    let place = cell.deadline_us.log10();
    Curve::bound([row, row + 1].map(|edge| (place, edge as f64)))
}

fn plural(count: usize, one: &str) -> String {
    match count {
        1 => format!("1 {one}"),
        _ => format!("{count} {one}s"),
    }
}

impl LatencyPage {
    /// The page.
    #[must_use]
    pub fn html(&self) -> String {
        let section = |id, heading, about: &str, inside| Section {
            id,
            heading,
            about: about.to_owned(),
            inside,
        };
        let sections = [
            section("cells", "Latency of all cells", CELLS, self.all_cells()),
            section("figures", "Figures", ABOUT, table(&HEADS, &self.rows)),
            section("stages", "Each cell by its stages", PARTS, self.each_cell()),
            section(
                "facts",
                "What was measured",
                "",
                table(&["", ""], &self.facts),
            ),
        ];
        page("Vigil: latency", &self.verdict(), &sections)
    }

    /// Which cell was the slowest, and how many cycles Vigil missed by itself, and where.
    #[must_use]
    pub fn verdict(&self) -> String {
        if self.cells.is_empty() {
            return "No cell was measured.".to_owned();
        }
        let p99 = |cell: &&CellFigures| cell.p99_us.unwrap_or(f64::NEG_INFINITY);
        let slowest = self.cells.iter().max_by(|a, b| p99(a).total_cmp(&p99(b)));
        let slowest = slowest.and_then(|cell| Some((&cell.name, cell.p99_us?)));
        let mut sentences = vec![match slowest {
            Some((name, us)) => format!("The worst p99 is {us:.1} us, of {name}."),
            None => "No cell has cycles enough for a p99.".to_owned(),
        }];
        sentences.push(self.misses());
        let unattributed = self.cells.iter().filter(|cell| !cell.is_attributed).count();
        if unattributed > 0 {
            let cells = plural(unattributed, "cell");
            sentences.push(format!(
                "In {cells} no canary stood above the graph, so that every miss counts as Vigil's."
            ));
        }
        let unmeasured = self.rows.len().saturating_sub(self.cells.len());
        if unmeasured > 0 {
            let cells = plural(unmeasured, "cell");
            sentences.push(format!("Not measured: {cells}."));
        }
        sentences.join(" ")
    }

    fn misses(&self) -> String {
        let cycles: u64 = self.cells.iter().map(|cell| cell.end_to_end.total()).sum();
        let all = format!("{cycles} cycles in {}", plural(self.cells.len(), "cell"));
        let mut late: Vec<&CellFigures> = self.cells.iter().collect();
        late.retain(|cell| cell.own_misses > 0);
        late.sort_by_key(|cell| std::cmp::Reverse(cell.own_misses));
        let total: u64 = late.iter().map(|cell| cell.own_misses).sum();
        let named = late.iter().take(NAMES_MAX);
        let named = named.map(|cell| format!("{} in {}", cell.own_misses, cell.name));
        let named: Vec<String> = named.collect();
        let further = match late.len().saturating_sub(NAMES_MAX) {
            0 => String::new(),
            count => format!(" and the others in {}", plural(count, "further cell")),
        };
        match total {
            0 => format!("Of {all}, Vigil itself missed none."),
            _ => format!(
                "Of {all}, Vigil itself missed {total}: {}{further}.",
                named.join(", ")
            ),
        }
    }

    /// An axis for all cells, with their deadlines.
    fn axis(&self, spectra: &[&Spectrum], labels_max: usize) -> Axis {
        let deadlines = self.cells.iter().map(|cell| cell.deadline_us);
        let [least, most] = ends(spectra.iter().copied()).unwrap_or([1.0, 1.0]);
        let most = deadlines.fold(most, f64::max);
        Axis::logarithmic("time, us", [least, most], labels_max)
    }

    fn all_cells(&self) -> String {
        if self.cells.is_empty() {
            return remark("No cell was measured.");
        }
        let names: Vec<String> = self.cells.iter().map(|cell| cell.name.clone()).collect();
        let spectra: Vec<&Spectrum> = self.cells.iter().map(|cell| &cell.end_to_end).collect();
        let grid = Grid::new(edges(names.len()), &spectra);
        let deadlines = self.cells.iter().enumerate();
        let map = HeatMap {
            chart: Chart {
                caption: "Latency of all cells: share of the cycles by time".to_owned(),
                size: (WIDTH, ROW_HEIGHT * names.len() as u32 + AROUND),
                x: self.axis(&spectra, LABELS_MAX[0]),
                y: named_rows(&names),
                curves: deadlines.map(|(row, cell)| deadline(cell, row)).collect(),
                labels: Vec::new(),
            },
            scale: Scale::logarithmic("share of the cycles of a cell", &grid.all()),
            grid,
        };
        let names = key(&[KeyEntry::bound("deadline".to_owned())]);
        format!("{names}{}\n", map.svg())
    }

    fn each_cell(&self) -> String {
        let spectra = self.cells.iter().flat_map(CellFigures::spectra);
        let spectra: Vec<&Spectrum> = spectra.collect();
        let x = self.axis(&spectra, LABELS_MAX[1]);
        let shares = Grid::new(edges(spectra.len()), &spectra).all();
        let scale = Scale::logarithmic("share of a row", &shares);
        let maps = self.cells.iter().map(|cell| cell.map(&x, scale));
        beside(&maps.collect::<Vec<_>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Thousand cycles around `us`, one of them late.
    fn cell(name: &str, us: f64, own_misses: u64) -> CellFigures {
        let around = |us: f64| (0..999).map(move |i| us * (1.0 + 0.001 * f64::from(i)));
        CellFigures {
            name: name.into(),
            deadline_us: 1000.0,
            p99_us: Some(2.0 * us),
            own_misses,
            is_attributed: true,
            end_to_end: around(us).chain([25_000.0]).collect(),
            stages: std::array::from_fn(|_| [0.1, 0.02].map(|share| around(us * share).collect())),
        }
    }

    fn page_of(cells: Vec<CellFigures>) -> LatencyPage {
        let row = |cell: &CellFigures| {
            let mut row = vec![cell.name.clone(), "<1>".to_owned()];
            row.resize(HEADS.len(), "-".to_owned());
            row
        };
        LatencyPage {
            facts: vec![vec!["command".into(), "scripts/bench latency".into()]],
            rows: cells.iter().map(row).collect(),
            cells,
        }
    }

    #[test]
    fn the_verdict_names_the_slowest_cell_and_where_vigil_missed() {
        let cells = [
            ("100hz-idle-fifo", 70.0, 0),
            ("1000hz-cpu-fifo", 90.0, 2),
            ("1000hz-io-other", 80.0, 15),
        ];
        let mut page = page_of(
            cells
                .map(|(name, us, misses)| cell(name, us, misses))
                .to_vec(),
        );
        let wanted = "The worst p99 is 180.0 us, of 1000hz-cpu-fifo. Of 3000 cycles in 3 cells, \
                      Vigil itself missed 17: 15 in 1000hz-io-other, 2 in 1000hz-cpu-fifo.";
        assert_eq!(page.verdict(), wanted);
        page.cells.truncate(1);
        page.cells[0].is_attributed = false;
        let wanted = "The worst p99 is 140.0 us, of 100hz-idle-fifo. Of 1000 cycles in 1 cell, \
                      Vigil itself missed none. In 1 cell no canary stood above the graph, so that \
                      every miss counts as Vigil's. Not measured: 2 cells.";
        assert_eq!(page.verdict(), wanted);
        page.cells[0].p99_us = None;
        assert!(
            page.verdict()
                .starts_with("No cell has cycles enough for a p99.")
        );
        let many = (0..9).map(|i| cell(&format!("cell{i}"), 70.0, 1)).collect();
        let text = page_of(many).verdict();
        assert!(
            text.contains("1 in cell3 and the others in 5 further cells."),
            "{text}"
        );
    }

    #[test]
    fn the_page_shows_every_cell_twice_and_its_row() {
        let html = page_of(vec![
            cell("100hz-<idle>", 70.0, 0),
            cell("5000hz-cpu", 90.0, 2),
        ])
        .html();
        assert!(!html.contains("NaN") && !html.contains("inf"), "{html}");
        assert!(!html.contains("<idle>") && html.contains("&lt;1&gt;"));
        assert_eq!(html.matches("<svg").count(), 3);
        for wanted in [
            "href=\"#cells\"",
            "aria-label=\"Latency of 5000hz-cpu and its parts\"",
            "identifier itself",
            "share of the cycles of a cell, logarithmic scale",
            "0.1 % or less",
            "own, by stage",
            "scripts/bench latency",
        ] {
            assert!(html.contains(wanted), "{wanted}");
        }
        // The late cycle of each cell has the weakest shade, beside that of the key.
        let weakest = html
            .lines()
            .filter(|line| line.contains("fill=\"var(--h1)\""));
        let weakest: Vec<usize> = weakest.map(|line| line.matches('M').count()).collect();
        assert!(
            weakest.len() >= 2 && weakest.iter().any(|count| *count >= 2),
            "{weakest:?}"
        );
        let empty = page_of(Vec::new()).html();
        assert!(empty.contains("No cell was measured.") && !empty.contains("NaN"));
    }

    #[test]
    fn a_histogram_keeps_its_counts() {
        let mut latency = Latency::new().unwrap();
        for ns in [80_000, 80_000, 25_000_000] {
            latency.record(ns);
        }
        let found = spectrum(&latency);
        assert_eq!(found.total(), 3);
        let [least, most] = ends([&found]).unwrap();
        assert!((70.0..=80.0).contains(&least) && (25_000.0..29_000.0).contains(&most));
    }
}
