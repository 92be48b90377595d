//! `vigil pomdp value`: what a policy earns.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_cycle::signal;
use vigil_missions::simulation::{Episode, PolicyAgent, Rules, Summary, run as drive};
use vigil_pomdp::solver::{PolicyValue, policy_value};
use vigil_pomdp::{Budget, Decider, PointBased, Pomdp, mdp};
use vigil_terminal::output::Progress;
use vigil_terminal::{CommandError, Outcome};

use super::compare::count;
use super::{load, print, seed, solved};

/// Steps of a sampled mission, at most.
const STEPS_MAX: usize = 1_000_000;

/// Says what a policy of `vigil pomdp solve` earns from the start belief.
///
/// For certain: between two bounds, by going through the beliefs that it reaches, the most probable
/// first. Sampled: the mean over simulated missions, with its 95 % interval. With discount 1 a
/// mission ends at a goal, and what is beyond those beliefs has no lower bound.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model (.pomdp or .pomdpx).
    file: PathBuf,
    /// The policy.
    #[arg(value_name = "POLICY")]
    policy: PathBuf,
    /// Beliefs to go through, at most.
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = count(1))]
    beliefs_max: u64,
    /// Missions to sample.
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = count(2))]
    episodes: u64,
    /// Seed of the missions. Each command draws its own numbers from a seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What it prints with --json. Values are discounted rewards from the start belief on.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Path of the model.
    file: String,
    /// Hash of the model.
    model_hash: String,
    /// Path of the policy.
    policy: String,
    /// The policy earns at least this, for certain; null if there is no such bound.
    // JSON has no infinity.
    #[schemars(with = "Option<f64>")]
    lower: f64,
    /// The policy earns at most this, for certain; null if there is no such bound.
    #[schemars(with = "Option<f64>")]
    upper: f64,
    /// Beliefs that were gone through for the bounds.
    beliefs: usize,
    /// Discounted share of the time that is spent beyond them; with discount 1 a probability.
    beyond_share: f64,
    /// Missions sampled.
    episodes: u64,
    /// Seed of the missions.
    seed: u64,
    /// Steps after which a sampled mission is cut off.
    steps_max: usize,
    /// What is left of the discount then.
    weight_beyond_horizon: f64,
    /// Mean of the sampled missions.
    mean: f64,
    /// The mean's 95 % interval is `mean` +- this.
    half_width_95: f64,
}

/// Values the policy, and prints the result.
///
/// # Errors
/// A model or a policy that is refused; with discount 1 a policy that never ends.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let model = load(&args.file)?;
    let mut policy = solved::load(&model, "POLICY", &args.policy)?;
    signal::install();
    let mut stop = signal::stop_requested;
    let mut budget = Budget::new(&mut stop);
    let certain = policy_value(&model, &mut policy, args.beliefs_max as usize, &mut budget)
        .map_err(|error| CommandError::failure(format!("{}: {error}", args.file.display())))?;
    let rules = Rules::endless(&model, STEPS_MAX);
    let sampled = sample(args, &model, policy, &rules)?;
    let document = document(args, &model, &certain, sampled, rules.steps_max);
    print(args.json, &document, || summary(&document))?;
    Ok(Outcome::Done)
}

fn sample(
    args: &Args,
    model: &Pomdp,
    policy: PointBased,
    rules: &Rules,
) -> Result<(Summary, u64), CommandError> {
    let solution = mdp::solve(model).map_err(CommandError::usage)?;
    let decider = Decider::new(Box::new(policy), model, &solution);
    let mut agent = PolicyAgent::new(model, decider);
    let seed = seed::for_command("value", args.seed);
    let progress = Progress::new("missions", args.episodes as usize);
    let earned = |number: u64| {
        progress.show(number as usize);
        drive(model, &mut agent, rules, Episode { seed, number }).discounted
    };
    // Ctrl-C ends it after the mission that runs; an interval needs two.
    let goes_on = |number: &u64| *number < 2 || !signal::stop_requested();
    let mut earned: Vec<f64> = (0..args.episodes).take_while(goes_on).map(earned).collect();
    Ok((Summary::new(&mut earned), earned.len() as u64))
}

fn document(
    args: &Args,
    model: &Pomdp,
    certain: &PolicyValue,
    sampled: (Summary, u64),
    steps_max: usize,
) -> Document {
    Document {
        schema_version: 1,
        file: args.file.display().to_string(),
        model_hash: format!("{:016x}", model.hash()),
        policy: args.policy.display().to_string(),
        lower: certain.lower,
        upper: certain.upper,
        beliefs: certain.beliefs,
        beyond_share: certain.beyond,
        episodes: sampled.1,
        seed: args.seed,
        steps_max,
        weight_beyond_horizon: model.discount().powf(steps_max as f64),
        mean: sampled.0.mean,
        half_width_95: sampled.0.half_width,
    }
}

fn summary(document: &Document) -> String {
    let Document {
        lower,
        upper,
        beliefs,
        ..
    } = document;
    format!(
        "{}: earns {lower:.10} to {upper:.10} for certain: {beliefs} beliefs, {:.3e} of the time \
         beyond them\nsampled: {:.6} +- {:.6} (95 %), {} missions of {} steps, discount {:.1e} \
         then",
        document.policy,
        document.beyond_share,
        document.mean,
        document.half_width_95,
        document.episodes,
        document.steps_max,
        document.weight_beyond_horizon
    )
}
