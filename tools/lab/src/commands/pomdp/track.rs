//! `vigil pomdp track`: the belief after each of some actions and observations, and what a policy
//! does about it.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_missions::learning::file::index_of;
use vigil_pomdp::policy::Policy;
use vigil_pomdp::{Evidence, PointBased, Pomdp, Tracker};

use super::{load, print, solved};
use vigil_terminal::{CommandError, Outcome};

/// Prints the belief after each action and observation.
///
/// After an impossible observation the belief is the prediction with 0.01 of the start belief mixed
/// in, and the exit code is 1. With a policy the action that it chooses at each belief follows, and
/// by how much it is worth more than the runner-up.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model (.pomdp or .pomdpx).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Action and observation of each step, names or numbers, separated by commas.
    #[arg(long, value_name = "A:O,A:O,...")]
    steps: String,
    /// A policy, as `vigil pomdp solve FILE --out POLICY` writes it.
    #[arg(long, value_name = "POLICY")]
    policy_file: Option<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Path of the model.
    file: String,
    /// Hash of the model.
    hash: String,
    /// Names of the states.
    states: Vec<String>,
    /// Names of the actions.
    actions: Vec<String>,
    /// Start belief, by state.
    start: Vec<f64>,
    /// What the policy does at the start; null without one.
    start_decision: Option<Decision>,
    /// The steps, in order.
    steps: Vec<Step>,
    /// Number of steps whose observation the model rules out.
    impossible_steps: usize,
    /// Log-likelihood of all observations, nats; null if one was impossible.
    log_likelihood: Option<f64>,
}

/// An action, an observation, and the belief after them.
#[derive(Debug, Serialize, JsonSchema)]
struct Step {
    /// Name of the action.
    action: String,
    /// Name of the observation.
    observation: String,
    /// Belief after the step, by state.
    belief: Vec<f64>,
    /// Probability of the observation, given the belief before and the action; 0 if impossible.
    probability: f64,
    /// True if the model rules the observation out.
    impossible: bool,
    /// Entropy of the belief over that of the uniform one: 0 certain, 1 uniform.
    entropy: f64,
    /// What the policy does next; null without one.
    decision: Option<Decision>,
}

/// What a policy does at a belief.
#[derive(Debug, Serialize, JsonSchema)]
struct Decision {
    /// Name of the action.
    action: String,
    /// Its value minus the runner-up's, in units of reward.
    margin: f64,
    /// Value of each action by the policy, in units of reward.
    values: Vec<f64>,
}

impl Decision {
    fn new(policy: &mut PointBased, model: &Pomdp, belief: &[f64]) -> Self {
        let mut values = vec![0.0; model.actions().len()];
        let choice = policy.evaluate(belief, &mut values);
        Self {
            action: model.actions()[choice.action].clone(),
            margin: choice.margin,
            values,
        }
    }
}

/// Prints the beliefs.
///
/// # Errors
/// A model or a step that is refused; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let model = load(&args.file)?;
    let steps = pairs(&model, &args.steps).map_err(CommandError::usage)?;
    let policy = args.policy_file.as_deref();
    let policy = policy.map(|path| solved::load(&model, "--policy-file", path));
    let document = follow(args, &model, &steps, policy.transpose()?);
    print(args.json, &document, || table(&document))?;
    Ok(match document.impossible_steps {
        0 => Outcome::Done,
        _ => Outcome::Failed,
    })
}

/// Indices of actions and observations.
pub(super) fn pairs(model: &Pomdp, text: &str) -> Result<Vec<(usize, usize)>, String> {
    let steps = text
        .split(',')
        .map(str::trim)
        .filter(|step| !step.is_empty());
    let steps = steps.enumerate().map(|(number, step)| {
        let at = |problem| format!("--steps: step {}: {problem}", number + 1);
        let (action, observation) = step
            .split_once(':')
            .ok_or_else(|| at(format!("'{step}', wanted is ACTION:OBSERVATION")))?;
        let action = index_of(model.actions(), action.trim(), "action").map_err(at)?;
        let z = index_of(model.observations(), observation.trim(), "observation").map_err(at)?;
        Ok((action, z))
    });
    steps.collect()
}

fn follow(
    args: &Args,
    model: &Pomdp,
    steps: &[(usize, usize)],
    mut policy: Option<PointBased>,
) -> Document {
    let mut tracker = Tracker::new(model);
    let mut decide = |belief: &[f64]| Some(Decision::new(policy.as_mut()?, model, belief));
    let start = tracker.belief().to_vec();
    let start_decision = decide(&start);
    let mut log_likelihood = Some(0.0);
    let steps: Vec<Step> = steps
        .iter()
        .map(|&(action, z)| {
            let evidence = tracker.update(model, action, z);
            let probability = match evidence {
                Evidence::Taken(p) => p,
                Evidence::Impossible => 0.0,
            };
            let impossible = evidence == Evidence::Impossible;
            log_likelihood = log_likelihood
                .filter(|_| !impossible)
                .map(|sum: f64| sum + probability.ln());
            Step {
                action: model.actions()[action].clone(),
                observation: model.observations()[z].clone(),
                belief: tracker.belief().to_vec(),
                probability,
                impossible,
                entropy: tracker.entropy(),
                decision: decide(tracker.belief()),
            }
        })
        .collect();
    Document {
        schema_version: 1,
        file: args.file.display().to_string(),
        hash: format!("{:016x}", model.hash()),
        states: model.states().to_vec(),
        actions: model.actions().to_vec(),
        start,
        start_decision,
        impossible_steps: steps.iter().filter(|step| step.impossible).count(),
        steps,
        log_likelihood,
    }
}

/// The most probable states of each step.
fn table(document: &Document) -> String {
    const SHOWN: usize = 4;
    let best = |belief: &[f64]| {
        let mut order: Vec<usize> = (0..belief.len()).filter(|&s| belief[s] > 0.0).collect();
        order.sort_by(|&one, &other| belief[other].total_cmp(&belief[one]));
        let more = if order.len() > SHOWN { "  ..." } else { "" };
        let named = order.iter().take(SHOWN);
        let named = named.map(|&s| format!("{} {:.6}", document.states[s], belief[s]));
        named.collect::<Vec<_>>().join("  ") + more
    };
    let chosen = |decision: &Option<Decision>| match decision {
        Some(of) => format!("  -> {} (by {:.3})", of.action, of.margin),
        None => String::new(),
    };
    let mut lines = vec![format!(
        "{:24} {:>10}  {}{}",
        "start",
        "",
        best(&document.start),
        chosen(&document.start_decision)
    )];
    for step in &document.steps {
        let name = format!("{}:{}", step.action, step.observation);
        let probability = if step.impossible {
            "IMPOSSIBLE".to_owned()
        } else {
            format!("{:.6}", step.probability)
        };
        let (belief, chosen) = (best(&step.belief), chosen(&step.decision));
        lines.push(format!("{name:24} {probability:>10}  {belief}{chosen}"));
    }
    match document.log_likelihood {
        Some(sum) => lines.push(format!("log-likelihood {sum:.6}")),
        None => lines.push(format!(
            "{} impossible: the model rules out what was seen",
            document.impossible_steps
        )),
    }
    lines.join("\n")
}
