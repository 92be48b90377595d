//! `vigil record`: the frames of a publisher as a file, to learn from or to play back; or all that
//! a running graph publishes.

mod flight;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::Rejection;
use vigil_recording::RunWriter;
use vigil_setup::GraphArgs;
use vigil_terminal::{CommandError, Outcome, output};

use crate::publisher;

/// What was recorded is told so often.
const TOLD: Duration = Duration::from_secs(10);

/// Writes the frames of a publisher to a table, or all of a running graph to a recording.
///
/// A name that ends in .mcap means a recording as the black box writes, of any length, from now on:
/// `vigil report` and `vigil replay` read it. It goes to FILE.part while it grows, and the graph's
/// own black box goes on beside it.
///
/// Any other name means frames as CSV, to learn from or to play back. They are taken beside a
/// running graph, or in its place while none runs: a model need not be there yet. A pause, a jump
/// of the clock or another `run_id` begins a new run. Frames that a graph would refuse are left out
/// and counted.
///
/// It ends with Ctrl-C, or after --duration. Exit codes: 0 done, 1 nothing came, 2 refused.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    graph: GraphArgs,
    /// Where to write: a recording if the name ends in .mcap, else frames (CSV; compressed if it
    /// ends in .gz).
    #[arg(
        value_name = "FILE",
        required_unless_present = "out",
        conflicts_with = "out"
    )]
    file: Option<PathBuf>,
    /// The same as FILE.
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Time to record, s; until Ctrl-C if it is not given.
    #[arg(long, value_name = "S", visible_alias = "seconds")]
    duration: Option<f64>,
    /// Replace FILE if it is there. A table of frames is replaced without it.
    #[arg(long)]
    force: bool,
    /// Print one JSON document; its schema: `vigil schema record`, of a recording
    /// `vigil schema record-mcap`.
    #[arg(long)]
    json: bool,
}

impl Args {
    fn path(&self) -> &Path {
        let path = self.file.as_ref().or(self.out.as_ref());
        path.map_or(Path::new(""), PathBuf::as_path)
    }
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// The file that was written.
    frames_file: String,
    /// Frames that were written.
    frames: u64,
    /// Runs in which they lie.
    runs: u32,
    /// Time that the runs cover.
    recorded_s: f64,
    /// Frames that were left out, by cause.
    refused: BTreeMap<&'static str, u64>,
}

/// Records; outcome `Failed` if no frame came.
///
/// # Errors
/// Options that do not go together, a configuration that is refused, a graph that does not run, a
/// file that cannot be written, a transport that fails.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let seconds = args.duration.unwrap_or(f64::INFINITY);
    if seconds.is_nan() || seconds < 0.1 {
        let message = format!("--duration {seconds}: allowed is 0.1 or more");
        return Err(CommandError::usage(message));
    }
    match (flight::is_meant(args.path()), args.force) {
        (true, _) => match flight::record(args)? {},
        (false, true) => Err(CommandError::usage(
            "--force goes with a recording (FILE.mcap) only",
        )),
        (false, false) => record_frames(args, seconds),
    }
}

fn record_frames(args: &Args, seconds: f64) -> Result<Outcome, CommandError> {
    let mut border = args.graph.border().map_err(CommandError::usage)?;
    border.file.sensor.source = publisher::source(&border).map_err(CommandError::failure)?;
    let mut table = RunWriter::new(&border.robot, border.file.graph.rate_hz, args.path());
    let mut failed = None;
    if !args.json {
        let graph = &border.file.graph.name;
        eprintln!("recording what publishers send to graph '{graph}'; end with Ctrl-C");
    }
    let mut told = Instant::now();
    let listened = publisher::listen(&border, seconds, &mut |_, arrival, is_taken| {
        // After a failure nothing more is written.
        if is_taken && failed.is_none() {
            failed = table.write(&arrival.frame).err();
            if let Some(error) = &failed {
                eprintln!("error: {error}; nothing more is written: end with Ctrl-C");
            }
        }
        if told.elapsed() >= TOLD && !args.json {
            told = Instant::now();
            let counts = table.counts();
            eprintln!("{:8.1} s  {} frames", counts.recorded_s, counts.frames);
        }
    });
    let (heard, unheard) = listened.map_err(CommandError::failure)?;
    let rejected = heard
        .rejected
        .iter()
        .enumerate()
        .filter(|(_, count)| **count > 0);
    let refused = rejected.map(|(code, count)| {
        let cause = Rejection::from_repr(code as u32);
        (cause.map_or("?", Rejection::as_str), *count)
    });
    let counts = table.counts();
    let uncommanded = ("no command", counts.without_command);
    let uncommanded = Some(uncommanded).filter(|(_, count)| *count > 0);
    let document = Document {
        schema_version: 1,
        frames_file: args.path().display().to_string(),
        frames: counts.frames,
        runs: counts.runs,
        recorded_s: counts.recorded_s,
        refused: refused.chain(uncommanded).collect(),
    };
    failed
        .map_or_else(|| table.finish(), Err)
        .map_err(CommandError::failure)?;
    if let Some(error) = unheard {
        return Err(CommandError::failure(error));
    }
    let printed = match args.json {
        true => output::json(&document),
        false => output::line(&text(&document)),
    };
    printed.map_err(CommandError::failure)?;
    Ok(match document.frames {
        0 => Outcome::Failed,
        _ => Outcome::Done,
    })
}

fn text(document: &Document) -> String {
    let mut lines = vec![match document.frames {
        0 => "no frame came: nothing was written".to_owned(),
        frames => format!(
            "{}: {frames} frames, {} runs, {:.1} s",
            document.frames_file, document.runs, document.recorded_s
        ),
    }];
    let refused = document.refused.iter();
    lines.extend(refused.map(|(cause, count)| format!("left out: {count} frames ({cause})")));
    lines.join("\n")
}
