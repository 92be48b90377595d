//! Why a supervisor could not be built.

use vigil_blocks::{DECISION_ACTIONS, DECISION_STATES};
use vigil_pomdp::mdp::SolveError;
use vigil_pomdp::policy::{BuildError, KindError};

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
        "the decision model has no state '{0}'; it needs ND, UNKNOWN, and for every leaf one of \
         its name, of a node above it, of its kind in capitals (STUCK for 'stuck:LF'), or FAULT"
    )]
    NoState(String),
    /// A state stands for no fault.
    #[error(
        "state '{0}' of the decision model stands for no leaf of the fault tree that has no other \
         state; it may be a leaf, an inner node, a kind of faults in capitals (STUCK for \
         'stuck:LF'), ND, FAULT, SEVERAL, SEVERAL_DRIVABLE or UNKNOWN, each \
         also with _NEW at its end, or DONE"
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
        "observation '{found}' of the decision model is no set of symptoms; allowed are 'none', \
         and {allowed}, each at most once, joined by '_'"
    )]
    NoSet {
        /// The observation.
        found: String,
        /// Names of the symptoms.
        allowed: String,
    },
    /// Two observations are the same set.
    #[error("observations '{0}' and '{1}' of the decision model are the same set of symptoms")]
    SameSet(String, String),
    /// A symptom alone, or silence, has no observation.
    #[error(
        "the decision model has no observation '{0}'; with supervisor.evidence = \"symptoms\" it \
         needs 'none', each symptom that it names alone, and those of their sets that can occur"
    )]
    NoObservation(String),
    /// A symptom of the settings that the decision model does not know.
    #[error("[supervisor.symptoms] names '{0}', of which the decision model has no observation")]
    ForeignSymptom(String),
    /// No state is of a lost robot.
    #[error(
        "supervisor.lost_state: no state of the decision model is '{found}', alone or joined by \
         '-' with another exception; its states are {allowed}"
    )]
    LostState {
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
