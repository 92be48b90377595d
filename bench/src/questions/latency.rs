//! How long from the schedule to the action, under load, and whose misses are they?
//!
//! Without options the whole matrix of rates, loads and scheduling; with any of `--rate`, `--load`
//! and `--scheduling` those cells alone.

use std::error::Error;
use std::path::Path;

use clap::ValueEnum as _;
use serde_json::Value;
use vigil_bench::archive::{Archive, Outlet};
use vigil_bench::latency::cell::{Cell, Scheduling, Spec};
use vigil_bench::latency::load::Load;
use vigil_bench::latency::page::{ABOUT, CellFigures, HEADS, LatencyPage};
use vigil_bench::latency::{files, system};
use vigil_bench::percentile;
use vigil_cycle::latency::Percentiles;

/// Shortest run, s: the first two seconds are warm-up.
const SECONDS_MIN: f64 = 4.0;
/// Rates of the matrix, Hz.
const RATES_HZ: [f64; 3] = [100.0, 1000.0, 5000.0];

/// Measures the latency from the schedule to the action.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Rates of the schedule, Hz; separated by commas.
    #[arg(long, value_name = "HZ", value_delimiter = ',')]
    rate: Vec<f64>,
    /// Loads beside the graph; separated by commas.
    #[arg(long, value_delimiter = ',')]
    load: Vec<Load>,
    /// Scheduling of the graph; separated by commas.
    #[arg(long, value_delimiter = ',')]
    scheduling: Vec<Scheduling>,
    /// Time of each run of the graph, s.
    #[arg(long, value_name = "S", default_value_t = 20.0)]
    seconds: f64,
    /// Most hypotheses of the identifier, or its particles, 32 to 1024.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    particles: usize,
    /// The hierarchical filter identifies, and a wheel sticks at the beginning: every particle is
    /// stepped in every cycle.
    #[arg(long)]
    faulty: bool,
    /// Runs of each cell.
    #[arg(long, value_name = "N", default_value_t = 1)]
    repeat: usize,
    /// Name of the archive; else `latency` for the whole matrix, and for chosen cells
    /// `latency-CELL`, or `latency-cells` for several.
    #[arg(long, value_name = "NAME")]
    archive: Option<String>,
    /// Print the result as one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if args.seconds.is_nan() || args.seconds < SECONDS_MIN {
        return Err(format!(
            "--seconds {}: allowed is {SECONDS_MIN} or more",
            args.seconds
        )
        .into());
    }
    let specs = specs(args);
    vigil_bench::in_folder("latency", |folder| archive(args, &specs, folder))
}

/// True if no cell was chosen.
fn is_matrix(args: &Args) -> bool {
    args.rate.is_empty() && args.load.is_empty() && args.scheduling.is_empty()
}

/// Name of the archive: that of the matrix is its alone.
fn archive_name(args: &Args, specs: &[Spec]) -> String {
    let faulty = if args.faulty { "-faulty" } else { "" };
    match (&args.archive, specs) {
        (Some(name), _) => name.clone(),
        _ if is_matrix(args) => format!("latency{faulty}"),
        (None, [spec, others @ ..]) if others.iter().all(|other| other == spec) => {
            format!("latency-{}", spec.name())
        }
        _ => format!("latency-cells{faulty}"),
    }
}

/// The cells asked for, in order.
fn specs(args: &Args) -> Vec<Spec> {
    let is_matrix = is_matrix(args);
    let both = [Scheduling::Fifo, Scheduling::Other];
    let rates = or(&args.rate, if is_matrix { &RATES_HZ } else { &[1000.0] });
    let loads = or(
        &args.load,
        if is_matrix {
            Load::value_variants()
        } else {
            &[Load::Idle]
        },
    );
    let scheduling = or(&args.scheduling, if is_matrix { &both } else { &both[..1] });
    let mut specs = Vec::new();
    for &rate_hz in rates {
        for &load in loads {
            for &scheduling in scheduling {
                let spec = Spec {
                    rate_hz,
                    load,
                    scheduling,
                    seconds: args.seconds,
                    particles: args.particles,
                    is_faulty: args.faulty,
                };
                specs.extend(std::iter::repeat_n(spec, args.repeat.max(1)));
            }
        }
    }
    specs
}

/// What was given, or else the default.
const fn or<'a, T>(given: &'a [T], otherwise: &'a [T]) -> &'a [T] {
    if given.is_empty() { otherwise } else { given }
}

fn archive(args: &Args, specs: &[Spec], folder: &Path) -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new(&archive_name(args, specs), Outlet::by_flag(args.json))?;
    archive.say(&format!("{ABOUT}\n"));
    archive.say(&format!(
        "| {} |\n|{}",
        HEADS.join(" | "),
        "---|".repeat(HEADS.len())
    ));
    let mut page = LatencyPage {
        facts: archive.facts(),
        ..LatencyPage::default()
    };
    let mut cells = Vec::new();
    for (i, spec) in specs.iter().enumerate() {
        eprintln!("{} of {}: {}", i + 1, specs.len(), spec.name());
        let row = match spec.run(folder) {
            Ok(cell) => {
                if let Some(raw) = archive.folder() {
                    let name = format!("{:02}-{}", i + 1, spec.name());
                    files::write(&cell, &raw.join(name))?;
                }
                cells.push(cell.json());
                let run = (args.repeat > 1).then_some(i % args.repeat + 1);
                page.cells.push(CellFigures::new(&cell, run));
                row(&cell)
            }
            Err(error) => {
                let why = error.to_string().trim().replace('\n', "; ");
                let mut row = vec![spec.name(), format!("not measured: {why}")];
                row.resize(HEADS.len(), String::new());
                row
            }
        };
        archive.say(&format!("| {} |", row.join(" | ")));
        page.rows.push(row);
    }
    archive.store("machine.json", &system::facts())?;
    let unmeasured = specs.len() - cells.len();
    archive.store("cells.json", &Value::from(cells))?;
    archive.store_page("latency.html", &page.html())?;
    archive.close()?;
    if unmeasured > 0 {
        return Err(format!("{unmeasured} cells were not measured").into());
    }
    Ok(())
}

/// The row of a cell below [`HEADS`].
fn row(cell: &Cell) -> Vec<String> {
    let us = |ns: u64| format!("{:.1}", ns as f64 * 1e-3);
    let whole = cell.graph.end_to_end.percentiles();
    let hand_over = cell.graph.hand_over.percentiles();
    let floor = cell.floor.hand_over.percentiles();
    let tail = |q: f64, of: &Percentiles| {
        let ns = if q < 0.999 { of.p99_ns } else { of.p999_ns };
        percentile(q, of.n, us(ns))
    };
    let (ours, machine) = cell.missed();
    let over_canary = cell.machine_over_canary();
    let row: [String; HEADS.len()] = [
        cell.spec.name(),
        cell.cycles.len().to_string(),
        cell.folded().to_string(),
        us(whole.p50_ns),
        tail(0.99, &whole),
        tail(0.999, &whole),
        us(whole.max_ns),
        us(hand_over.p50_ns),
        tail(0.99, &hand_over),
        us(floor.p50_ns),
        tail(0.99, &floor),
        ours.to_string(),
        machine.to_string(),
        cell.not_one_stall().to_string(),
        over_canary.map_or_else(|| "-".into(), |times| format!("{times:.2}")),
        cell.own_by_stage(),
    ];
    row.to_vec()
}
