//! `vigil evaluate`: detector and identifier over labelled recorded frames, scored.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::ValueEnum;
use serde::Serialize;
use vigil_evaluation::labels::{self, Label};
use vigil_evaluation::scoring::{self, Case, Score};

use super::offline::{FilterArgs, Prepared, Used};
use super::{CommandError, Outcome};
use crate::output::{self, Progress};

/// Runs detector and identifier offline over labelled frames and scores them.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    filter: FilterArgs,
    /// Labels of the runs (CSV).
    #[arg(long, value_name = "R")]
    runs: PathBuf,
    /// Runs to score.
    #[arg(long, value_enum, default_value_t = Part::Heldout)]
    part: Part,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// Part of the runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
enum Part {
    /// The runs that `vigil learn` left out.
    Heldout,
    /// Every run of the frames file.
    All,
}

#[derive(Debug, Serialize)]
struct Document<'a> {
    schema_version: u32,
    part: Part,
    #[serde(flatten)]
    used: &'a Used,
    #[serde(flatten)]
    score: &'a Score,
}

/// Prints the score.
///
/// # Errors
/// An input that is refused.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let Prepared {
        robot,
        model,
        mut pipeline,
        mut runs,
        used,
    } = args.filter.prepare()?;
    let labels = labels::read(&args.runs, &robot).map_err(CommandError::usage)?;
    let mut labels: BTreeMap<u32, Label> =
        labels.into_iter().map(|label| (label.run, label)).collect();
    if args.part == Part::Heldout {
        let held_out = model.runs_held_out();
        runs.retain(|run| held_out.contains(&run.id));
        if runs.is_empty() {
            let (model, frames) = (args.filter.model.display(), args.filter.frames.display());
            let message = format!(
                "{model} left out {} runs, none of which is in {frames}; score every run with \
                 --part all",
                held_out.len()
            );
            return Err(CommandError::usage(message));
        }
    }
    if let Some(run) = runs.iter().find(|run| !labels.contains_key(&run.id)) {
        let message = format!(
            "{}: there is no label of run {}",
            args.runs.display(),
            run.id
        );
        return Err(CommandError::usage(message));
    }
    let mut cases = Vec::with_capacity(runs.len());
    let progress = Progress::new("runs", runs.len());
    for (done, run) in runs.iter().enumerate() {
        progress.show(done);
        let Some(label) = labels.remove(&run.id) else {
            continue;
        };
        let mut verdicts = Vec::with_capacity(run.frames.len());
        pipeline.run(run, |verdict| verdicts.push(verdict));
        cases.push(Case { label, verdicts });
    }
    drop(progress);
    let score = scoring::score(&cases, pipeline.taxonomy());
    let (part, used) = (args.part, &used);
    let printed = if args.json {
        output::json(&Document {
            schema_version: 1,
            part,
            used,
            score: &score,
        })
    } else {
        output::line(&score.to_string())
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}
