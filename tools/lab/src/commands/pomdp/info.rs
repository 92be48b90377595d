//! `vigil pomdp info`: what a model holds.

use std::collections::VecDeque;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_pomdp::Pomdp;

use super::{load, print};
use vigil_terminal::{CommandError, Outcome};

/// Prints what a model holds: sizes, start belief, reachable states and observations, warnings.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model (.pomdp or .pomdpx).
    #[arg(value_name = "FILE")]
    file: PathBuf,
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
    /// Discount of a step.
    discount: f64,
    /// What the file holds: `reward` or `cost`. Costs count as negative rewards here.
    values: &'static str,
    /// Names of the states.
    states: Vec<String>,
    /// Names of the actions.
    actions: Vec<String>,
    /// Names of the observations.
    observations: Vec<String>,
    /// Start belief, by state.
    start: Vec<f64>,
    /// Number of states that some sequence of actions may lead to from the start.
    reachable_states: usize,
    /// Names of the other states.
    unreachable: Vec<String>,
    /// Number of transition probabilities other than 0.
    transition_entries: usize,
    /// What observations tell.
    observation: Observation,
    /// Smallest expected reward of an action in a state.
    reward_min: f64,
    /// Largest expected reward of an action in a state.
    reward_max: f64,
    /// True if a reward depends on the next state or on the observation.
    rewards_depend_on_outcome: bool,
    /// What is doubtful in the file.
    warnings: Vec<Warning>,
}

/// What observations tell.
#[derive(Debug, Serialize, JsonSchema)]
struct Observation {
    /// `none`: there are none. `state`: each tells the state. `per_state`: states share them.
    /// `noisy`: they come by chance. `blind`: they tell nothing.
    structure: &'static str,
    /// Number of observation probabilities other than 0.
    entries: usize,
    /// True if they are not the same after each action.
    depends_on_action: bool,
}

/// Something doubtful in the file.
#[derive(Debug, Serialize, JsonSchema)]
struct Warning {
    /// Its line, from 1.
    line: usize,
    /// Its column, from 1.
    column: usize,
    /// What it is.
    message: String,
}

/// Prints it.
///
/// # Errors
/// A model that is refused; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let model = load(&args.file)?;
    let document = describe(args.file.display().to_string(), &model);
    print(args.json, &document, || table(&document))?;
    Ok(Outcome::Done)
}

fn describe(file: String, model: &Pomdp) -> Document {
    let (n, actions) = (model.states().len(), 0..model.actions().len());
    let is_reached = reachable(model);
    let rows = || actions.clone().flat_map(|a| (0..n).map(move |s| (s, a)));
    let rewards = || rows().map(|(s, a)| model.reward(s, a));
    let unreachable = model.states().iter().zip(&is_reached);
    Document {
        schema_version: 1,
        file,
        hash: format!("{:016x}", model.hash()),
        discount: model.discount(),
        values: if model.is_cost() { "cost" } else { "reward" },
        states: model.states().to_vec(),
        actions: model.actions().to_vec(),
        observations: model.observations().to_vec(),
        start: model.start().to_vec(),
        reachable_states: is_reached.iter().filter(|is| **is).count(),
        unreachable: unreachable
            .filter(|(_, is)| !**is)
            .map(|(name, _)| name.clone())
            .collect(),
        transition_entries: rows().map(|(s, a)| model.successors(s, a).len()).sum(),
        observation: observation(model),
        reward_min: rewards().fold(f64::INFINITY, f64::min),
        reward_max: rewards().fold(f64::NEG_INFINITY, f64::max),
        rewards_depend_on_outcome: model.has_outcome_rewards(),
        warnings: model
            .warnings()
            .iter()
            .map(|warning| Warning {
                line: warning.at.line,
                column: warning.at.column,
                message: warning.message.clone(),
            })
            .collect(),
    }
}

/// For each state: can some sequence of actions lead there from the start?
fn reachable(model: &Pomdp) -> Vec<bool> {
    let mut is_reached: Vec<bool> = model.start().iter().map(|p| *p > 0.0).collect();
    let first = is_reached.iter().enumerate().filter(|(_, is)| **is);
    let mut waiting: VecDeque<usize> = first.map(|(s, _)| s).collect();
    while let Some(state) = waiting.pop_front() {
        for action in 0..model.actions().len() {
            for &(to, _) in model.successors(state, action) {
                if !is_reached[to] {
                    is_reached[to] = true;
                    waiting.push_back(to);
                }
            }
        }
    }
    is_reached
}

/// What observations tell: nothing to observe (`none`); exactly the state (`state`); one for each
/// state, shared by some (`per_state`); something by chance (`noisy`); nothing, each as likely in
/// every state (`blind`).
fn observation(model: &Pomdp) -> Observation {
    let (n, k) = (model.states().len(), model.observations().len());
    let actions = 0..model.actions().len();
    let columns = || actions.clone().flat_map(|a| (0..k).map(move |z| (a, z)));
    let column = |(a, z): (usize, usize)| model.likelihood(a, z);
    let values = || columns().flat_map(|az| column(az).iter().copied());
    let is_exact = values().all(|p| p == 0.0 || p == 1.0);
    let is_distinct = columns().all(|az| column(az).iter().filter(|p| **p > 0.0).count() <= 1);
    let is_blind = columns().all(|az| column(az).iter().all(|p| *p == column(az)[0]));
    let structure = match () {
        () if model.is_mdp() => "none",
        () if is_exact && is_distinct => "state",
        () if is_blind => "blind",
        () if is_exact => "per_state",
        () => "noisy",
    };
    let same = |z| {
        actions
            .clone()
            .all(|a| model.likelihood(a, z) == model.likelihood(0, z))
    };
    Observation {
        structure,
        entries: columns()
            .map(|az| column(az).iter().filter(|p| **p > 0.0).count())
            .sum(),
        depends_on_action: n > 0 && !(0..k).all(same),
    }
}

fn table(document: &Document) -> String {
    const SHOWN: usize = 16;
    let list = |names: &[String]| {
        let more = if names.len() > SHOWN { " ..." } else { "" };
        let some = names[..names.len().min(SHOWN)].join(" ");
        format!("{:>6}  {some}{more}", names.len())
    };
    let seen = match document.observation.structure {
        "none" => "there is nothing to observe",
        "state" => "each tells the state",
        "per_state" => "fixed by the state, which they do not tell",
        "blind" => "as likely in every state: they tell nothing",
        _ => "noisy",
    };
    let depends = |does| if does { "" } else { "not " };
    let mut lines = vec![
        format!("{}, hash {}", document.file, document.hash),
        format!("states       {}", list(&document.states)),
        format!("actions      {}", list(&document.actions)),
        format!("observations {}", list(&document.observations)),
        format!(
            "discount      {}, values: {}",
            document.discount, document.values
        ),
        format!(
            "start         {} of {} states possible, {} can be reached",
            document.start.iter().filter(|p| **p > 0.0).count(),
            document.states.len(),
            document.reachable_states
        ),
        format!("transitions   {} other than 0", document.transition_entries),
        format!(
            "observed      {seen}; {} entries other than 0, {}depending on the action",
            document.observation.entries,
            depends(document.observation.depends_on_action)
        ),
        format!(
            "R(s,a)        {} to {}, {}depending on s' or z",
            document.reward_min,
            document.reward_max,
            depends(document.rewards_depend_on_outcome)
        ),
    ];
    if document.values == "cost" {
        lines.push("              (costs of the file count as negative rewards)".to_owned());
    }
    if !document.unreachable.is_empty() {
        lines.push(format!("unreachable  {}", list(&document.unreachable)));
    }
    for warning in &document.warnings {
        let (line, column) = (warning.line, warning.column);
        lines.push(format!(
            "warning: line {line}, column {column}: {}",
            warning.message
        ));
    }
    lines.join("\n")
}
