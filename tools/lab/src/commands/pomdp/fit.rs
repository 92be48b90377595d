//! `vigil pomdp fit`: parameters of a model from recorded missions.

use std::fmt::Display;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use vigil_missions::learning::{Record, file};
use vigil_missions::{Fit, FittedChance, exceptions, recovery};
use vigil_pomdp::Pomdp;
use vigil_terminal::{CommandError, Outcome};

use super::parameters::{ModelKind, ParameterFile};
use super::{print, save};

/// Fits the chances of a file of parameters to missions whose true states are recorded.
///
/// Each chance is counted; the number in the file counts as --prior-strength visits. What no
/// mission shows, and what the file rules out with a 0, stays as it is; so do rewards and prices.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Parameters of a model of exceptions or of recovery, such as config/corridor.recovery.toml
    /// or config/rover.recovery.toml.
    parameters: PathBuf,
    /// Missions with states (JSON lines, see `vigil pomdp simulate`).
    #[arg(long, value_name = "FILE")]
    missions: PathBuf,
    /// Visits that a number in the file counts as, from 0.
    #[arg(long, value_name = "K", default_value_t = 10.0, value_parser = weight)]
    prior_strength: f64,
    /// Where to write the fitted parameters (TOML, without comments).
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Path of the parameters read.
    parameters_file: String,
    /// Path of the missions.
    missions_file: String,
    /// Missions read.
    missions: usize,
    /// Steps that were counted: those whose true states are known.
    steps: usize,
    /// Visits that a number in the file counts as.
    prior_strength: f64,
    /// The fitted numbers, in the order of the file.
    chances: Vec<FittedChance>,
}

/// Runs the command.
///
/// # Errors
/// Files and options that are refused; a file that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let file = ParameterFile::read(&args.parameters)?;
    match file.model {
        ModelKind::Exceptions => run_for(args, &file, exceptions::generate, exceptions::fit),
        ModelKind::Recovery => run_for(args, &file, recovery::generate, recovery::fit),
        ModelKind::Navigation => Err(file.refused(
            &"nothing counts the paper's navigation: allowed are models of exceptions and recovery",
        )),
    }
}

fn run_for<P: DeserializeOwned + Serialize, E: Display>(
    args: &Args,
    file: &ParameterFile,
    generate: impl Fn(&P) -> Result<String, E>,
    fit: impl Fn(&P, &Pomdp, &[Record], f64) -> Fit<P>,
) -> Result<Outcome, CommandError> {
    let parameters: P = file.parsed()?;
    let model = generate(&parameters).map_err(|e| file.refused(&e))?;
    let model = Pomdp::parse(&model).map_err(|e| file.refused(&e))?;
    let flown = file::read(&args.missions, &model).map_err(CommandError::usage)?;
    let Fit {
        parameters,
        chances,
        steps,
    } = fit(&parameters, &model, &flown.records, args.prior_strength);
    if steps == 0 {
        let missions = args.missions.display();
        let problem = "no step with known states: allowed are missions with 'states'";
        return Err(CommandError::usage(format!("{missions}: {problem}")));
    }
    // What is written makes a model.
    generate(&parameters).map_err(|e| file.refused(&format!("fitted: {e}")))?;
    let document = Document {
        schema_version: 1,
        parameters_file: args.parameters.display().to_string(),
        missions_file: args.missions.display().to_string(),
        missions: flown.records.len(),
        steps,
        prior_strength: args.prior_strength,
        chances,
    };
    if let Some(out) = &args.out {
        let text = toml::to_string(&parameters).map_err(CommandError::failure)?;
        save(out, text)?;
    }
    print(args.json, &document, || text_of(&document))?;
    Ok(Outcome::Done)
}

fn text_of(document: &Document) -> String {
    let width = document.chances.iter().map(|c| c.key.len()).max();
    let width = width.unwrap_or(0);
    let mut lines = vec![
        format!(
            "{} records of missions, {} steps counted",
            document.missions, document.steps
        ),
        format!("{:width$}  by hand  fitted  95 %            counted", ""),
    ];
    lines.extend(document.chances.iter().map(|chance| {
        let [low, high] = chance.interval;
        format!(
            "{:width$}  {:7.4}  {:6.4}  {low:.4} to {high:.4}  {:.0} of {:.0}",
            chance.key, chance.by_hand, chance.fitted, chance.count, chance.visits
        )
    }));
    lines.join("\n")
}

fn weight(text: &str) -> Result<f64, String> {
    let number = text.parse().ok();
    let number = number.filter(|n: &f64| n.is_finite() && *n >= 0.0);
    number.ok_or_else(|| "allowed is a number from 0".to_owned())
}
