//! `vigil pomdp simulate`: missions of the event simulator, recorded.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use vigil_missions::learning::{Record, file};
use vigil_missions::simulation::{Episode, Rules, horizon};
use vigil_pomdp::mdp;

use super::compare::contestant::{Contestant, Knowledge};
use super::compare::{among, count, solved_by};
use super::escalation::EscalationArgs;
use super::planner::PlannerArgs;
use super::{load, seed};
use vigil_terminal::output::Progress;
use vigil_terminal::{CommandError, Outcome};

/// Simulates missions under a policy and records them as JSON lines.
///
/// The first line names the format. Each other line is one mission: actions, observations, rewards
/// and, with --states, the true states.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model (.pomdp or .pomdpx).
    file: PathBuf,
    /// Policy, as in `vigil pomdp compare`. Dual control uses K = 0.5.
    #[arg(long, value_name = "POLICY", default_value = "escalation-1")]
    policy: String,
    /// Missions, 1 to 10000000.
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = count(1))]
    episodes: u64,
    /// Seed of the missions. Each command draws its own numbers from a seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Greatest number of steps of a mission. It ends earlier once the discount is below 1e-4.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = count(1))]
    steps_max: u64,
    /// Actions that end a mission.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    ends: Vec<String>,
    /// Also record the true states.
    #[arg(long)]
    states: bool,
    /// Where to write the missions.
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    /// Policy file for `point-based`, as `vigil pomdp solve FILE --out POLICY` writes it; plans
    /// that `despot` may end with.
    #[arg(long, value_name = "POLICY")]
    policy_file: Option<PathBuf>,
    #[command(flatten)]
    escalation: EscalationArgs,
    #[command(flatten)]
    planner: PlannerArgs,
}

/// Runs the command.
///
/// # Errors
/// A model or an option that is refused; a file that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let model = load(&args.file)?;
    let solution = mdp::solve(&model).map_err(CommandError::usage)?;
    let contestants = Contestant::all(std::slice::from_ref(&args.policy), &[0.5])?;
    let contestant = contestants.first();
    let contestant = contestant.ok_or_else(|| CommandError::usage("--policy: one is needed"))?;
    let rules = Rules {
        steps_max: horizon(model.discount(), args.steps_max as usize),
        is_end: among(&model, "--ends", &args.ends)?,
    };
    let ends = rules.is_end.iter().enumerate();
    let knowledge = Knowledge {
        model: &model,
        solution: &solution,
        allowed: Some(ends.filter(|(_, end)| !**end).map(|(a, _)| a).collect()),
        stall_steps: 0,
        gate: None,
        escalation: &args.escalation,
        planner: args.planner.options(),
        solved: solved_by(&model, args.policy_file.as_deref(), &contestants)?,
    };
    let mut agent = contestant.build(&knowledge)?;
    let failed =
        |error: std::io::Error| CommandError::failure(format!("{}: {error}", args.out.display()));
    let mut out = BufWriter::new(File::create(&args.out).map_err(failed)?);
    file::write_head(&mut out, contestant.label()).map_err(failed)?;
    let progress = Progress::new("missions", args.episodes as usize);
    let seed = seed::for_command("simulate", args.seed);
    for number in 0..args.episodes {
        let episode = Episode { seed, number };
        let (record, _) = Record::simulated(&model, &mut *agent, &rules, episode, args.states);
        file::write(&mut out, &model, &record).map_err(failed)?;
        if number % 64 == 0 {
            progress.show(number as usize);
        }
    }
    out.flush().map_err(failed)?;
    Ok(Outcome::Done)
}
