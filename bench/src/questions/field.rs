//! Does the diagnosis hold in the field: for hours, over gaps, on other grounds, with other lags?
//!
//! Scenarios and bars: `bench/field.toml`. Every figure: `scoring::field` of the evaluation
//! library.

use std::error::Error;
use std::iter;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use serde_json::{Value, json};
use vigil_bench::archive::{Archive, Outlet};
use vigil_bench::field::{
    self, File, Graph, Job, Library, Outcome, Scenario, ScoredRun, barred_lines, document, jobs,
    library, lines, select, told_timelines,
};
use vigil_bench::root;
use vigil_evaluation::parallel::in_parallel;
use vigil_terminal::output;

/// Does the diagnosis hold in the field?
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Only scenarios whose names begin with one of these.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Factor on the number of runs; at least one of each scenario stays.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    scale: f64,
    /// Of each scenario only the run with this number, and print whatever changes in it.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["archive", "scale"])]
    timeline: Option<usize>,
    /// Only say which scenarios there are.
    #[arg(long)]
    list: bool,
    /// Print the result as one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
    /// Also keep what every run brought.
    #[arg(long)]
    raw: bool,
    /// Archive a part, too. All scenarios at scale 1 always are.
    #[arg(long)]
    archive: bool,
    /// End with 1 if a bar is not met.
    #[arg(long)]
    check: bool,
    /// Other scenarios.
    #[arg(long, value_name = "FILE")]
    scenarios: Option<PathBuf>,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build takes hours: use scripts/bench".into());
    }
    let path = args.scenarios.clone();
    let file = File::read(&path.unwrap_or_else(|| root().join("bench/field.toml")))?;
    let scenarios = select(&file, &args.only)?;
    if args.list {
        for scenario in scenarios {
            output::line(&format!("{}: {}", scenario.name, scenario.about))?;
        }
        return Ok(());
    }
    let began = Instant::now();
    let graph = Graph::read()?;
    let library = library(&scenarios)?;
    let all = jobs(&scenarios, args.scale, &library, args.timeline);
    if all.is_empty() {
        return Err("no scenario has such a run, or its recordings are not there".into());
    }
    let outcomes = measure(&graph, &library, &scenarios, &all)?;
    let wall_s = began.elapsed().as_secs_f64();
    let document = document(&outcomes, wall_s, args.scale);
    // What never happened meets nothing, nor does what could not be driven.
    let is_whole = scenarios
        .iter()
        .all(|scenario| outcomes.iter().any(|o| o.scenario.name == scenario.name));
    let mut bars = outcomes.iter().flat_map(Outcome::bars);
    let is_met = is_whole && bars.all(|(_, met)| met == Some(true));
    show(args, &outcomes, &document)?;
    if args.check && !is_met {
        return Err("a bar is not met".into());
    }
    Ok(())
}

fn show(args: &Args, outcomes: &[Outcome<'_>], document: &Value) -> Result<(), Box<dyn Error>> {
    let is_whole = args.timeline.is_none()
        && args.only.is_empty()
        && args.scale == 1.0
        && args.scenarios.is_none();
    let last = format!(
        "{} of {} bars are met, {} had no case; in {:.0} s.",
        document["bars_met"],
        document["bars"],
        document["bars_without_case"],
        document["wall_s"].as_f64().unwrap_or(f64::NAN)
    );
    if !(is_whole || args.archive || args.json) {
        let all = lines(outcomes).join("\n");
        let text = format!("{all}\n\n{last}\nNot archived: only a part was measured.");
        return Ok(output::line(&text)?);
    }
    // A part has a name of its own, so that it does not stand for the whole.
    let parts = args.only.iter().map(|name| name.replace('/', "-"));
    let words: Vec<String> = iter::once("field".to_owned()).chain(parts).collect();
    let mut archive = Archive::new(&words.join("-"), Outlet::by_flag(args.json))?;
    archive.store("field.json", document)?;
    // Beside it, as this stays in the result where all figures are too much.
    let told = told_timelines(outcomes);
    if !told.is_empty() {
        archive.store("told.json", &Value::from(told))?;
    }
    let table = lines(outcomes);
    archive.store_text("table.md", &format!("{}\n", table.join("\n")))?;
    if args.raw {
        archive.store("runs.json", &raw(outcomes))?;
    }
    let table = match archive.folder() {
        Some(_) => " Every figure: `table.md`.",
        None => "",
    };
    archive.say(&format!("{last}{table}\n"));
    let barred = barred_lines(outcomes);
    barred.iter().for_each(|line| archive.say(line));
    archive.close()?;
    Ok(())
}

/// What every run brought.
fn raw(outcomes: &[Outcome<'_>]) -> Value {
    let one = |outcome: &Outcome<'_>| {
        let runs: Vec<String> = outcome.runs.iter().map(|run| format!("{run:?}")).collect();
        json!({
            "scenario": outcome.scenario.name, "sensors": outcome.sensors, "runs": runs,
        })
    };
    outcomes.iter().map(one).collect()
}

fn measure<'a>(
    graph: &Graph,
    library: &Library,
    scenarios: &[&'a Scenario],
    all: &[Job<'a>],
) -> Result<Vec<Outcome<'a>>, Box<dyn Error>> {
    let (done, began) = (AtomicUsize::new(0), Instant::now());
    let one = |job: &Job<'_>| {
        let found = field::run(graph, library, job);
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        let (all, name, wall_s) = (all.len(), &job.scenario.name, began.elapsed().as_secs());
        if done.is_multiple_of((all / 100).max(1)) || done == all {
            eprintln!("field: {done} of {all} runs, {wall_s} s, {name}");
        }
        found
    };
    let found: Result<Vec<Vec<ScoredRun>>, String> = in_parallel(all, one).into_iter().collect();
    let found = found?;
    let mut outcomes = Vec::new();
    for scenario in scenarios {
        let mine = || {
            let both = all.iter().zip(&found);
            both.filter(|(job, _)| std::ptr::eq(job.scenario, *scenario))
        };
        let sets = mine().next().map(|(_, scored)| scored.as_slice());
        for (set, ScoredRun { sensors, .. }) in sets.unwrap_or_default().iter().enumerate() {
            let runs = mine().filter_map(|(_, scored)| Some(scored.get(set)?.run.clone()));
            outcomes.push(Outcome::new(scenario, sensors, runs.collect()));
        }
    }
    Ok(outcomes)
}
