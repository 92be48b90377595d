//! `vigil pomdp missions`: missions for `learn` from what graphs have recorded.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use vigil_missions::learning::{Record, file};
use vigil_pomdp::Pomdp;
use vigil_terminal::{CommandError, Outcome};

use super::{load, print, save};

/// Gathers the decision model's steps of recorded runs, as `vigil pomdp learn` reads them.
///
/// A RUN is what `scripts/up --json` prints at its end. Steps are recorded by graphs that decide by
/// symptoms. A mission ends where the belief began anew: at a reset, at a run that no action
/// brought about, when the supervisor was started again. A step whose symptoms MODEL does not have
/// is left out, and counted.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recorded runs.
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// The model that they decided by (.pomdp or .pomdpx).
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Where to write the missions (JSON lines).
    #[arg(long, value_name = "F")]
    out: PathBuf,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What is needed of a run's document.
#[derive(Debug, Deserialize)]
struct Run {
    graph: String,
    events: Vec<Event>,
    events_overwritten: u64,
}

#[derive(Debug, Deserialize)]
struct Event {
    service: String,
    event: String,
    step: Option<Step>,
}

#[derive(Debug, Deserialize)]
struct Step {
    belief: u32,
    action: String,
    observation: Option<String>,
}

#[derive(Debug, Default, Serialize)]
struct Document {
    schema_version: u32,
    runs: usize,
    missions: usize,
    steps: usize,
    /// Steps whose symptoms the model does not have.
    left_out: usize,
    /// Events that the launcher could not read in time; steps may be among them.
    events_overwritten: u64,
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
        document.events_overwritten += run.events_overwritten;
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
        let problem = "no step of the model: allowed are runs of graphs that decide by symptoms";
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
    let text = fs::read_to_string(path).map_err(|error| refused(&error))?;
    serde_json::from_str(&text).map_err(|error| refused(&error))
}

/// Adds a run's missions; the number of steps that were left out.
fn gather(run: &Run, model: &Pomdp, missions: &mut Vec<Record>) -> Result<usize, String> {
    let mut left_out = 0;
    let mut belief = None;
    for event in &run.events {
        // Its next process counts beliefs from 0 again.
        if event.service == "supervisor" && event.event == "restarted" {
            belief = None;
        }
        let Some(step) = &event.step else {
            continue;
        };
        if belief.replace(step.belief) != Some(step.belief) {
            missions.push(Record::default());
        }
        let action = file::index_of(model.actions(), &step.action, "action")?;
        let Some(observation) = &step.observation else {
            left_out += 1;
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
        events_overwritten,
        out,
        ..
    } = document;
    let mut text = format!("{runs} runs, {missions} missions, {steps} steps: {out}");
    if *left_out > 0 {
        text.push_str(&format!(
            "\n{left_out} steps left out: the model does not have their symptoms"
        ));
    }
    if *events_overwritten > 0 {
        text.push_str(&format!(
            "\n{events_overwritten} events were overwritten: steps may be missing"
        ));
    }
    text
}
