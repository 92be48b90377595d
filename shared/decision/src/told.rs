//! What the robot is told.

use vigil_blocks::{
    Action, ControlMode, DECISION_ACTIONS, DECISION_STATES, RecoveryKind, ValueKind,
};
use vigil_pomdp::policy::Measure;
use vigil_pomdp::{Choice, Control, Decider, Pomdp, Tracker};

use crate::mapping::ActionMeaning;

/// What the robot is to do; a change of it is a new decision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Instruction {
    pub action: usize,
    pub kind: RecoveryKind,
    pub wheel: Option<usize>,
}

impl Instruction {
    /// A stop by rule: the model's action of that kind, if it has one, else `otherwise`.
    pub(crate) fn stop(meanings: &[ActionMeaning], otherwise: usize) -> Self {
        let is_stop = |m: &ActionMeaning| m.kind == RecoveryKind::Stop;
        Self {
            action: meanings.iter().position(is_stop).unwrap_or(otherwise),
            kind: RecoveryKind::Stop,
            wheel: None,
        }
    }
}

/// A decision and how it was made.
pub(crate) struct Decision<'a> {
    pub decided: Instruction,
    pub choice: Choice,
    pub meanings: &'a [ActionMeaning],
    pub control_mode: ControlMode,
}

impl Decision<'_> {
    /// Writes belief, values and decision into the block.
    pub(crate) fn write(
        &self,
        model: &Pomdp,
        tracker: &Tracker,
        decider: &Decider,
        action: &mut Action,
    ) {
        let values = decider.values();
        let decided = self.decided;
        let meaning = self.meanings.get(decided.action).copied();
        let stops = decided.kind == RecoveryKind::Stop;
        let belief = tracker.belief();
        action.model_hash = model.hash();
        action.belief = [0.0; DECISION_STATES];
        action.value = [0.0; DECISION_ACTIONS];
        action.belief[..belief.len()].copy_from_slice(belief);
        action.value[..values.len()].copy_from_slice(values);
        action.entropy = tracker.entropy();
        action.action_entropy = decider.action_entropy();
        action.value_kind = match decider.measure() {
            Measure::Value => ValueKind::Value,
            Measure::Votes => ValueKind::Votes,
            Measure::Entropy => ValueKind::Entropy,
        } as u32;
        action.margin = self.choice.margin;
        action.speed_scale = meaning.map_or(0.0, |m| if stops { 0.0 } else { m.speed_scale });
        action.action = decided.action as u32;
        action.kind = decided.kind as u32;
        action.wheel = decided.wheel.map_or(u32::MAX, |wheel| wheel as u32);
        action.control_mode = self.control_mode() as u32;
        action.state_count = belief.len() as u32;
        action.action_count = values.len() as u32;
    }

    /// Gathering information is a way to use a belief with fresh evidence, and no other.
    fn control_mode(&self) -> ControlMode {
        match (self.control_mode, self.choice.control) {
            (ControlMode::Policy, Control::Dual) => ControlMode::Dual,
            (mode, _) => mode,
        }
    }
}
