//! `vigil report`: a recording, or recorded runs without labels, as one page to read.

use std::path::{Path, PathBuf};

use clap::{ArgMatches, Command, Error, FromArgMatches};
use vigil_evaluation::report;
use vigil_evaluation::scoring::Case;
use vigil_recording::labels::Label;

use super::files::{check_place, write_whole};
use super::offline::FilterArgs;
use vigil_terminal::output::Progress;
use vigil_terminal::{CommandError, Outcome, output};

/// Writes one page (HTML) about a recording of the black box, or about recorded frames.
///
/// Of a recording (MCAP), it says what was wrong, and shows beliefs, faults, actions, path,
/// latencies and health over time. What was believed then is shown as it was.
///
/// Of frames (CSV; --model and --frames), it diagnoses each run anew. It shows what was believed,
/// and each change of alarm, name and action. All options but --out are about frames.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A recording of the black box, such as `vigil recordings` lists; one that is cut short is
    /// shown as far as it goes.
    #[arg(value_name = "RECORDING")]
    recording: Option<PathBuf>,
    #[command(flatten)]
    frames: FramesArgs,
    /// Where to write the page (HTML).
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
}

/// Frames to diagnose, unless there is a recording.
#[derive(Debug)]
struct FramesArgs(Option<FilterArgs>);

impl FromArgMatches for FramesArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let is_there = matches.contains_id("frames");
        let filter = is_there.then(|| FilterArgs::from_arg_matches(matches));
        filter.transpose().map(Self)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl clap::Args for FramesArgs {
    fn augment_args(command: Command) -> Command {
        let command = <FilterArgs as clap::Args>::augment_args(command);
        command.mut_args(|arg| match arg.get_id().as_str() {
            "recording" => arg,
            "model" => arg
                .required(false)
                .requires("frames")
                .conflicts_with("recording"),
            "frames" => arg
                .required(false)
                .requires("model")
                .conflicts_with("recording"),
            _ => arg.conflicts_with("recording"),
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        <Self as clap::Args>::augment_args(command)
    }
}

/// Writes the page.
///
/// # Errors
/// An input that is refused; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    check_place("--out", &args.out)?;
    let page = match (&args.recording, &args.frames.0) {
        (Some(recording), _) => of_recording(recording)?,
        (None, Some(filter)) => of_frames(filter)?,
        (None, None) => {
            let wanted = "give a RECORDING (MCAP), or frames with --model and --frames";
            return Err(CommandError::usage(wanted));
        }
    };
    write_whole(&args.out, &page)?;
    let said = format!("page: {}", args.out.display());
    output::line(&said).map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

fn of_recording(path: &Path) -> Result<String, CommandError> {
    vigil_flight_page::page(path).map_err(CommandError::usage)
}

fn of_frames(filter: &FilterArgs) -> Result<String, CommandError> {
    let models = filter.prepare()?;
    let initial = filter.initial(&models, &filter.sensors, filter.identifier)?;
    let progress = Progress::new("runs", models.runs.len());
    let mut cases = Vec::new();
    for run in &models.runs {
        progress.show(cases.len());
        cases.push(Case {
            label: unlabelled(run.id),
            verdicts: initial.verdicts(run)?,
        });
    }
    let facts = filter.facts(&models);
    Ok(report::unlabelled(
        &facts,
        &cases,
        &filter.sensors,
        &models.taxonomy,
    ))
}

/// Of a run of which nothing is known.
fn unlabelled(run: u32) -> Label {
    Label {
        run,
        mode: String::new(),
        kind: String::new(),
        wheel: None,
        onset_s: None,
        command_curvature_1_m: f64::NAN,
        command_speed_m_s: f64::NAN,
        duration_s: f64::NAN,
        group: String::new(),
    }
}
