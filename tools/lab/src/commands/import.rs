//! `vigil import`: recordings of other programs as Vigil's frames.

pub mod look;
pub mod suggest;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;
use vigil_import::{self as import, LogDescription};
use vigil_learning::plausibility;
use vigil_robot::Description;
use vigil_setup::{load_robot, reference_of};

use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// What stands above the tables of the reference page.
const REFERENCE: &str = "# Log description

Every key of a log's description (`config/logs/*.toml`), which says what of another program's
recording is which channel. `vigil import --reference` prints this page from what the program reads,
`vigil import --suggest LOG` writes a first description of a log. An unknown key is an error with
file and line. A key without default is required.
";

/// Options with which no files of a described log are read.
const NO_FILES: [&str; 3] = ["look", "suggest", "reference"];

/// Turns the files of another program's log into frames of a described robot.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Description of the log (TOML): which columns of which files are which channels.
    #[arg(long, value_name = "LOG", required_unless_present_any = NO_FILES)]
    log: Option<PathBuf>,
    /// Folder of the log.
    #[arg(long, value_name = "FOLDER", required_unless_present_any = NO_FILES)]
    from: Option<PathBuf>,
    /// Where to write the frames (CSV; compressed if the name ends in .gz); with --suggest, the
    /// descriptions: FILE-log.toml and FILE-robot.toml.
    #[arg(short, long, value_name = "FILE", required_unless_present_any = ["look", "reference"])]
    out: Option<PathBuf>,
    /// Say what there is in a log: its topics or files, with rates, columns and ranges.
    #[arg(long, value_name = "LOG", conflicts_with_all = ["log", "from", "out", "suggest"])]
    look: Option<PathBuf>,
    /// Write a first description of a log and of its robot, to be corrected by hand.
    #[arg(long, value_name = "LOG", conflicts_with_all = ["log", "from"])]
    suggest: Option<PathBuf>,
    /// Print the reference page of a log's description, as Markdown.
    #[arg(long, conflicts_with_all = ["log", "from", "out", "look", "suggest", "json"])]
    reference: bool,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Name of the robot.
    robot: String,
    /// Path of the frames written.
    frames: String,
    /// Rate of the frames, Hz.
    rate_hz: f64,
    /// Columns of the frames.
    columns: Vec<String>,
    /// Channels that come late in the log.
    delays: Vec<DelayEstimate>,
    /// Channels that measure the same as others, and how they read against these.
    agreements: Vec<Agreement>,
    /// The runs, by number.
    runs: Vec<Run>,
}

/// How one channel reads against another that measures the same.
#[derive(Debug, Serialize, JsonSchema)]
struct Agreement {
    /// The channel, or what follows from it.
    measured: String,
    /// What it is compared with.
    against: String,
    /// How many times the other it reads; by least squares, without a constant.
    ratio: f64,
    /// Correlation without a constant, -1 to 1.
    correlation: f64,
}

/// A channel that comes late.
#[derive(Debug, Serialize, JsonSchema)]
struct DelayEstimate {
    /// The channel.
    channel: String,
    /// By how much, s.
    delay_s: f64,
}

/// A run of the frames.
#[derive(Debug, Serialize, JsonSchema)]
struct Run {
    /// Its number.
    run: u32,
    /// Where it comes from in the log.
    name: String,
    /// Its frames.
    frames: usize,
    /// Time of its last frame, s; its first is at 0.
    duration_s: f64,
    /// Clocks of its files that do not rise everywhere; their rows were put in order.
    disorder: Vec<DisorderCount>,
    /// Rows of which nothing was made, by channel: their stamps repeat those before.
    repeated_rows: BTreeMap<String, usize>,
}

/// A clock that does not rise everywhere.
#[derive(Debug, Serialize, JsonSchema)]
struct DisorderCount {
    /// Path of the file.
    file: String,
    /// Column of the clock.
    column: String,
    /// Rows that are earlier than the one before.
    rows: usize,
    /// The first of them; from 1, the header not counted.
    first_row: usize,
    /// By how much the worst of them goes back, s.
    back_s: f64,
}

impl From<&import::Disorder> for DisorderCount {
    fn from(found: &import::Disorder) -> Self {
        Self {
            file: found.path.display().to_string(),
            column: found.column.clone(),
            rows: found.rows,
            first_row: found.first_row,
            back_s: found.back_s,
        }
    }
}

/// Writes the frames and says what they are.
///
/// # Errors
/// An input that is refused; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    if args.reference {
        let page = reference_of::<LogDescription>(REFERENCE);
        output::line(page.trim_end()).map_err(CommandError::failure)?;
        return Ok(Outcome::Done);
    }
    if let Some(path) = &args.look {
        return look::run(path, args.json);
    }
    let out = args.out.as_deref().unwrap_or_else(|| Path::new(""));
    if let Some(path) = &args.suggest {
        return suggest::run(path, out, args.json);
    }
    match (&args.log, &args.from) {
        (Some(log), Some(from)) => import(&Paths { log, from, out }, args.json),
        _ => Err(CommandError::usage("--log and --from are required")),
    }
}

/// Files of an import.
struct Paths<'a> {
    log: &'a Path,
    from: &'a Path,
    out: &'a Path,
}

/// Reads, writes and reports.
fn import(paths: &Paths<'_>, is_json: bool) -> Result<Outcome, CommandError> {
    let Paths {
        log: path,
        from,
        out,
    } = *paths;
    let log = LogDescription::load(path).map_err(CommandError::usage)?;
    let robot = load_robot(&log.robot_path(path)).map_err(CommandError::usage)?;
    let imported = import::import(&log, &robot, from)
        .map_err(|error| at(path, &error))
        .map_err(CommandError::usage)?;
    imported.write(out).map_err(CommandError::failure)?;
    for warning in warnings(&imported, &robot) {
        eprintln!("warning: {warning}");
    }
    let runs = imported.runs.iter().map(|run| Run {
        run: run.id,
        name: run.name.clone(),
        frames: run.rows.len(),
        duration_s: run
            .rows
            .last()
            .and_then(|row| row.first())
            .copied()
            .unwrap_or(0.0),
        disorder: run.disorder.iter().map(DisorderCount::from).collect(),
        repeated_rows: run.repeated.iter().cloned().collect(),
    });
    let delays = imported
        .delays_s
        .iter()
        .map(|(channel, delay_s)| DelayEstimate {
            channel: channel.clone(),
            delay_s: *delay_s,
        });
    let agreements = import::agreements(&imported, &robot);
    for doubt in agreements.iter().filter_map(import::Agreement::doubt) {
        eprintln!("warning: {doubt}");
    }
    let agreements = agreements.into_iter().map(|found| Agreement {
        measured: found.measured,
        against: found.against,
        ratio: found.ratio,
        correlation: found.correlation,
    });
    let document = Document {
        schema_version: 1,
        robot: robot.name,
        frames: out.display().to_string(),
        rate_hz: log.rate_hz,
        columns: imported.columns.clone(),
        delays: delays.collect(),
        agreements: agreements.collect(),
        runs: runs.collect(),
    };
    let printed = if is_json {
        output::json(&document)
    } else {
        output::line(&table(&document))
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

/// What is doubtful about the frames: columns that mean something else, rows out of order.
fn warnings(imported: &import::ImportedLog, robot: &Description) -> Vec<String> {
    let frames = imported.frames(robot);
    let mut warnings = plausibility::warnings(frames.iter().map(|run| (run, f64::INFINITY)), robot);
    let lacking = imported.runs.iter().flat_map(|run| &run.lacking);
    warnings.extend(lacking.map(|found| {
        let import::MissingColumn {
            path,
            topic,
            column,
            rows,
            of,
        } = found;
        let which = match topic {
            Some(topic) => format!("messages on {topic}"),
            None => "rows".to_owned(),
        };
        format!(
            "{}: {rows} of {of} {which} lack a value, the first of them '{column}'",
            path.display()
        )
    }));
    let mut unstamped: Vec<&String> = imported.runs.iter().flat_map(|r| &r.unstamped).collect();
    unstamped.sort();
    unstamped.dedup();
    warnings.extend(unstamped.into_iter().map(|topic| {
        format!("messages on {topic} have no stamp: the time of recording took its place")
    }));
    let found = imported.runs.iter().flat_map(|run| &run.cut);
    warnings.extend(found.map(cut));
    let runs = imported.runs.iter();
    warnings.extend(runs.flat_map(|run| &run.disorder).map(|found| {
        let import::Disorder {
            path,
            column,
            rows,
            first_row,
            back_s,
        } = found;
        format!(
            "{}: row {first_row}: {column} goes back; {rows} rows do, by up to {back_s:.3} s: they \
             were put in order",
            path.display()
        )
    }));
    warnings
}

/// That a recording is cut off, and where.
fn cut(cut: &import::CutBag) -> String {
    let import::CutBag {
        path,
        messages,
        found,
    } = cut;
    format!(
        "{}: cut off after {messages} messages ({found}): what comes before was used",
        path.display()
    )
}

/// Problems of the description itself name its file.
fn at(log: &Path, error: &import::ImportError) -> String {
    match error {
        import::ImportError::Description { .. } => format!("{}: {error}", log.display()),
        _ => error.to_string(),
    }
}

fn table(document: &Document) -> String {
    let mut lines = vec![format!(
        "{}: {} at {} Hz",
        document.frames, document.robot, document.rate_hz
    )];
    for delay in &document.delays {
        lines.push(format!(
            "{} comes {:.3} s late; a live publisher must hold the others back by as much",
            delay.channel, delay.delay_s
        ));
    }
    for found in &document.agreements {
        let Agreement {
            measured,
            against,
            ratio,
            correlation,
        } = found;
        lines.push(format!(
            "{measured} is {ratio:.3} times {against} (correlation {correlation:.2})"
        ));
    }
    lines.push(format!(
        "{:>5} {:>8} {:>10}  from",
        "run", "frames", "length, s"
    ));
    for run in &document.runs {
        lines.push(format!(
            "{:>5} {:>8} {:>10.2}  {}",
            run.run, run.frames, run.duration_s, run.name
        ));
        for (channel, rows) in &run.repeated_rows {
            lines.push(format!(
                "      {channel}: {rows} rows repeat their stamp and count for none"
            ));
        }
    }
    lines.join("\n")
}
