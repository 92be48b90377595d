//! The policy that the settings name.

use crate::settings::{self, Settings};
use vigil_pomdp::mdp::Solution;
use vigil_pomdp::policy::{Dual, Gate, Information, PolicyKind};
use vigil_pomdp::{Decider, PointBased, Pomdp};
use vigil_robot::FaultTree;

use crate::error::SupervisorError;
use crate::joint_states::JointStates;
use crate::mapping::{self, ActionMeaning};

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

/// The solved policy where the identifier shows what is wrong with the hardware while the robot
/// drives; as it is, if no state of `model` says anything about the hardware.
///
/// # Errors
/// [`SupervisorError`] naming what does not fit.
pub(crate) fn with_identifier(
    solved: &PointBased,
    model: &Pomdp,
    tree: &FaultTree,
    settings: &Settings,
) -> Result<PointBased, SupervisorError> {
    let actions = mapping::actions(model, &settings.actions)?;
    let drives = |of: &ActionMeaning| !of.has_end && of.speed_scale > 0.0;
    let shows: Vec<bool> = actions.iter().map(drives).collect();
    let states = JointStates::new(model, tree, settings.lost_state.as_deref())?;
    let solved = solved.clone();
    Ok(match states {
        Some(states) => solved.shown(states.hardware_of_states(), &shows),
        None => solved,
    })
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
