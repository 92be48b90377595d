//! The policy that the settings name.

use crate::settings::{self, Settings};
use vigil_pomdp::mdp::Solution;
use vigil_pomdp::policy::{Dual, Gate, Information, Measure, PolicyKind};
use vigil_pomdp::{Decider, PointBased, Policy, Pomdp, QMdp};

use crate::error::SupervisorError;

/// The decider for `model`, of which `solution` is the fully observable relaxation and `solved` the
/// policy that was solved beforehand, if any.
pub(crate) fn decider(
    model: &Pomdp,
    solution: &Solution,
    solved: Option<&PointBased>,
    settings: &Settings,
) -> Result<Decider, SupervisorError> {
    let kind: PolicyKind = settings.policy.parse()?;
    let allowed = information_actions(model, settings)?;
    let dual = |information| dual(information, settings, allowed);
    let options = settings.despot.options();
    Ok(kind.build(model, solution, dual, solved, &options)?)
}

/// What actions are worth, where the best is not allowed: the decider's values, and where it has
/// only votes or entropies, which rank nothing but the best, those of Q-MDP.
pub(crate) struct Worth {
    policy: QMdp,
    values: Vec<f64>,
}

impl Worth {
    /// For the model of which `solution` is the fully observable relaxation.
    pub(crate) fn new(solution: Solution, actions: usize) -> Self {
        Self {
            policy: QMdp::new(solution),
            values: vec![0.0; actions],
        }
    }

    /// Of every action, after the decider's decision about `belief`.
    pub(crate) fn values<'a>(&'a mut self, decider: &'a Decider, belief: &[f64]) -> &'a [f64] {
        if decider.measure() == Measure::Value {
            return decider.values();
        }
        self.policy.evaluate(belief, &mut self.values);
        &self.values
    }
}

fn dual(information: Information, settings: &Settings, allowed: Vec<usize>) -> Dual {
    if settings.as_published {
        return Dual::as_published(information, settings.threshold);
    }
    let mut dual = Dual::new(information, settings.threshold);
    dual.gate = match settings.gate {
        None => dual.gate,
        Some(settings::Gate::State) => Gate::State,
        Some(settings::Gate::Action) => Gate::Action,
    };
    // An empty set is refused: which actions may be taken for information is for the user to say.
    dual.allowed = Some(allowed);
    dual.stall_steps = settings.stall_guard_steps;
    dual
}

/// Indices of the actions that may be taken for information.
fn information_actions(model: &Pomdp, settings: &Settings) -> Result<Vec<usize>, SupervisorError> {
    let index = |name: &String| {
        let found = model.actions().iter().position(|action| action == name);
        found.ok_or_else(|| SupervisorError::InformationAction {
            found: name.clone(),
            allowed: model.actions().join(", "),
        })
    };
    settings.information_actions.iter().map(index).collect()
}
