//! What are the decisions worth in corridors? Random missions: Vigil, and the best ladder.
//!
//! Exit: 1 if a bar is missed.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde_json::json;
use vigil_bench::corridors::{
    self, CorridorArm, CorridorGraph, CorridorPlan, EscalationSettings, LiveComparison,
};
use vigil_bench::tuning::tune;
use vigil_bench::variation::Variation;

use super::{MissionArgs, demand_none, drive_all, drive_at_once, share, write_records};

/// Which missions.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Missions.
    #[arg(long, value_name = "N", default_value_t = 500)]
    missions: u64,
    /// Decision model of Vigil instead of that of `config/corridor-people.toml`.
    #[arg(long, value_name = "FILE")]
    decision: Option<String>,
    /// Drive Vigil alone, and write the steps of its decision model with their true states to this
    /// file, for `vigil pomdp fit` and `learn`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["sweep", "vary", "json"])]
    record: Option<PathBuf>,
    /// Share of the decisions that are recorded in which something else is tried.
    #[arg(long, value_name = "P", default_value_t = 0.3, value_parser = share, requires = "record")]
    tried: f64,
    /// Drive each mission through the four processes too, in real time.
    #[arg(long, conflicts_with_all = ["sweep", "vary", "record"])]
    live: bool,
    /// Live graphs that run beside each other.
    #[arg(long, value_name = "N", default_value_t = 8, requires = "live")]
    at_once: usize,
    #[command(flatten)]
    common: MissionArgs,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build takes hours: use scripts/bench".into());
    }
    if args.common.vary {
        return vary(args);
    }
    let graph = CorridorGraph::read(Variation::default(), args.decision.as_deref())?;
    let plans = graph.plans(args.missions, args.common.first_seed());
    if let Some(path) = &args.record {
        return record(args, &graph, &plans, path);
    }
    if args.live {
        return live(args, &graph, &plans);
    }
    match args.common.sweep {
        true => sweep(args, &graph, &plans),
        false => measure(args, &graph, &plans),
    }
}

fn measure(
    args: &Args,
    graph: &CorridorGraph,
    plans: &[CorridorPlan],
) -> Result<(), Box<dyn Error>> {
    let (arms, began) = (graph.arms(), Instant::now());
    let missions = drive_all(plans, |plan| corridors::drive(graph, plan, &arms))?;
    let document = corridors::document(&arms, &missions);
    let lines = corridors::lines(&arms, &missions);
    let say = |archive: &mut _| corridors::say(archive, &arms, &missions);
    let common = &args.common;
    common.keep("corridors", document, began, Some(lines), say)?;
    demand_none(&corridors::shortfalls(&arms, &missions))
}

/// Vigil through four processes, beside itself and the ladder within one.
fn live(args: &Args, graph: &CorridorGraph, plans: &[CorridorPlan]) -> Result<(), Box<dyn Error>> {
    let (began, at_once) = (Instant::now(), args.at_once.max(1));
    let arms = [CorridorArm::Vigil, CorridorArm::Ladder(graph.file.ladder)];
    let simulated = drive_all(plans, |plan| corridors::drive(graph, plan, &arms))?;
    let live = drive_at_once(at_once, plans, |plan| corridors::drive_live(graph, plan))?;
    let comparison = LiveComparison {
        live: &live,
        simulated: &simulated,
    };
    let document = comparison.document();
    let common = &args.common;
    common.keep("corridors-live", document, began, None, |archive| {
        comparison.say(archive, at_once);
    })?;
    demand_none(&comparison.shortfalls())
}

/// Vigil and the ladder in every variation.
fn vary(args: &Args) -> Result<(), Box<dyn Error>> {
    let (mut found, began) = (Vec::new(), Instant::now());
    for variation in Variation::read_all()? {
        eprintln!("{}", variation.name);
        let name = variation.name.clone();
        let graph = CorridorGraph::read(variation, args.decision.as_deref())?;
        let plans = graph.plans(args.missions, args.common.first_seed());
        let arms = [CorridorArm::Vigil, CorridorArm::Ladder(graph.file.ladder)];
        let driven = drive_all(&plans, |plan| corridors::drive(&graph, plan, &arms))?;
        found.push(corridors::compare(&arms, &driven, &name));
    }
    let head = format!(
        "{} missions, the same in each row; the variations stand in `bench/variations.toml`. \
         Intervals: 95 %, paired.\n",
        args.missions
    );
    args.common
        .keep_comparisons("corridors-varied", &found, began, &head, "hits")
}

fn record(
    args: &Args,
    graph: &CorridorGraph,
    plans: &[CorridorPlan],
    path: &Path,
) -> Result<(), Box<dyn Error>> {
    let records = drive_all(plans, |plan| corridors::record(graph, plan, args.tried))?;
    let policy = format!(
        "{}, {} tried",
        graph.setup.file.supervisor.policy, args.tried
    );
    write_records(path, policy, &graph.setup.decision, &records)
}

fn sweep(args: &Args, graph: &CorridorGraph, plans: &[CorridorPlan]) -> Result<(), Box<dyn Error>> {
    let began = Instant::now();
    let tuned = tune(
        graph.file.ladder,
        EscalationSettings::DIMENSIONS,
        EscalationSettings::varied,
        |settings| corridors::mean_points(graph, plans, settings),
        |line| eprintln!("{line}"),
    )?;
    let said = format!("ladder: {:.1} points, {}", tuned.points, json!(tuned.best));
    let common = &args.common;
    common.keep(
        "corridors-sweep",
        tuned.document(),
        began,
        None,
        |archive| {
            archive.say(&said);
        },
    )
}
