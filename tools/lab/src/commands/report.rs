//! `vigil report`: recorded runs as one page to read, without labels.

use std::path::PathBuf;

use vigil_evaluation::report;
use vigil_evaluation::scoring::Case;
use vigil_recording::labels::Label;

use super::files::{check_place, write_whole};
use super::offline::FilterArgs;
use vigil_terminal::output::Progress;
use vigil_terminal::{CommandError, Outcome};

/// Diagnoses recorded frames without labels and writes one page: what was believed in each run over
/// time, and each change of alarm, name and action.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    filter: FilterArgs,
    /// Where to write the page (HTML).
    #[arg(long, value_name = "OUT")]
    out: PathBuf,
}

/// Writes the page.
///
/// # Errors
/// An input that is refused; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    check_place("--out", &args.out)?;
    let models = args.filter.prepare()?;
    let (set, filter) = (&args.filter.sensors, args.filter.identifier);
    let initial = args.filter.initial(&models, set, filter)?;
    let progress = Progress::new("runs", models.runs.len());
    let mut cases = Vec::new();
    for run in &models.runs {
        progress.show(cases.len());
        cases.push(Case {
            label: unlabelled(run.id),
            verdicts: initial.verdicts(run)?,
        });
    }
    let facts = args.filter.facts(&models);
    let page = report::unlabelled(&facts, &cases, set, &models.taxonomy);
    write_whole(&args.out, &page)?;
    Ok(Outcome::Done)
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
