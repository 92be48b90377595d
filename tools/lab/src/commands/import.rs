//! `vigil import`: recordings of other programs as Vigil's frames.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;
use vigil_import::{self as import, LogDescription};
use vigil_learning::plausibility;
use vigil_robot::Description;
use vigil_setup::load_robot;

use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Turns the files of another program's log into frames of a described robot.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Description of the log (TOML): which columns of which files are which channels.
    #[arg(long, value_name = "LOG")]
    log: PathBuf,
    /// Folder of the log.
    #[arg(long, value_name = "DIR")]
    from: PathBuf,
    /// Where to write the frames (CSV; compressed if the name ends in .gz).
    #[arg(long, value_name = "F")]
    out: PathBuf,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Document {
    schema_version: u32,
    robot: String,
    frames: String,
    rate_hz: f64,
    columns: Vec<String>,
    delays: Vec<DelayEstimate>,
    runs: Vec<Run>,
}

#[derive(Debug, Serialize)]
struct DelayEstimate {
    channel: String,
    delay_s: f64,
}

#[derive(Debug, Serialize)]
struct Run {
    run: u32,
    name: String,
    frames: usize,
    duration_s: f64,
    /// Clocks of its files that do not rise everywhere; their rows were put in order.
    disorder: Vec<DisorderCount>,
    /// Rows of which nothing was made, by channel: their stamps repeat those before.
    repeated_rows: BTreeMap<String, usize>,
}

#[derive(Debug, Serialize)]
struct DisorderCount {
    file: String,
    column: String,
    rows: usize,
    first_row: usize,
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
    let log = LogDescription::load(&args.log).map_err(CommandError::usage)?;
    let robot = load_robot(&log.robot_path(&args.log)).map_err(CommandError::usage)?;
    let imported = import::import(&log, &robot, &args.from)
        .map_err(|error| at(&args.log, &error))
        .map_err(CommandError::usage)?;
    import::write(&imported, &args.out).map_err(CommandError::failure)?;
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
    let document = Document {
        schema_version: 1,
        robot: robot.name,
        frames: args.out.display().to_string(),
        rate_hz: log.rate_hz,
        columns: imported.columns.clone(),
        delays: delays.collect(),
        runs: runs.collect(),
    };
    let printed = if args.json {
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
            messages,
            of,
        } = found;
        format!(
            "{}: {messages} of {of} messages on {topic} have no finite '{column}': nothing was \
             made of them",
            path.display()
        )
    }));
    let mut unstamped: Vec<&String> = imported.runs.iter().flat_map(|r| &r.unstamped).collect();
    unstamped.sort();
    unstamped.dedup();
    warnings.extend(unstamped.into_iter().map(|topic| {
        format!("messages on {topic} have no stamp: the time of recording took its place")
    }));
    let cut = imported.runs.iter().flat_map(|run| &run.cut);
    warnings.extend(cut.map(|found| {
        let import::CutBag {
            path,
            messages,
            found,
        } = found;
        format!(
            "{}: cut off after {messages} messages ({found}): what comes before was used",
            path.display()
        )
    }));
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
