//! `vigil import`: recordings of other programs as Vigil's frames.

use std::path::{Path, PathBuf};

use serde::Serialize;
use vigil_evaluation::import::{self, LogDescription};
use vigil_setup::load_robot;

use super::{CommandError, Outcome};
use crate::output;

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
    delays: Vec<Estimated>,
    runs: Vec<Run>,
}

#[derive(Debug, Serialize)]
struct Estimated {
    channel: String,
    delay_s: f64,
}

#[derive(Debug, Serialize)]
struct Run {
    run: u32,
    name: String,
    frames: usize,
    duration_s: f64,
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
    });
    let delays = imported
        .delays_s
        .iter()
        .map(|(channel, delay_s)| Estimated {
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

/// Problems of the description itself are told with its file.
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
    }
    lines.join("\n")
}
