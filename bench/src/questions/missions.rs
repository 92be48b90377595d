//! What are the decisions worth? Missions with random faults: Vigil, and the best rules.
//!
//! Exit: 1 if a bar is missed.

use std::error::Error;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::machine;
use vigil_bench::missions::{self, Mission, Plan, Rule, ShippedGraph};
use vigil_bench::tuning::tune;
use vigil_evaluation::parallel::in_parallel;

/// Missions between two lines of progress.
const PROGRESS: usize = 100;
/// First seed of the sweep: no measurement takes one of these.
const SWEEP_SEED: u64 = 1_000_000;

/// Which missions.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Missions of each kind.
    #[arg(long, value_name = "N", default_value_t = 300)]
    per_kind: u64,
    /// Seed of the first.
    #[arg(long, value_name = "S", default_value_t = 1)]
    first_seed: u64,
    /// Graph of Vigil; of `config/` if the path is relative.
    #[arg(long, value_name = "F", default_value = "rover.toml")]
    config: PathBuf,
    /// Rate of the frames, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 100.0, value_parser = from_zero)]
    rate: f64,
    /// Tune the rules instead, on missions of their own, from where they stand.
    #[arg(long)]
    sweep: bool,
    /// Print one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build takes hours: use scripts/bench".into());
    }
    let shipped = ShippedGraph::read(&args.config, args.rate)?;
    match args.sweep {
        true => sweep(args, &shipped),
        false => measure(args, &shipped),
    }
}

fn measure(args: &Args, shipped: &ShippedGraph) -> Result<(), Box<dyn Error>> {
    let plans = Plan::of_all_kinds(args.per_kind, args.first_seed);
    let arms = shipped.arms();
    let (began, done) = (Instant::now(), AtomicUsize::new(0));
    let drive = |plan: &Plan| {
        let mission = missions::drive(shipped, plan, &arms).map_err(|e| e.to_string());
        let so_far = done.fetch_add(1, Ordering::Relaxed) + 1;
        if so_far % PROGRESS == 0 {
            let (count, passed_s) = (plans.len(), began.elapsed().as_secs_f64());
            eprintln!("{so_far} of {count} missions in {passed_s:.0} s");
        }
        mission
    };
    let driven: Result<Vec<Mission>, String> = in_parallel(&plans, drive).into_iter().collect();
    let driven = driven?;
    let file = &shipped.missions;
    let document = stamped(missions::document(file, &arms, &driven), args, began);
    if args.json {
        println!("{document:#}");
    } else {
        let mut archive = Archive::new("missions")?;
        archive.store("missions.json", &document)?;
        archive.store_text("missions.csv", &missions::lines(&arms, &driven))?;
        missions::say(&mut archive, file, &arms, &driven, args.rate);
        archive.close()?;
    }
    match missions::shortfalls(file, &arms, &driven).len() {
        0 => Ok(()),
        count => Err(format!("{count} bars are missed").into()),
    }
}

fn sweep(args: &Args, shipped: &ShippedGraph) -> Result<(), Box<dyn Error>> {
    let plans = Plan::of_all_kinds(args.per_kind, SWEEP_SEED);
    let began = Instant::now();
    let rules = shipped.missions.rules;
    let mut document = json!({});
    for rule in [
        Rule::StopAndCall(rules.stop_and_call),
        Rule::Ladder(rules.ladder),
        Rule::Careful(rules.careful),
    ] {
        let tuned = tune(
            rule,
            rule.dimensions(),
            |rule, dimension| rule.varied(dimension),
            |rule| missions::mean_points(shipped, &plans, rule),
            |line| eprintln!("{} {line}", rule.name()),
        )?;
        document[rule.name()] = tuned.document();
    }
    let document = stamped(document, args, began);
    if args.json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("missions-sweep")?;
    archive.store("missions-sweep.json", &document)?;
    for name in ["careful", "stop and call", "ladder"] {
        let found = &document[name];
        archive.say(&format!(
            "{name}: {:.1} points, {}",
            found["points"], found["best"]
        ));
    }
    archive.close()?;
    Ok(())
}

fn stamped(mut document: Value, args: &Args, began: Instant) -> Value {
    document["machine"] = machine::facts();
    document["per_kind"] = json!(args.per_kind);
    document["rate_hz"] = json!(args.rate);
    document["wall_s"] = json!(began.elapsed().as_secs_f64());
    document
}

/// A finite number of at least 0.
fn from_zero(text: &str) -> Result<f64, String> {
    let number = text.parse().ok();
    let number = number.filter(|n: &f64| n.is_finite() && *n >= 0.0);
    number.ok_or_else(|| "allowed is a number from 0".to_owned())
}
