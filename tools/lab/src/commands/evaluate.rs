//! `vigil evaluate`: detector and identifier over labelled recorded frames, scored.

mod document;
mod passes;

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser};
use schemars::JsonSchema;
use serde::Serialize;
use vigil_diagnosis::identify::IdentifierFilter;
use vigil_evaluation::report::{Report, SensorSet};
use vigil_learning::plausibility;
use vigil_recording::frames::Run;
use vigil_recording::labels::{self, Label};
use vigil_robot::RobotModel;

use super::files::{check_place, write_whole};
use super::labelled_runs::as_scored;
use super::offline::{FilterArgs, OfflineModels};
pub use document::Document;
use document::filters_text;
use passes::{Passes, SensorSetResult};
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Diagnoses recorded frames with labels and scores the result.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    filter: FilterArgs,
    /// Labels of the runs (CSV).
    #[arg(long, value_name = "FILE")]
    runs: PathBuf,
    /// Runs to score.
    #[arg(long, value_enum, default_value_t = Part::Heldout)]
    part: Part,
    /// Also write all figures as one page (HTML). It shows pose alone beside pose and encoders,
    /// whatever --sensors says. For a model without faults it shows detection only.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Also compare these identification filters with `multiple-hypothesis` on the same runs, for
    /// both sets of channels. Refused for a model without faults.
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        value_parser = PossibleValuesParser::new(filter_names())
    )]
    filters: Vec<String>,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// Every filter, and all of them.
fn filter_names() -> Vec<PossibleValue> {
    let names = IdentifierFilter::value_variants().iter();
    let names = names.filter_map(ValueEnum::to_possible_value);
    names.chain([PossibleValue::new("all")]).collect()
}

/// Part of the runs of the frames file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Part {
    /// The runs that `vigil learn` left out.
    Heldout,
    /// Every run of the frames file.
    All,
}

impl Args {
    /// Filters to compare, `multiple-hypothesis` first; none if none were asked for.
    fn entrants(&self) -> Vec<IdentifierFilter> {
        if self.filters.is_empty() {
            return Vec::new();
        }
        let asked = |filter: &IdentifierFilter| {
            let name = filter.to_string();
            self.filters
                .iter()
                .any(|asked| *asked == name || asked == "all")
        };
        let variants = IdentifierFilter::value_variants().iter().copied();
        let others = variants.filter(|f| *f != IdentifierFilter::MultipleHypothesis && asked(f));
        [IdentifierFilter::MultipleHypothesis]
            .into_iter()
            .chain(others)
            .collect()
    }

    /// Sets of channels to run, as `--sensors` names them: for a comparison all that the model has.
    fn sets(&self, model: &RobotModel) -> Vec<&str> {
        match self.report.is_some() || !self.filters.is_empty() {
            true => self.filter.sets(model),
            false => vec![self.filter.sensors.as_str()],
        }
    }

    /// The runs to score, and their labels.
    fn cases(&self, prepared: &OfflineModels) -> Result<Vec<(Run, Label)>, CommandError> {
        let labels = labels::read(&self.runs, &prepared.robot).map_err(CommandError::usage)?;
        let scored = |label: Label| (label.run, as_scored(&label, &prepared.robot));
        let labels = labels.into_iter().map(scored);
        let mut labels: BTreeMap<u32, Label> = labels.collect();
        let wanted = self.part(&prepared.model, &prepared.runs)?;
        let with_label = wanted.into_iter().map(|run| match labels.remove(&run.id) {
            Some(label) => Ok((run.clone(), label)),
            None => {
                let (file, run) = (self.runs.display(), run.id);
                let message = format!("{file}: there is no label of run {run}");
                Err(CommandError::usage(message))
            }
        });
        with_label.collect()
    }

    fn part<'a>(&self, model: &RobotModel, runs: &'a [Run]) -> Result<Vec<&'a Run>, CommandError> {
        if self.part == Part::All {
            return Ok(runs.iter().collect());
        }
        let held_out = &model.provenance().runs_held_out;
        let wanted: Vec<&Run> = runs.iter().filter(|r| held_out.contains(&r.id)).collect();
        if wanted.is_empty() {
            let (model, frames) = (self.filter.model.display(), self.filter.frames.display());
            let message = format!(
                "{model} left out {} runs, none of which is in {frames}; score every run with \
                 --part all",
                held_out.len()
            );
            return Err(CommandError::usage(message));
        }
        Ok(wanted)
    }
}

/// Prints the score and writes the report.
///
/// # Errors
/// An input that is refused; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    if let Some(out) = &args.report {
        check_place("--report", out)?;
    }
    let prepared = args.filter.prepare()?;
    if matches!(prepared.model, RobotModel::Channels(_)) && !args.filters.is_empty() {
        return Err(args.filter.names_nothing("--filters"));
    }
    let runs = args.cases(&prepared)?;
    let healthy = |label: &Label| label.onset_s.unwrap_or(f64::INFINITY);
    let beginnings = runs.iter().map(|(run, label)| (run, healthy(label)));
    for warning in plausibility::warnings(beginnings, &prepared.robot) {
        eprintln!("warning: {}: {warning}", args.filter.frames.display());
    }
    let (sets, entrants) = (args.sets(&prepared.model), args.entrants());
    let passes = Passes::new(args, &prepared, &runs);
    let found = passes.run(&sets, &entrants)?;
    if let Some(out) = &args.report {
        let page = page(args, &prepared, &runs, &found);
        write_whole(out, &page)?;
    }
    print(args, &prepared, &found)?;
    Ok(Outcome::Done)
}

fn print(
    args: &Args,
    prepared: &OfflineModels,
    found: &[SensorSetResult],
) -> Result<(), CommandError> {
    let Some(asked) = found.iter().find(|set| set.name == args.filter.sensors) else {
        return Err(CommandError::failure("the set of channels was not run"));
    };
    let several = args.report.is_some() || !args.filters.is_empty();
    let printed = if args.json {
        output::json(&Document::new(
            args.part,
            &prepared.used,
            asked,
            found,
            several,
        ))
    } else {
        let filters: String = found.iter().filter_map(filters_text).collect();
        output::line(&format!("{}{filters}", asked.score))
    };
    printed.map_err(CommandError::failure)
}

fn page(
    args: &Args,
    prepared: &OfflineModels,
    runs: &[(Run, Label)],
    found: &[SensorSetResult],
) -> String {
    let sets = found.iter().map(|set| SensorSet {
        name: &set.name,
        score: &set.score,
        cases: &set.cases,
        contest: set.contest.as_ref(),
    });
    let report = Report {
        facts: facts(args, prepared, runs),
        sets: sets.collect(),
        taxonomy: &prepared.taxonomy,
    };
    report.html()
}

/// What the report says of its origin.
fn facts(
    args: &Args,
    prepared: &OfflineModels,
    runs: &[(Run, Label)],
) -> Vec<(&'static str, String)> {
    let part = match args.part {
        Part::Heldout => "those that learning left out",
        Part::All => "all of the frames file",
    };
    let ids: Vec<String> = runs.iter().map(|(run, _)| run.id.to_string()).collect();
    let mut facts = args.filter.facts(prepared);
    facts.extend([
        ("labels", args.runs.display().to_string()),
        ("runs", format!("{}, {part}", runs.len())),
        ("run ids", ids.join(" ")),
    ]);
    facts
}
