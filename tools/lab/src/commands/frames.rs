//! `vigil frames`: the frames of a recording as a table.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::{DetectionBelief, SensorFrame};
use vigil_cycle::topic::Topic;
use vigil_flight::{FlightError, FlightReader, Recorded, read_block};
use vigil_recording::RunWriter;
use vigil_robot::channel;
use vigil_terminal::{CommandError, Outcome, output};

/// Writes the frames of a recording as a table, to learn from, to diagnose or to play back.
///
/// A column for each command and channel; a pause or another run of the robot begins a new run.
/// Where in the table the detector's alarm rose is said.
///
/// Exit codes: 0 done, 1 the recording holds no frames of its robot, or is damaged: then what
/// comes before is written.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A recording of the black box, such as `vigil recordings` lists.
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// Where to write (CSV; compressed if the name ends in .gz).
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// The recording.
    recording: String,
    /// The file that was written.
    frames_file: String,
    /// Name of the robot.
    robot: String,
    /// Frames that were written.
    frames: u64,
    /// Runs in which they lie.
    runs: u32,
    /// Time that the runs cover.
    recorded_s: f64,
    /// When the detector's alarm rose.
    alarms: Vec<AlarmInTable>,
    /// Frames that were left out, as they carry no command or are of another robot.
    left_out: u64,
    /// Why the rest of the file cannot be read; null if all of it was.
    damaged: Option<String>,
}

/// An alarm, where the table has it.
#[derive(Debug, Serialize, JsonSchema)]
struct AlarmInTable {
    /// The run.
    run: u32,
    /// Time in the run.
    t_s: f64,
}

/// Writes the frames.
///
/// # Errors
/// A file that is no recording; a table that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    if is_same(&args.recording, &args.out) {
        return Err(CommandError::usage("--out names the recording itself"));
    }
    let document = write(&args.recording, &args.out)?;
    let printed = match args.json {
        true => output::json(&document),
        false => output::line(&text(&document)),
    };
    printed.map_err(CommandError::failure)?;
    Ok(match document.frames > 0 && document.damaged.is_none() {
        true => Outcome::Done,
        false => Outcome::Failed,
    })
}

/// True of two names of one file.
fn is_same(one: &Path, other: &Path) -> bool {
    let real = [one, other].map(|path| path.canonicalize().ok());
    real[0].is_some() && real[0] == real[1]
}

fn write(recording: &Path, out: &Path) -> Result<Document, CommandError> {
    let mut reader = FlightReader::open(recording).map_err(CommandError::usage)?;
    let setup = reader.setup().map_err(CommandError::usage)?;
    let robot_hash = channel::hash(&setup.robot);
    let mut writer = RunWriter::new(&setup.robot, setup.file.graph.rate_hz, out);
    let (mut strange, mut alarms, mut had_alarm) = (0, Vec::new(), None);
    let damaged = loop {
        match reader.next() {
            Ok(None) => break None,
            Ok(Some(Recorded::Block {
                topic: Topic::Sensor,
                bytes,
                ..
            })) => match read_block::<SensorFrame>(bytes) {
                Some(frame) if frame.robot_hash == robot_hash => {
                    writer.write(&frame).map_err(CommandError::failure)?;
                }
                _ => strange += 1,
            },
            Ok(Some(Recorded::Block {
                topic: Topic::Detection,
                bytes,
                ..
            })) => {
                if let Some(detection) = read_block::<DetectionBelief>(bytes) {
                    let has_alarm = detection.alarm != 0;
                    // One that stands when the recording begins has risen before.
                    let has_risen = has_alarm && had_alarm == Some(false);
                    had_alarm = Some(has_alarm);
                    let at = writer.place_of(detection.header.t_capture_ns);
                    let at = at.filter(|_| has_risen);
                    alarms.extend(at.map(|(run, t_s)| AlarmInTable { run, t_s }));
                }
            }
            Ok(Some(_)) => {}
            Err(error @ FlightError::Damaged { .. }) => break Some(error.to_string()),
            Err(error) => return Err(CommandError::failure(error)),
        }
    };
    let counts = writer.counts();
    writer.finish().map_err(CommandError::failure)?;
    Ok(Document {
        schema_version: 1,
        recording: recording.display().to_string(),
        frames_file: out.display().to_string(),
        robot: setup.robot.name,
        frames: counts.frames,
        runs: counts.runs,
        recorded_s: counts.recorded_s,
        alarms,
        left_out: counts.without_command + strange,
        damaged,
    })
}

fn text(document: &Document) -> String {
    let mut lines = vec![match document.frames {
        0 => format!("{}: no frames, nothing was written", document.recording),
        frames => format!(
            "{}: {frames} frames in {:.1} s, number of runs: {}",
            document.frames_file, document.recorded_s, document.runs
        ),
    }];
    let alarms = document.alarms.iter();
    let alarms = alarms.map(|it| format!("alarm: run {}, t_s {:.3}", it.run, it.t_s));
    lines.extend(alarms);
    if document.left_out > 0 {
        let count = document.left_out;
        lines.push(format!(
            "left out, without a command or of another robot: {count}"
        ));
    }
    lines.extend(document.damaged.clone());
    lines.join("\n")
}
