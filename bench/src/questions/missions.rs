//! What are the decisions worth? Missions with random faults: Vigil, and the best rules.
//!
//! Exit: 1 if a bar is missed.

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use serde_json::json;
use vigil_bench::archive::Archive;
use vigil_bench::missions::{self, Arm, Plan, Rule, Rules, ShippedGraph};
use vigil_bench::tuning::tune;
use vigil_bench::variation::Variation;

use super::{MissionArgs, demand_none, drive_all, share, write_records};

/// Which missions.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Missions of each kind.
    #[arg(long, value_name = "N", default_value_t = 300)]
    per_kind: u64,
    /// Graph of Vigil; of `config/` if the path is relative.
    #[arg(long, value_name = "FILE", default_value = "rover.toml")]
    config: PathBuf,
    /// Drive Vigil alone, and write the evidence of its decisions with what was true to this file,
    /// for `vigil pomdp fit`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["sweep", "vary", "json"])]
    record: Option<PathBuf>,
    /// Share of the alarms that are recorded after which something else is tried.
    #[arg(long, value_name = "P", default_value_t = 0.5, value_parser = share, requires = "record")]
    tried: f64,
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
    let shipped = ShippedGraph::read(&args.config, Variation::default())?;
    let plans = shipped.plans(args.per_kind, args.common.first_seed());
    if let Some(path) = &args.record {
        let records =
            drive_all(&plans, |plan| missions::record(&shipped, plan, args.tried))?.concat();
        let policy = format!(
            "{}, {} tried",
            shipped.setup.file.supervisor.policy, args.tried
        );
        return write_records(path, policy, &shipped.setup.decision, &records);
    }
    match args.common.sweep {
        true => sweep(args, &shipped, &plans),
        false => measure(args, &shipped, &plans),
    }
}

fn measure(args: &Args, shipped: &ShippedGraph, plans: &[Plan]) -> Result<(), Box<dyn Error>> {
    let (arms, began) = (shipped.arms(), Instant::now());
    let driven = drive_all(plans, |plan| missions::drive(shipped, plan, &arms))?;
    let (file, common) = (&shipped.missions, &args.common);
    let mut document = missions::document(file, &arms, &driven);
    document["per_kind"] = json!(args.per_kind);
    let lines = missions::lines(&arms, &driven);
    let rate_hz = shipped.setup.file.graph.rate_hz;
    let say = |archive: &mut _| missions::say(archive, file, &arms, &driven, rate_hz);
    common.keep("missions", document, began, Some(lines), say)?;
    demand_none(&missions::shortfalls(file, &arms, &driven))
}

/// Vigil and the rules that are best at something, in every variation.
fn vary(args: &Args) -> Result<(), Box<dyn Error>> {
    let (mut found, began) = (Vec::new(), Instant::now());
    let variations = Variation::read_all()?.into_iter();
    for variation in variations.filter(|it| !it.is_of_corridors()) {
        eprintln!("{}", variation.name);
        let shipped = ShippedGraph::read(&args.config, variation)?;
        let plans = shipped.plans(args.per_kind, args.common.first_seed());
        let Rules {
            careful,
            stop_and_call,
            ..
        } = shipped.missions.rules;
        let rules = [Rule::Careful(careful), Rule::StopAndCall(stop_and_call)];
        let arms = [Arm::Vigil, Arm::Rule(rules[0]), Arm::Rule(rules[1])];
        let driven = drive_all(&plans, |plan| missions::drive(&shipped, plan, &arms))?;
        let (file, name) = (&shipped.missions, &shipped.variation.name);
        found.push(missions::compare(file, &arms, &driven, name));
    }
    let head = format!(
        "{} missions of each kind, the same in each row, weighed by `bench/missions.toml`; the \
         variations stand in `bench/variations.toml`. Intervals: 95 %, paired.\n",
        args.per_kind
    );
    args.common
        .keep_comparisons("missions-varied", &found, began, &head, "ended unsafely")
}

fn sweep(args: &Args, shipped: &ShippedGraph, plans: &[Plan]) -> Result<(), Box<dyn Error>> {
    let began = Instant::now();
    let rules = shipped.missions.rules;
    let mut document = json!({"per_kind": args.per_kind});
    let mut said = Vec::new();
    for rule in [
        Rule::StopAndCall(rules.stop_and_call),
        Rule::Ladder(rules.ladder),
        Rule::Careful(rules.careful),
    ] {
        let tuned = tune(
            rule,
            rule.dimensions(),
            |rule, dimension| rule.varied(dimension),
            |rule| missions::mean_points(shipped, plans, rule),
            |line| eprintln!("{} {line}", rule.name()),
        )?;
        let (name, points, best) = (rule.name(), tuned.points, json!(tuned.best));
        said.push(format!("{name}: {points:.1} points, {best}"));
        document[name] = tuned.document();
    }
    let say = |archive: &mut Archive| said.iter().for_each(|line| archive.say(line));
    args.common
        .keep("missions-sweep", document, began, None, say)
}
