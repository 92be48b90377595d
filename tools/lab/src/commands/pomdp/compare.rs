//! `vigil pomdp compare`: what each policy is worth on a model, mission by mission.

mod bound;
mod contest;
pub(super) mod contestant;
mod table;

use std::path::{Path, PathBuf};

use clap::builder::RangedU64ValueParser;
use clap::{ArgAction, ValueEnum};
use vigil_missions::simulation::{Rules, horizon};
use vigil_pomdp::policy::{Gate, PolicyKind};
use vigil_pomdp::{PointBased, Pomdp, mdp};

use super::escalation::EscalationArgs;
use super::planner::PlannerArgs;
use super::{load, print, solved};
pub use contest::Document;
use contest::{Contest, Setting};
use contestant::{Contestant, Kind, Knowledge};
use vigil_terminal::{CommandError, Outcome};

/// Compares policies of a decision model over the same random missions.
///
/// Every policy meets the same random numbers at the same step of the same mission. The policies
/// are mls, av, qmdp, fib, random, despot, point-based (with --policy-file) and escalation-N. The
/// dual controls dm-X and adm-X of the first four gather information while the entropy (0 to 1) is
/// above a threshold K; each runs with each threshold. escalation-N takes the next action of
/// --ladder after N symptoms in a row.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model (.pomdp or .pomdpx).
    file: PathBuf,
    /// Policies, separated by commas.
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "mls,av,qmdp,fib,dm-mls,dm-av,dm-qmdp,\
        adm-mls,adm-av,adm-qmdp,random"
    )]
    policies: Vec<String>,
    /// Thresholds K of dual control, separated by commas, each 0 to 1.
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "0.5"
    )]
    thresholds: Vec<f64>,
    /// Missions of each policy, 2 to 10000000.
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = count(2))]
    episodes: u64,
    /// Seed of the missions. Each command draws its own numbers from a seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Greatest number of steps of a mission. It ends earlier once the discount is below 1e-4.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = count(1))]
    steps_max: u64,
    /// Actions that end a mission. There is no regret then, as bounds hold for endless missions.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    ends: Vec<String>,
    /// Actions that dual control may take to gain information [default: all that do not end a
    /// mission].
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    information_actions: Vec<String>,
    /// Steps without falling entropy after which dual control gathers no more; 0: never.
    #[arg(long, value_name = "N", default_value_t = 0)]
    stall_guard_steps: u32,
    /// Entropy that is compared with K [default: state for dm-X, action for adm-X].
    #[arg(long)]
    gate: Option<GateName>,
    /// Model that plays the world instead of FILE. The policies still use FILE.
    #[arg(long, value_name = "OTHER")]
    model_error: Option<PathBuf>,
    /// Policy with which each other one is compared in pairs [default: the first escalation, else
    /// the first policy].
    #[arg(long, value_name = "POLICY")]
    against: Option<String>,
    /// Upper bound of the value at the start belief [default: the lower of the fast informed bound
    /// and the point-based solver's after a fixed number of steps, about half a second].
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    upper: Option<f64>,
    /// Policy file for `point-based`, as `vigil pomdp solve FILE --out POLICY` writes it; plans
    /// that `despot` may end with.
    #[arg(long, value_name = "POLICY")]
    policy_file: Option<PathBuf>,
    #[command(flatten)]
    escalation: EscalationArgs,
    #[command(flatten)]
    planner: PlannerArgs,
    /// Print one JSON document.
    #[arg(long, action = ArgAction::SetTrue)]
    json: bool,
}

/// Whose entropy is compared with the threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum GateName {
    State,
    Action,
}

/// Reads a count of at least `least`.
pub(super) fn count(least: u64) -> RangedU64ValueParser<u64> {
    clap::value_parser!(u64).range(least..=10_000_000)
}

/// Runs the command.
///
/// # Errors
/// Models that cannot be read or do not fit together, options that mean nothing.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let model = load(&args.file)?;
    let other = args.model_error.as_deref().map(load).transpose()?;
    if let Some(other) = &other {
        fits("--model-error", &model, other)?;
    }
    let world = other.as_ref().unwrap_or(&model);
    let believed = mdp::solve(&model).map_err(CommandError::usage)?;
    let contestants = Contestant::all(&args.policies, &args.thresholds)?;
    let against = reference(args, &contestants)?;
    let rules = Rules {
        steps_max: horizon(world.discount(), args.steps_max as usize),
        is_end: among(world, "--ends", &args.ends)?,
    };
    let setting = Setting {
        world,
        rules: &rules,
        seed: args.seed,
        episodes: args.episodes,
        upper: bound::upper(args, world)?,
        against,
    };
    let knowledge = Knowledge {
        model: &model,
        solution: &believed,
        allowed: information(args, &model, &rules)?,
        stall_steps: args.stall_guard_steps,
        gate: args.gate.map(|gate| match gate {
            GateName::State => Gate::State,
            GateName::Action => Gate::Action,
        }),
        escalation: &args.escalation,
        planner: args.planner.options(),
        solved: solved_by(&model, args.policy_file.as_deref(), &contestants)?,
    };
    let contest = Contest::hold(&setting, &knowledge, &contestants)?;
    let name = args.file.display().to_string();
    let document = contest.document(&setting, &knowledge, &name);
    print(args.json, &document, || {
        table::text(&contest, &setting, &knowledge, &name)
    })?;
    Ok(Outcome::Done)
}

/// The policy in `file`, if one of `contestants` is decided by it or plans with it.
///
/// # Errors
/// A file without that policy, that policy without a file, a file that is refused.
pub(super) fn solved_by(
    model: &Pomdp,
    file: Option<&Path>,
    contestants: &[Contestant],
) -> Result<Option<PointBased>, CommandError> {
    let has = |kind| contestants.iter().any(|c| c.kind == Kind::Policy(kind));
    let (needed, used) = (has(PolicyKind::PointBased), has(PolicyKind::Despot));
    match (file, needed, needed || used) {
        (Some(file), _, true) => solved::load(model, "--policy-file", file).map(Some),
        (None, false, _) => Ok(None),
        (Some(_), _, false) => Err(CommandError::usage(
            "--policy-file: has a meaning only with the policies point-based and despot",
        )),
        (None, true, _) => Err(CommandError::usage(
            "policy point-based: requires --policy-file",
        )),
    }
}

/// Index of the contestant that the others are compared with.
fn reference(args: &Args, contestants: &[Contestant]) -> Result<usize, CommandError> {
    let Some(name) = &args.against else {
        let is_baseline = |c: &Contestant| matches!(c.kind, Kind::Escalation(_));
        return Ok(contestants.iter().position(is_baseline).unwrap_or(0));
    };
    let found = contestants.iter().position(|c| c.label() == *name);
    let found = found.or_else(|| contestants.iter().position(|c| c.name() == *name));
    found.ok_or_else(|| {
        let labels: Vec<String> = contestants.iter().map(Contestant::label).collect();
        let labels = labels.join(", ");
        CommandError::usage(format!("--against {name}: allowed are {labels}"))
    })
}

/// Actions that dual control may take for information.
fn information(
    args: &Args,
    model: &Pomdp,
    rules: &Rules,
) -> Result<Option<Vec<usize>>, CommandError> {
    let mut is_allowed = among(model, "--information-actions", &args.information_actions)?;
    if args.information_actions.is_empty() {
        if args.ends.is_empty() {
            return Ok(None);
        }
        is_allowed = rules.is_end.iter().map(|end| !end).collect();
    }
    let allowed = is_allowed
        .iter()
        .enumerate()
        .filter(|(_, allowed)| **allowed);
    Ok(Some(allowed.map(|(action, _)| action).collect()))
}

/// For every action of the model, whether `names` holds it.
pub(super) fn among(
    model: &Pomdp,
    option: &str,
    names: &[String],
) -> Result<Vec<bool>, CommandError> {
    if let Some(name) = names.iter().find(|name| !model.actions().contains(name)) {
        let allowed = model.actions().join(", ");
        return Err(CommandError::usage(format!(
            "{option}: the model has no action '{name}'; allowed are {allowed}"
        )));
    }
    Ok(model.actions().iter().map(|a| names.contains(a)).collect())
}

/// The world and the model that is believed in speak of the same things.
pub(super) fn fits(option: &str, model: &Pomdp, other: &Pomdp) -> Result<(), CommandError> {
    let lists = [
        ("states", model.states(), other.states()),
        ("actions", model.actions(), other.actions()),
        ("observations", model.observations(), other.observations()),
    ];
    match lists.iter().find(|(_, ours, theirs)| ours != theirs) {
        Some((what, ..)) => Err(CommandError::usage(format!(
            "{option}: its {what} differ; allowed is a model with the same names in the same \
             order"
        ))),
        None => Ok(()),
    }
}
