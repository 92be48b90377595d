//! Learning of the navigation model: the true one, wrong ones, what agents earn.

use std::error::Error;
use std::path::Path;

use vigil_decision::navigation::{
    self, ACTIONS, Parameters, PerException, PerState, QUIET, Remedies,
};
use vigil_decision::policy::PolicyName;
use vigil_decision::simulation::{Agent, Escalation, PolicyAgent, Rules, horizon, run};
use vigil_decision::{Pomdp, mdp};

pub mod curve;
pub mod offline;
pub mod online;

/// What stops a measurement.
pub type Failure = Box<dyn Error>;

/// The navigation model, and models of people who know the robot less well.
pub struct Models {
    /// config/navigation.toml.
    pub truth: Pomdp,
    /// Made by hand in a hurry: right in kind, wrong in number.
    pub hasty: Pomdp,
    /// Misled: it expects the wrong actions to help.
    pub misled: Pomdp,
}

impl Models {
    /// From the repository's configuration.
    ///
    /// # Errors
    /// A file that cannot be read or means nothing.
    pub fn read() -> Result<Self, Failure> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/navigation.toml");
        let parameters: Parameters = toml::from_str(&std::fs::read_to_string(path)?)?;
        let model = |of: &Parameters| -> Result<Pomdp, Failure> {
            Ok(Pomdp::parse(&navigation::generate(of)?)?)
        };
        Ok(Self {
            truth: model(&parameters)?,
            hasty: model(&hasty(&parameters))?,
            misled: model(&misled(&parameters))?,
        })
    }
}

/// Everything arises three times as often, every remedy and every symptom is a rough guess.
fn hasty(of: &Parameters) -> Parameters {
    let mut wrong = of.clone();
    let thrice = |p: f64| 3.0 * p;
    wrong.arises = per_exception(&of.arises, thrice);
    let rough = |p: f64| if p > 0.0 { 0.5 * p + 0.1 } else { 0.0 };
    let remedies = &of.remedies;
    wrong.remedies = Remedies {
        np: per_exception(&remedies.np, rough),
        rl: per_exception(&remedies.rl, rough),
        go: per_exception(&remedies.go, rough),
        ma: per_exception(&remedies.ma, rough),
        sh: per_exception(&remedies.sh, rough),
    };
    let vague = |p: f64| 0.5 * p + 0.03;
    let symptoms = &of.symptoms;
    wrong.symptoms.eps = per_state(&symptoms.eps, vague);
    wrong.symptoms.epm = per_state(&symptoms.epm, vague);
    wrong.symptoms.ld = per_state(&symptoms.ld, vague);
    wrong.symptoms.sd = per_state(&symptoms.sd, vague);
    wrong.outcomes.bo = per_state(&of.outcomes.bo, |p| 0.5 * p + 0.15);
    wrong
}

/// Moving away is thought to help against everything, what does help to help hardly ever.
fn misled(of: &Parameters) -> Parameters {
    let mut wrong = of.clone();
    let hardly = |p: f64| 0.1 * p;
    let remedies = &of.remedies;
    wrong.remedies = Remedies {
        np: per_exception(&remedies.np, hardly),
        rl: per_exception(&remedies.rl, hardly),
        go: per_exception(&remedies.go, hardly),
        ma: per_exception(&remedies.sh, |p| 0.8 * p),
        sh: per_exception(&remedies.sh, |p| 0.8 * p),
    };
    wrong
}

fn per_exception(of: &PerException, f: impl Fn(f64) -> f64) -> PerException {
    PerException {
        nnp: f(of.nnp),
        hp: f(of.hp),
        rt: f(of.rt),
        pp: f(of.pp),
        wd: f(of.wd),
        lst: f(of.lst),
    }
}

fn per_state(of: &PerState, f: impl Fn(f64) -> f64) -> PerState {
    PerState {
        nom: f(of.nom),
        nnp: f(of.nnp),
        hp: f(of.hp),
        rt: f(of.rt),
        pp: f(of.pp),
        wd: f(of.wd),
        lst: f(of.lst),
    }
}

/// Missions to the horizon of the discount.
#[must_use]
pub fn rules(model: &Pomdp) -> Rules {
    Rules {
        steps_max: horizon(model.discount(), 2000),
        is_end: vec![false; model.actions().len()],
    }
}

/// Who believes in `model` and decides by `policy`.
///
/// # Errors
/// A name that no policy has, a model without bounded values.
pub fn agent<'m>(model: &'m Pomdp, policy: &str) -> Result<PolicyAgent<'m>, Failure> {
    let solution = mdp::solve(model)?;
    let name: PolicyName = policy.parse()?;
    let dual = |information| vigil_decision::policy::Dual::new(information, 1.0);
    Ok(PolicyAgent::new(model, name.build(model, &solution, dual)?))
}

/// The deterministic baseline: a rung at every firing, the best of the escalations.
///
/// # Errors
/// Names that the model lacks.
pub fn escalation(model: &Pomdp) -> Result<Escalation, Failure> {
    let ladder = ["MA", "GO", "NP", "RL", "SH", "GU"];
    Ok(Escalation::new(model, ACTIONS[0], &ladder, &QUIET, 1)?)
}

/// Discounted rewards of missions `0..missions` in a world.
pub fn rewards(world: &Pomdp, agent: &mut dyn Agent, seed: u64, missions: u64) -> Vec<f64> {
    let rules = rules(world);
    let one = |mission| run(world, agent, &rules, (seed, mission)).discounted;
    (0..missions).map(one).collect()
}
