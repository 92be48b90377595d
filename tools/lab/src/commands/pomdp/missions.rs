//! `vigil pomdp missions`: missions for `learn` from what graphs have recorded.

use std::io::Write;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vigil_missions::learning::{Record, file};
use vigil_pomdp::Pomdp;
use vigil_terminal::{CommandError, Outcome};

use super::{bytes_of, load, print, save};

/// Layout of a run's document.
const RUN_VERSION: u32 = 1;

/// Gathers the decision model's steps of recorded runs, as `vigil pomdp learn` reads them.
///
/// A RUN is what `scripts/up --json` prints at its end. Steps are recorded by graphs that decide by
/// symptoms. A mission ends where the belief began anew: at a reset, at a run that no action
/// brought about, when the supervisor was started again. From a step on that is missing, or whose
/// symptoms MODEL does not have, the rest of a mission is left out, and counted. Rewards are not
/// recorded: `learn` takes such missions with --world or --unchecked.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recorded runs.
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// The model that they decided by (.pomdp or .pomdpx).
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Where to write the missions (JSON lines).
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What is needed of a run's document.
#[derive(Debug, Deserialize)]
struct Run {
    schema_version: u32,
    graph: String,
    events: Vec<Event>,
}

#[derive(Debug, Deserialize)]
struct Event {
    service: String,
    event: String,
    step: Option<Step>,
}

#[derive(Debug, Deserialize)]
struct Step {
    number: u64,
    belief: u32,
    action: String,
    observation: Option<String>,
}

/// What it prints with --json.
#[derive(Debug, Default, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Runs read.
    runs: usize,
    /// Missions written.
    missions: usize,
    /// Their steps.
    steps: usize,
    /// Steps left out: they follow one that is missing or that the model cannot observe.
    left_out: usize,
    /// Path of the missions.
    out: String,
}

/// Runs the command.
///
/// # Errors
/// Files that are refused, runs without a step; a file that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let model = load(&args.model)?;
    let mut document = Document {
        schema_version: 1,
        runs: args.runs.len(),
        out: args.out.display().to_string(),
        ..Document::default()
    };
    let mut graphs: Vec<String> = Vec::new();
    let mut missions = Vec::new();
    for path in &args.runs {
        let run = read(path)?;
        let left_out = gather(&run, &model, &mut missions)
            .map_err(|problem| CommandError::usage(format!("{}: {problem}", path.display())))?;
        document.left_out += left_out;
        if !graphs.contains(&run.graph) {
            graphs.push(run.graph);
        }
    }
    document.missions = missions.len();
    document.steps = missions.iter().map(Record::steps).sum();
    if document.steps == 0 {
        let problem = "no mission whose first step is there and is one of the model";
        return Err(CommandError::usage(problem));
    }
    save(&args.out, lines(&model, &graphs, &missions)?)?;
    print(args.json, &document, || text_of(&document))?;
    Ok(Outcome::Done)
}

fn read(path: &Path) -> Result<Run, CommandError> {
    let refused = |problem: &dyn std::fmt::Display| {
        let allowed = "allowed is what 'scripts/up --json' prints";
        CommandError::usage(format!("{}: {problem}; {allowed}", path.display()))
    };
    let run: Run = serde_json::from_slice(&bytes_of(path)?).map_err(|error| refused(&error))?;
    if run.schema_version != RUN_VERSION {
        return Err(refused(&format!("schema_version {}", run.schema_version)));
    }
    if !run.events.iter().any(|event| event.step.is_some()) {
        return Err(refused(&"no step: the graph does not decide by symptoms"));
    }
    Ok(run)
}

/// Adds a run's missions; the number of steps that were left out.
fn gather(run: &Run, model: &Pomdp, missions: &mut Vec<Record>) -> Result<usize, String> {
    let mut left_out = 0;
    let (mut belief, mut next, mut is_whole) = (None, 1, true);
    for event in &run.events {
        // Its next process counts anew.
        if event.service == "supervisor" && event.event == "restarted" {
            (belief, next) = (None, 1);
        }
        let Some(step) = &event.step else {
            continue;
        };
        if belief.replace(step.belief) != Some(step.belief) {
            missions.push(Record::default());
            is_whole = true;
        }
        is_whole &= step.number == next;
        next = step.number.saturating_add(1);
        let action = file::index_of(model.actions(), &step.action, "action")?;
        let Some(observation) = step.observation.as_ref().filter(|_| is_whole) else {
            (is_whole, left_out) = (false, left_out + 1);
            continue;
        };
        let observation = file::index_of(model.observations(), observation, "observation")?;
        if let Some(mission) = missions.last_mut() {
            mission.actions.push(action as u32);
            mission.observations.push(observation as u32);
        }
    }
    missions.retain(|mission| mission.steps() > 0);
    Ok(left_out)
}

fn lines(model: &Pomdp, graphs: &[String], missions: &[Record]) -> Result<Vec<u8>, CommandError> {
    let mut text = Vec::new();
    let write = |text: &mut dyn Write| {
        file::write_head(text, format!("runs of {}", graphs.join(", ")))?;
        missions
            .iter()
            .try_for_each(|mission| file::write(text, model, mission))
    };
    write(&mut text).map_err(CommandError::failure)?;
    Ok(text)
}

fn text_of(document: &Document) -> String {
    let Document {
        runs,
        missions,
        steps,
        left_out,
        out,
        ..
    } = document;
    let mut text = format!("{runs} runs, {missions} missions, {steps} steps: {out}");
    if *left_out > 0 {
        text.push_str(&format!(
            "\n{left_out} steps left out: they follow one that is missing or not the model's"
        ));
    }
    text
}
