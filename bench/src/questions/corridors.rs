//! What are the decisions worth in corridors? Random missions: Vigil, and the best ladder.
//!
//! Exit: 1 if a bar is missed.

use std::error::Error;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::corridors::{
    self, CorridorArm, CorridorGraph, CorridorMission, CorridorPlan, EscalationSettings,
};
use vigil_bench::machine;
use vigil_bench::tuning::tune;
use vigil_evaluation::parallel::in_parallel;

/// Missions between two lines of progress.
const PROGRESS: usize = 100;
/// First seed of the sweep: no measurement takes one of these.
const SWEEP_SEED: u64 = 1_000_000;

/// Which missions.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Missions.
    #[arg(long, value_name = "N", default_value_t = 500)]
    missions: u64,
    /// Seed of the first.
    #[arg(long, value_name = "S", default_value_t = 1)]
    first_seed: u64,
    /// Decision model of Vigil instead of that of `config/corridor-people.toml`.
    #[arg(long, value_name = "F")]
    decision: Option<String>,
    /// Rate of the frames, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 100.0)]
    rate: f64,
    /// Tune the ladder instead, on missions of its own, from where it stands.
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
    let graph = CorridorGraph::read(args.rate, args.decision.as_deref())?;
    match args.sweep {
        true => sweep(args, &graph),
        false => measure(args, &graph),
    }
}

fn plans(args: &Args, graph: &CorridorGraph, first_seed: u64) -> Vec<CorridorPlan> {
    let shipped = graph.setup.file.navigation.clone().unwrap_or_default();
    CorridorPlan::many(&shipped, args.missions, first_seed)
}

fn driven(
    graph: &CorridorGraph,
    plans: &[CorridorPlan],
    arms: &[CorridorArm],
    done: impl Fn() + Sync,
) -> Result<Vec<CorridorMission>, String> {
    let drive = |plan: &CorridorPlan| {
        let mission = corridors::drive(graph, plan, arms).map_err(|e| e.to_string());
        done();
        mission
    };
    in_parallel(plans, drive).into_iter().collect()
}

fn measure(args: &Args, graph: &CorridorGraph) -> Result<(), Box<dyn Error>> {
    let (plans, arms) = (plans(args, graph, args.first_seed), graph.arms());
    let (began, done) = (Instant::now(), AtomicUsize::new(0));
    let missions = driven(graph, &plans, &arms, || {
        let so_far = done.fetch_add(1, Ordering::Relaxed) + 1;
        if so_far % PROGRESS == 0 {
            let (count, passed_s) = (plans.len(), began.elapsed().as_secs_f64());
            eprintln!("{so_far} of {count} missions in {passed_s:.0} s");
        }
    })?;
    let document = stamped(corridors::document(&arms, &missions), args, began);
    if args.json {
        println!("{document:#}");
    } else {
        let mut archive = Archive::new("corridors")?;
        archive.store("corridors.json", &document)?;
        archive.store_text("corridors.csv", &corridors::lines(&arms, &missions))?;
        corridors::say(&mut archive, &arms, &missions);
        archive.close()?;
    }
    match corridors::shortfalls(&arms, &missions).len() {
        0 => Ok(()),
        count => Err(format!("{count} bars are missed").into()),
    }
}

fn sweep(args: &Args, graph: &CorridorGraph) -> Result<(), Box<dyn Error>> {
    let (plans, began) = (plans(args, graph, SWEEP_SEED), Instant::now());
    let points = |settings: EscalationSettings| {
        let missions = driven(graph, &plans, &[CorridorArm::Ladder(settings)], || {})?;
        let scores = missions.iter().filter_map(|it| it.scores.first());
        let sum: f64 = scores.map(|score| score.points).sum();
        Ok(sum / missions.len() as f64)
    };
    let tuned = tune(
        graph.file.ladder,
        EscalationSettings::DIMENSIONS,
        EscalationSettings::varied,
        points,
        |line| eprintln!("{line}"),
    )?;
    let document = stamped(tuned.document(), args, began);
    if args.json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("corridors-sweep")?;
    archive.store("corridors-sweep.json", &document)?;
    archive.say(&format!(
        "ladder: {:.1} points, {}",
        tuned.points,
        json!(tuned.best)
    ));
    archive.close()?;
    Ok(())
}

fn stamped(mut document: Value, args: &Args, began: Instant) -> Value {
    document["machine"] = machine::facts();
    document["rate_hz"] = json!(args.rate);
    document["wall_s"] = json!(began.elapsed().as_secs_f64());
    document
}
