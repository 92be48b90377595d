//! `vigil record`: the frames of a publisher as a file, to learn from or to play back; or all that
//! a running graph publishes.

mod flight;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::{COMMANDS, Rejection, SensorFrame};
use vigil_recording::FrameWriter;
use vigil_recording::frames::{Field, fields};
use vigil_recording::table::TableError;
use vigil_robot::Description;
use vigil_setup::GraphArgs;
use vigil_terminal::{CommandError, Outcome, output};

use crate::publisher;

/// A pause of the capture times after which a new run begins, s: a recording with a longer gap in a
/// run is refused where it is read.
const PAUSE_S: f64 = 0.9;
/// The same in periods of the graph.
const PAUSE_PERIODS: f64 = 9.0;
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
    /// Print one JSON document, of frames only.
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
    let mut recording = Recording::new(&border.robot, border.file.graph.rate_hz, args.path());
    if !args.json {
        let graph = &border.file.graph.name;
        eprintln!("recording what publishers send to graph '{graph}'; end with Ctrl-C");
    }
    let mut told = Instant::now();
    let listened = publisher::listen(&border, seconds, &mut |_, arrival, is_taken| {
        if is_taken {
            recording.take(&arrival.frame);
        }
        if told.elapsed() >= TOLD && !args.json {
            told = Instant::now();
            eprintln!(
                "{:8.1} s  {} frames",
                recording.recorded_s, recording.frames
            );
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
    let uncommanded = ("no command", recording.without_command);
    let uncommanded = Some(uncommanded).filter(|(_, count)| *count > 0);
    let document = Document {
        schema_version: 1,
        frames_file: args.path().display().to_string(),
        frames: recording.frames,
        runs: recording.runs,
        recorded_s: recording.recorded_s,
        refused: refused.chain(uncommanded).collect(),
    };
    recording.finish().map_err(CommandError::failure)?;
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

/// A file of frames that grows.
struct Recording<'a> {
    robot: &'a Description,
    path: &'a Path,
    pause_ns: u64,
    /// Made with the first frame, which says what of the optional channels is measured.
    file: Option<FrameWriter>,
    fields: Vec<Field>,
    run: Option<PresentRun>,
    runs: u32,
    frames: u64,
    recorded_s: f64,
    /// Frames without the whole command: nothing can be predicted from them.
    without_command: u64,
    failed: Option<TableError>,
}

/// The run to which the last frame belonged; first capture and last, ns.
struct PresentRun {
    id: u64,
    epoch: u64,
    from_ns: u64,
    last_ns: u64,
}

impl<'a> Recording<'a> {
    fn new(robot: &'a Description, rate_hz: f64, path: &'a Path) -> Self {
        Self {
            robot,
            path,
            pause_ns: (PAUSE_S.min(PAUSE_PERIODS / rate_hz) * 1e9) as u64,
            file: None,
            fields: Vec::new(),
            run: None,
            runs: 0,
            frames: 0,
            recorded_s: 0.0,
            without_command: 0,
            failed: None,
        }
    }

    /// Writes a frame; after a failure nothing more.
    fn take(&mut self, frame: &SensorFrame) {
        if self.failed.is_some() {
            return;
        }
        if let Err(error) = self.write(frame) {
            eprintln!("error: {error}; nothing more is written: end with Ctrl-C");
            self.failed = Some(error);
        }
    }

    fn write(&mut self, frame: &SensorFrame) -> Result<(), TableError> {
        let axes = self.robot.command.len().min(COMMANDS);
        if (0..axes).any(|axis| frame.commanded(axis).is_none()) {
            self.without_command += 1;
            return Ok(());
        }
        if self.file.is_none() {
            let is_there = |field: &Field| !field.is_optional() || field.get(frame).is_some();
            let all = fields(self.robot).into_iter();
            let (names, fields) = all.filter(|(_, field)| is_there(field)).unzip();
            let names: Vec<String> = names;
            self.fields = fields;
            self.file = Some(FrameWriter::create(self.path, &names)?);
        }
        let now_ns = frame.header.t_capture_ns;
        let goes_on = |run: &PresentRun| {
            (run.id, run.epoch) == (frame.run_id, frame.header.epoch)
                && (run.last_ns + 1..run.last_ns.saturating_add(self.pause_ns)).contains(&now_ns)
        };
        let from_ns = match &mut self.run {
            Some(run) if goes_on(run) => {
                self.recorded_s += (now_ns - run.last_ns) as f64 * 1e-9;
                run.last_ns = now_ns;
                run.from_ns
            }
            run => {
                *run = Some(PresentRun {
                    id: frame.run_id,
                    epoch: frame.header.epoch,
                    from_ns: now_ns,
                    last_ns: now_ns,
                });
                self.runs += 1;
                now_ns
            }
        };
        self.frames += 1;
        let t_s = (now_ns - from_ns) as f64 * 1e-9;
        let values = self.fields.iter().map(|field| field.get(frame));
        match &mut self.file {
            Some(file) => file.row(self.runs - 1, t_s, values),
            None => Ok(()),
        }
    }

    fn finish(self) -> Result<(), TableError> {
        if let Some(error) = self.failed {
            return Err(error);
        }
        self.file.map_or(Ok(()), FrameWriter::finish)
    }
}
