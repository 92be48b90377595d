//! `vigil pomdp learn`: a model's probabilities from recorded missions.

mod document;

use std::path::PathBuf;

use vigil_missions::learning::check::{Agreement, Refusal, RewardCheck};
use vigil_missions::learning::{LearnedModel, Record, Settings, check, file, learn};
use vigil_missions::simulation::{
    Episode, PairedDifference, PolicyAgent, Rules, Summary, run as fly,
};
use vigil_pomdp::policy::{Dual, PolicyName};
use vigil_pomdp::{Pomdp, mdp};

use super::compare::{count, fits};
use super::{load, print, save, seed};
pub use document::Document;
use document::Mean;
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Learns a model's probabilities from recorded missions (JSON lines, see `vigil pomdp simulate`).
///
/// FILE is the model made by hand. It gives the names, the rewards and what is impossible, and
/// counts as --prior-strength visits of every row of T and Z. The learned model is checked against
/// the missions' rewards, if recorded, and against its policy's rewards in --world, if given. It is
/// written only if its predictions are within 20 % and chance (95 %) of them. Otherwise the exit
/// code is 1, and an older file stays as it was.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model made by hand (.pomdp or .pomdpx).
    file: PathBuf,
    /// Recorded missions, as `vigil pomdp simulate` writes them.
    #[arg(long, value_name = "FILE")]
    missions: PathBuf,
    /// Where to write the learned model.
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    /// Weight of the model made by hand: the number of visits that each of its rows counts as.
    /// 0 learns from the missions alone.
    #[arg(long, value_name = "K", default_value_t = 50.0)]
    prior_strength: f64,
    /// Greatest number of iterations of each start.
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = count(1))]
    iterations: u64,
    /// Number of starts. The first is FILE, the others are drawn around it; the best result counts.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = count(1))]
    starts: u64,
    /// Write the model even if nothing can check it: the missions hold no rewards, and --world is
    /// not given.
    #[arg(long)]
    unchecked: bool,
    /// Seed of drawn starts and simulated missions. Each command draws its own numbers from a seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Policy whose mean reward is predicted: mls, av, qmdp or fib.
    #[arg(long, value_name = "POLICY", default_value = "fib")]
    policy: String,
    /// Simulated missions for the prediction.
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = count(2))]
    episodes: u64,
    /// Model that plays the world, in which the learned model's policy is measured.
    #[arg(long, value_name = "OTHER")]
    world: Option<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Files and options that are refused; a model that may not be deployed (exit code 1).
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let prior = load(&args.file)?;
    let world = args.world.as_deref().map(load).transpose()?;
    if let Some(world) = &world {
        fits("--world", &prior, world)?;
    }
    let flown = file::read(&args.missions, &prior).map_err(CommandError::usage)?;
    let learned = learned(args, &prior, &flown.records)?;
    let Worths {
        predicted,
        measured,
        logged,
        checks,
    } = worths(args, &learned.model, world.as_ref(), &flown.records)?;
    let refusal = refusal(args, &checks);
    let is_weak = |check: &Result<Agreement, _>| check.is_ok_and(|agreement| agreement.is_weak);
    let document = Document {
        schema_version: 2,
        file: args.file.display().to_string(),
        missions_file: args.missions.display().to_string(),
        missions: flown.records.len(),
        steps: flown.records.iter().map(Record::steps).sum(),
        flown_by: flown.policy,
        prior_strength: args.prior_strength,
        start: learned.start,
        iterations: learned.iterations.clone(),
        rows: document::rows(&learned),
        policy: args.policy.clone(),
        episodes: args.episodes,
        predicted: Mean::new(predicted),
        measured: measured.map(Mean::new),
        logged_predicted: logged.map(|l| Mean::new(l.predicted)),
        logged_measured: logged.map(|l| Mean::new(l.measured)),
        is_checked: !checks.is_empty(),
        is_weakly_checked: checks.iter().any(is_weak),
        is_older_out_left: refusal.is_some() && args.out.exists(),
        refused: refusal.clone(),
        hash: format!("{:016x}", learned.model.hash()),
    };
    print(args.json, &document, || document.text())?;
    if let Some(mut refusal) = refusal {
        if document.is_older_out_left {
            let out = args.out.display();
            refusal = format!("{refusal}\n{out} is older and was left as it was");
        }
        return Err(CommandError::failure(refusal));
    }
    save(&args.out, learned.model.to_cassandra())?;
    Ok(Outcome::Done)
}

/// Learns, counting on standard error.
fn learned(args: &Args, prior: &Pomdp, records: &[Record]) -> Result<LearnedModel, CommandError> {
    let settings = Settings {
        prior_strength: args.prior_strength,
        iterations_max: args.iterations as usize,
        starts: args.starts as usize,
        seed: seed::for_command("learn", args.seed),
        ..Settings::default()
    };
    let total = settings.starts * settings.iterations_max;
    let progress = output::Progress::new("iterations, at most:", total);
    let mut done = 0;
    let learned = learn(prior, records, &settings, &mut |_| {
        done += 1;
        progress.show(done);
    });
    drop(progress);
    learned.map_err(|error| CommandError::usage(format!("{}: {error}", args.missions.display())))
}

/// What the model predicts and what was measured, discounted rewards of missions.
struct Worths {
    /// Its policy by itself.
    predicted: Summary,
    /// Its policy in the world.
    measured: Option<Summary>,
    /// The recorded missions.
    logged: Option<RewardCheck>,
    /// Whether predictions and measurements agree.
    checks: Vec<Result<Agreement, Refusal>>,
}

fn worths(
    args: &Args,
    model: &Pomdp,
    world: Option<&Pomdp>,
    records: &[Record],
) -> Result<Worths, CommandError> {
    let mut predicted = worth(args, model, model)?;
    let measured = world.map(|world| worth(args, model, world)).transpose()?;
    let half_width = |m: &Vec<f64>| PairedDifference::new(&predicted, m).half_width;
    let half_width = measured.as_ref().map(half_width);
    let predicted = Summary::new(&mut predicted);
    let measured = measured.map(|mut measured| Summary::new(&mut measured));
    let logged = check::follow(model, records);
    let in_world = measured.zip(half_width);
    let checks = [
        logged.map(|logged| logged.check()),
        in_world.map(|(m, half_width)| check::within(predicted.mean, m.mean, half_width)),
    ];
    Ok(Worths {
        predicted,
        measured,
        logged,
        checks: checks.into_iter().flatten().collect(),
    })
}

/// Why the model is not to be written.
fn refusal(args: &Args, checks: &[Result<Agreement, Refusal>]) -> Option<String> {
    if checks.is_empty() && !args.unchecked {
        let message = "not to be deployed: there is nothing to check the model by, as the missions \
                       hold no rewards and no --world is given; allowed with --unchecked";
        return Some(message.to_owned());
    }
    let refusal = checks.iter().find_map(|check| check.err());
    refusal.map(|refusal| refusal.to_string())
}

/// What the policy of `model` earns in `world`, discounted, mission by mission.
fn worth(args: &Args, model: &Pomdp, world: &Pomdp) -> Result<Vec<f64>, CommandError> {
    let solution = mdp::solve(model).map_err(CommandError::usage)?;
    let name: PolicyName = args.policy.parse().map_err(CommandError::usage)?;
    if name.information.is_some() {
        let message = format!("--policy {name}: allowed are mls, av, qmdp, fib");
        return Err(CommandError::usage(message));
    }
    let decider = name.build(model, &solution, |information| Dual::new(information, 1.0));
    let mut agent = PolicyAgent::new(model, decider.map_err(CommandError::usage)?);
    let rules = Rules::endless(world, 2000);
    let seed = seed::for_command("learn", args.seed);
    let one = |number| fly(world, &mut agent, &rules, Episode { seed, number }).discounted;
    Ok((0..args.episodes).map(one).collect())
}
