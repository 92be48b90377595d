//! From the fault tree's nodes to the decision model's states, and from its actions to the robot.

use std::collections::BTreeMap;

use crate::settings::RecoveryAction;
use vigil_blocks::{DECISION_ACTIONS, DECISION_STATES, RecoveryKind};
use vigil_pomdp::Pomdp;
use vigil_pomdp::mdp::SolveError;
use vigil_pomdp::policy::{BuildError, KindError};
use vigil_robot::Description;
use vigil_robot::FaultTree;

/// Name of the decision model's state for deviations that no fault model explains.
const UNKNOWN: &str = "UNKNOWN";
/// Name of the same deviation after some time, when waiting for a name has not helped.
const UNKNOWN_OLD: &str = "UNKNOWN_OLD";
/// Name of the state of all named faults that have no state of their own.
const FAULT: &str = "FAULT";
/// Name of the state of two faults or more.
const SEVERAL: &str = "SEVERAL";
/// Name of the state after the end of the task. It is never believed: what goes on has not ended.
const DONE: &str = "DONE";

/// Counter-steering that lets a robot with a stuck wheel drive the commanded curvature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compensation {
    /// Index of the stuck wheel.
    pub wheel: usize,
    /// The curvature to command is `curvature_gain * curvature + curvature_offset_1_m`.
    pub curvature_gain: f64,
    /// See `curvature_gain`; 1/m.
    pub curvature_offset_1_m: f64,
}

/// Why a supervisor could not be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SupervisorError {
    /// The decision model is larger than a block can carry.
    #[error(
        "the decision model has {states} states and {actions} actions; allowed are \
         {DECISION_STATES} and {DECISION_ACTIONS}"
    )]
    Size {
        /// States of the model.
        states: usize,
        /// Actions of the model.
        actions: usize,
    },
    /// A leaf of the fault tree, nominal or unknown has no state.
    #[error(
        "the decision model has no state '{0}'; it needs ND, UNKNOWN, and one for every leaf or \
         FAULT for those without"
    )]
    NoState(String),
    /// A state means nothing in the fault tree.
    #[error(
        "state '{0}' of the decision model is no leaf of the fault tree, ND, FAULT, SEVERAL, \
         UNKNOWN, UNKNOWN_OLD or DONE"
    )]
    NoLeaf(String),
    /// An action of the model is not mapped.
    #[error("action '{0}' of the decision model is missing in [supervisor.actions]")]
    NoAction(String),
    /// A mapped action is not in the model.
    #[error("[supervisor.actions] names '{0}', which the decision model does not have")]
    ForeignAction(String),
    /// A wheel that may be stuck has no usable compensation, though the model compensates.
    #[error(
        "wheel {0} may be stuck and action '{1}' compensates, but it has no compensation; each \
         such wheel needs a finite curvature gain and offset"
    )]
    NoCompensation(usize, String),
    /// An observation is no set of symptoms and outcomes.
    #[error(
        "observation '{0}' of the decision model is no set of symptoms; allowed are 'none', and \
         EPS, EPM, LD, SD, BO, ALT, NNA, each at most once, joined by '_'"
    )]
    NoSet(String),
    /// Two observations are the same set.
    #[error("observations '{0}' and '{1}' of the decision model are the same set of symptoms")]
    SameSet(String, String),
    /// A symptom alone, or silence, has no observation.
    #[error(
        "the decision model has no observation '{0}'; with supervisor.evidence = \"symptoms\" it \
         needs none, EPS, EPM, LD, SD, BO, ALT and NNA, and those of their sets that can occur"
    )]
    NoObservation(&'static str),
    /// A state that the settings name is not in the model.
    #[error("supervisor.{key}: the decision model has no state '{found}'; allowed are {allowed}")]
    NamedState {
        /// Key that names it.
        key: &'static str,
        /// Name that was given.
        found: String,
        /// Names of the model's states.
        allowed: String,
    },
    /// The policy is not known.
    #[error("supervisor.policy: {0}")]
    Policy(#[from] KindError),
    /// Dual control cannot be set up.
    #[error("supervisor: {0}")]
    Build(#[from] BuildError),
    /// An action for information is not in the model.
    #[error(
        "supervisor.information_actions: the decision model has no action '{found}'; allowed are \
         {allowed}"
    )]
    InformationAction {
        /// Name that was given.
        found: String,
        /// Names of the model's actions.
        allowed: String,
    },
    /// The model has no solution.
    #[error("decision model: {0}")]
    Solve(#[from] SolveError),
}

/// Index of a state that the settings name, if they do.
pub(crate) fn state(
    model: &Pomdp,
    key: &'static str,
    name: Option<&str>,
) -> Result<Option<usize>, SupervisorError> {
    let index = |name: &str| {
        let found = model.states().iter().position(|state| state == name);
        found.ok_or_else(|| SupervisorError::NamedState {
            key,
            found: name.to_owned(),
            allowed: model.states().join(", "),
        })
    };
    name.map(index).transpose()
}

/// What a state of the decision model stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Subject {
    /// A node of the fault tree: a leaf, or 0 for nominal.
    Node(usize),
    /// Every leaf without a state of its own.
    Others,
    /// Two leaves or more.
    Several,
    /// What no modelled fault explains.
    Unknown,
    /// The task is done.
    Done,
}

/// What a state stands for, and the wheel that it is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct StateMeaning {
    /// What it stands for.
    pub subject: Subject,
    /// The leaves that it stands for, as bits.
    pub leaves: u64,
    /// Wheel of the fault.
    pub wheel: Option<usize>,
    /// True if the fault is a stuck wheel.
    pub stuck: bool,
}

/// Checks that a block can carry the model's belief and values.
pub(crate) fn check_size(model: &Pomdp) -> Result<(), SupervisorError> {
    let (states, actions) = (model.states().len(), model.actions().len());
    if states > DECISION_STATES || actions > DECISION_ACTIONS {
        return Err(SupervisorError::Size { states, actions });
    }
    Ok(())
}

/// Meaning of every state, in the model's order.
pub(crate) fn states(
    model: &Pomdp,
    tree: &FaultTree,
    robot: &Description,
) -> Result<Vec<StateMeaning>, SupervisorError> {
    check_size(model)?;
    let has = |name: &str| model.states().iter().any(|state| state == name);
    let name = |node: usize| tree.nodes()[node].name.as_str();
    let leaves = tree.leaves().filter(|_| !has(FAULT));
    let needed = std::iter::once(0).chain(leaves).map(name);
    if let Some(missing) = needed.chain([UNKNOWN]).find(|name| !has(name)) {
        return Err(SupervisorError::NoState(missing.to_owned()));
    }
    let others = tree.leaves().filter(|&leaf| !has(name(leaf)));
    let others = others.fold(0, |bits, leaf| bits | 1 << leaf);
    model
        .states()
        .iter()
        .map(|name| meaning(name, tree, robot, others))
        .collect()
}

fn meaning(
    name: &str,
    tree: &FaultTree,
    robot: &Description,
    others: u64,
) -> Result<StateMeaning, SupervisorError> {
    let subject = match name {
        UNKNOWN | UNKNOWN_OLD => Some(Subject::Unknown),
        FAULT => Some(Subject::Others),
        SEVERAL => Some(Subject::Several),
        DONE => Some(Subject::Done),
        _ => None,
    };
    if let Some(subject) = subject {
        return Ok(StateMeaning {
            subject,
            leaves: if name == FAULT { others } else { 0 },
            wheel: None,
            stuck: false,
        });
    }
    let node = tree
        .index(name)
        .ok_or_else(|| SupervisorError::NoLeaf(name.to_owned()))?;
    let fault = tree.nodes()[node].fault.as_deref();
    if node != 0 && fault.is_none() {
        return Err(SupervisorError::NoLeaf(name.to_owned()));
    }
    let wheel = fault
        .and_then(|f| f.split(':').nth(1))
        .and_then(|w| robot.wheel_index(w));
    let stuck = fault.is_some_and(|f| f.starts_with("stuck:"));
    Ok(StateMeaning {
        subject: Subject::Node(node),
        leaves: if node == 0 { 0 } else { 1 << node },
        wheel,
        stuck,
    })
}

/// What an action of the decision model makes the robot do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ActionMeaning {
    pub kind: RecoveryKind,
    pub speed_scale: f64,
}

/// Meaning of every action, in the model's order.
pub(crate) fn actions(
    model: &Pomdp,
    settings: &BTreeMap<String, RecoveryAction>,
) -> Result<Vec<ActionMeaning>, SupervisorError> {
    if let Some(foreign) = settings.keys().find(|name| !model.actions().contains(name)) {
        return Err(SupervisorError::ForeignAction(foreign.clone()));
    }
    model
        .actions()
        .iter()
        .map(|name| {
            let action = settings
                .get(name)
                .ok_or_else(|| SupervisorError::NoAction(name.clone()))?;
            let kind = RecoveryKind::from(action.kind);
            let speed_scale = action
                .speed_scale
                .unwrap_or_else(|| usual_speed_scale(kind));
            Ok(ActionMeaning { kind, speed_scale })
        })
        .collect()
}

/// Factor of the speed where the settings name none. Chosen by hand, as the configurations in
/// `config/` have them: half the speed halves what a wrong diagnosis costs and still shows faults;
/// a robot that compensates keeps more of it, as its fault is known.
const fn usual_speed_scale(kind: RecoveryKind) -> f64 {
    match kind {
        RecoveryKind::None
        | RecoveryKind::Stop
        | RecoveryKind::CallForHelp
        | RecoveryKind::NewPath
        | RecoveryKind::Relocalise
        | RecoveryKind::GiveUp => 0.0,
        RecoveryKind::SlowDown => 0.5,
        RecoveryKind::Compensate => 0.7,
        RecoveryKind::GoOn
        | RecoveryKind::IgnoreEncoder
        | RecoveryKind::GoThrough
        | RecoveryKind::MoveAway => 1.0,
    }
}

/// Checks that every wheel whose stuck motor is a state can be compensated, if an action does so.
pub(crate) fn check_compensation(
    model: &Pomdp,
    states: &[StateMeaning],
    actions: &[ActionMeaning],
    compensation: &[Compensation],
) -> Result<(), SupervisorError> {
    let compensates = |meaning: &ActionMeaning| meaning.kind == RecoveryKind::Compensate;
    let Some(action) = actions.iter().position(compensates) else {
        return Ok(());
    };
    let is_usable = |wheel: usize| {
        compensation.iter().any(|c| {
            c.wheel == wheel && c.curvature_gain.is_finite() && c.curvature_offset_1_m.is_finite()
        })
    };
    let stuck = states.iter().filter(|state| state.stuck);
    match stuck.filter_map(|s| s.wheel).find(|&w| !is_usable(w)) {
        Some(wheel) => Err(SupervisorError::NoCompensation(
            wheel,
            model.actions()[action].clone(),
        )),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_done_standing_has_no_speed_and_what_drives_has_all_of_it() {
        use RecoveryKind as R;
        for (scale, kinds) in [
            (
                0.0,
                &[
                    R::None,
                    R::Stop,
                    R::CallForHelp,
                    R::NewPath,
                    R::Relocalise,
                    R::GiveUp,
                ][..],
            ),
            (0.5, &[R::SlowDown]),
            (0.7, &[R::Compensate]),
            (1.0, &[R::GoOn, R::IgnoreEncoder, R::GoThrough, R::MoveAway]),
        ] {
            for kind in kinds {
                assert_eq!(usual_speed_scale(*kind), scale, "{kind:?}");
            }
        }
    }

    fn model(states: usize, actions: usize) -> Pomdp {
        let text = format!(
            "discount: 0.9\nvalues: reward\nstates: {states}\nactions: {actions}\nT: * identity\n"
        );
        Pomdp::parse(&text).unwrap()
    }

    #[test]
    fn a_model_is_as_large_as_a_block_can_carry() {
        assert_eq!(
            check_size(&model(DECISION_STATES, DECISION_ACTIONS)),
            Ok(())
        );
        for (states, actions) in [(DECISION_STATES + 1, 1), (1, DECISION_ACTIONS + 1)] {
            let refused = check_size(&model(states, actions));
            assert_eq!(refused, Err(SupervisorError::Size { states, actions }));
        }
    }

    #[test]
    fn each_stuck_wheel_needs_a_finite_compensation_of_its_own() {
        let model = model(2, 1);
        let compensate = ActionMeaning {
            kind: RecoveryKind::Compensate,
            speed_scale: 0.7,
        };
        let states = [Some(3), Some(4)].map(|wheel| StateMeaning {
            leaves: 0,
            subject: Subject::Node(1),
            wheel,
            stuck: wheel == Some(4),
        });
        let check = |compensation: &[Compensation], actions: &[ActionMeaning]| {
            check_compensation(&model, &states, actions, compensation)
        };
        let of = |wheel, curvature_gain, curvature_offset_1_m| Compensation {
            wheel,
            curvature_gain,
            curvature_offset_1_m,
        };
        let missing = Err(SupervisorError::NoCompensation(4, "0".to_owned()));
        assert_eq!(check(&[of(4, 1.0, 0.0)], &[compensate]), Ok(()));
        assert_eq!(check(&[of(3, 1.0, 0.0)], &[compensate]), missing);
        assert_eq!(check(&[of(4, f64::NAN, 0.0)], &[compensate]), missing);
        assert_eq!(check(&[of(4, 1.0, f64::NAN)], &[compensate]), missing);
        let stop = ActionMeaning {
            kind: RecoveryKind::Stop,
            ..compensate
        };
        assert_eq!(check(&[], &[stop]), Ok(()));
    }
}
