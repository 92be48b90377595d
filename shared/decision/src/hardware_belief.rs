//! What is known of the hardware, for a model of navigation and hardware together.

use vigil_blocks::{DECISION_STATES, FaultBelief};
use vigil_checkpoint::Checkpoint;
use vigil_pomdp::Pomdp;
use vigil_robot::FaultTree;

use crate::alarm_fusion::Situation;
use crate::answerable::AnswerableFaults;
use crate::error::SupervisorError;
use crate::joint_states::JointStates;
use crate::state_belief::{self, normalise, write_fallback, write_weights};
use crate::states::StateMeaning;

/// Probabilities of the hardware's states, as the identifier holds them.
#[derive(Checkpoint)]
pub(crate) struct HardwareBelief {
    #[checkpoint(fixed)]
    states: JointStates,
    #[checkpoint(fixed)]
    tree_hash: u64,
    /// Of no meaning unless `is_known`.
    p: [f64; DECISION_STATES],
    is_known: bool,
}

impl HardwareBelief {
    /// `None` if no state of `model` says anything about the hardware.
    ///
    /// # Errors
    /// As [`JointStates::new`].
    pub(crate) fn new(
        model: &Pomdp,
        tree: &FaultTree,
        lost: Option<&str>,
    ) -> Result<Option<Self>, SupervisorError> {
        let states = JointStates::new(model, tree, lost)?;
        Ok(states.map(|states| Self {
            states,
            tree_hash: tree.hash(),
            p: [0.0; DECISION_STATES],
            is_known: false,
        }))
    }

    /// True if a diagnosis speaks of this tree and holds probabilities.
    pub(crate) fn is_sound(&self, diagnosis: &FaultBelief) -> bool {
        state_belief::is_sound(diagnosis, &self.states.hardware, self.tree_hash)
    }

    /// Takes a sound diagnosis; `belief` is the predicted one over the model's states.
    pub(crate) fn take(
        &mut self,
        diagnosis: &FaultBelief,
        answerable: &AnswerableFaults,
        situation: Situation,
        belief: &[f64],
    ) {
        self.take_by(situation.rests, belief, |states, _, p| {
            // Doubt about the wheel is none about whether it is the hardware.
            let sets = answerable.sets();
            write_weights(diagnosis, states, &sets, situation.alarm, p);
            normalise(p);
        });
    }

    /// Takes what the detector says in the identifier's place.
    pub(crate) fn take_alarm(&mut self, situation: Situation, belief: &[f64]) {
        self.take_by(situation.rests, belief, |states, predicted, p| {
            write_fallback(situation, states, predicted, p);
        });
    }

    /// Takes what `write` makes of the predicted hardware. A robot that rests looks healthy: of
    /// that it is not believed.
    fn take_by(
        &mut self,
        rests: bool,
        belief: &[f64],
        write: impl FnOnce(&[StateMeaning], &[f64], &mut [f64]),
    ) {
        let count = self.states.hardware.len();
        let mut predicted = [0.0; DECISION_STATES];
        let predicted = &mut predicted[..count];
        self.states.write_hardware(belief, predicted);
        let p = &mut self.p[..count];
        write(&self.states.hardware, predicted, p);
        self.is_known = !rests || p[0] < predicted[0];
    }

    /// Writes `belief` with what is known of the hardware; as it is, if nothing is.
    pub(crate) fn write_joint(&self, belief: &[f64], start: &[f64], joint: &mut [f64]) {
        if self.is_known {
            let p = &self.p[..self.states.hardware.len()];
            self.states.take_over(p, belief, start, joint);
        } else {
            joint.copy_from_slice(belief);
        }
    }

    /// Nothing is known.
    pub(crate) const fn forget(&mut self) {
        self.is_known = false;
    }
}
