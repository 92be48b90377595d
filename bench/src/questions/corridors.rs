//! What are the decisions worth in corridors? Random missions: Vigil, and the best ladder.
//!
//! Exit: 1 if a bar is missed.

use std::error::Error;
use std::time::Instant;

use serde_json::json;
use vigil_bench::corridors::{self, CorridorGraph, CorridorPlan, EscalationSettings};
use vigil_bench::tuning::tune;

use super::{MissionArgs, demand_none, drive_all};

/// Which missions.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Missions.
    #[arg(long, value_name = "N", default_value_t = 500)]
    missions: u64,
    /// Decision model of Vigil instead of that of `config/corridor-people.toml`.
    #[arg(long, value_name = "F")]
    decision: Option<String>,
    #[command(flatten)]
    common: MissionArgs,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build takes hours: use scripts/bench".into());
    }
    let graph = CorridorGraph::read(args.common.rate, args.decision.as_deref())?;
    let shipped = graph.setup.file.navigation.clone().unwrap_or_default();
    let plans = CorridorPlan::many(&shipped, args.missions, args.common.first_seed());
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
