//! The policy that the settings name.

use crate::settings::{self, Settings};
use vigil_pomdp::mdp::Solution;
use vigil_pomdp::policy::{Dual, Gate, Information, PolicyKind};
use vigil_pomdp::{Decider, PointBased, Pomdp};

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
