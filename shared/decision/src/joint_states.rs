//! States of a model of navigation and hardware together.
//!
//! A state is named by what is wrong, joined by `-`: `NNP` is a blocked way, `NNP-STUCK` the same
//! with a stuck wheel, `STUCK` a stuck wheel alone. The last part is the hardware's if it is one of
//! the names that [`states`] knows. Any other name is an exception of the navigation.
//!
//! The identifier's belief is about hardware alone. It is taken over, and what is believed of the
//! navigation given each state of the hardware stays (Jeffrey's rule).
//!
//! A robot that is lost may have got there little by little, or by a jump of its pose that moves as
//! no model of the robot does. So a state of a lost robot without a fault is explained by "nothing"
//! or by "unknown", whichever the identifier holds more likely.

use vigil_blocks::DECISION_STATES;
use vigil_pomdp::Pomdp;
use vigil_robot::FaultTree;

use crate::error::SupervisorError;
use crate::state_belief::position;
use crate::states::{self, StateMeaning, Subject};

/// Joins the parts of a name.
const JOINT: char = '-';

/// What the states of a decision model say about the hardware.
#[derive(Debug, Clone)]
pub(crate) struct JointStates {
    /// The states of the hardware, each once; the first means that nothing is wrong.
    pub hardware: Vec<StateMeaning>,
    /// Each state's, as an index of `hardware`.
    of_state: Vec<usize>,
    /// True for a lost robot without a fault.
    is_lost: Vec<bool>,
}

impl JointStates {
    /// Those of `model`; `None` if no state says anything about the hardware. `lost` is the
    /// exception of a robot that is lost.
    ///
    /// # Errors
    /// [`SupervisorError`] if a leaf or the unknown has no state, or none is of a lost robot.
    pub(crate) fn new(
        model: &Pomdp,
        tree: &FaultTree,
        lost: Option<&str>,
    ) -> Result<Option<Self>, SupervisorError> {
        let mut names = vec![tree.nodes()[0].name.clone()];
        let mut of_state = Vec::new();
        let mut is_lost = Vec::new();
        for state in model.states() {
            let part = hardware_part(state, tree).unwrap_or(&names[0]).to_owned();
            let found = names.iter().position(|name| *name == part);
            of_state.push(found.unwrap_or(names.len()));
            if found.is_none() {
                names.push(part);
            }
            let is_sound = found == Some(0);
            is_lost.push(is_sound && state.split(JOINT).any(|part| Some(part) == lost));
        }
        if let Some(lost) = lost.filter(|_| !is_lost.contains(&true)) {
            return Err(SupervisorError::LostState {
                found: lost.to_owned(),
                allowed: model.states().join(", "),
            });
        }
        if names.len() == 1 {
            return Ok(None);
        }
        if !of_state.contains(&0) {
            return Err(SupervisorError::NoState(names.swap_remove(0)));
        }
        Ok(Some(Self {
            hardware: states::states(&names, tree)?,
            of_state,
            is_lost,
        }))
    }

    /// Of each state of the model, which of the hardware it is.
    pub(crate) fn hardware_of_states(&self) -> &[usize] {
        &self.of_state
    }

    /// What `belief` says about the hardware.
    pub(crate) fn write_hardware(&self, belief: &[f64], hardware: &mut [f64]) {
        hardware.fill(0.0);
        for (b, of) in belief.iter().zip(&self.of_state) {
            if let Some(sum) = hardware.get_mut(*of) {
                *sum += b;
            }
        }
    }

    /// Writes `belief` with these probabilities of the hardware, which sum to 1. Where it holds a
    /// state of the hardware impossible, the navigation is as in `start`, and where that does too,
    /// anything.
    pub(crate) fn take_over(
        &self,
        hardware: &[f64],
        belief: &[f64],
        start: &[f64],
        joint: &mut [f64],
    ) {
        let unknown = position(&self.hardware, Subject::Unknown);
        let mut p = [0.0; DECISION_STATES];
        for (at, of) in hardware.iter().enumerate() {
            p[self.explanation(at)] += of;
        }
        let lost_is_unknown = unknown.is_some_and(|unknown| p[unknown] > p[0]);
        let explanation = |state: usize| match unknown {
            Some(unknown) if self.is_lost[state] && lost_is_unknown => unknown,
            _ => self.explanation(self.of_state[state]),
        };
        let mut sums = [Sums::default(); DECISION_STATES];
        for (state, (b, s)) in belief.iter().zip(start).enumerate() {
            let sums = &mut sums[explanation(state)];
            sums.belief += b;
            sums.start += s;
            sums.count += 1.0;
        }
        let of_states = joint.iter_mut().zip(belief.iter().zip(start));
        for (state, (weight, (b, s))) in of_states.enumerate() {
            let at = explanation(state);
            let share = match sums[at] {
                sums if sums.belief > 0.0 => b / sums.belief,
                sums if sums.start > 0.0 => s / sums.start,
                sums => 1.0 / sums.count,
            };
            *weight = p[at] * share;
        }
    }

    /// A new state and the settled one that means the same are one explanation.
    fn explanation(&self, at: usize) -> usize {
        let settled = self.hardware.get(at).and_then(|m| m.settles_to);
        settled.unwrap_or(at)
    }
}

/// Of the states of one explanation.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    belief: f64,
    start: f64,
    count: f64,
}

/// The part of a state's name that is about the hardware.
fn hardware_part<'a>(state: &'a str, tree: &FaultTree) -> Option<&'a str> {
    let last = state.rsplit(JOINT).next().unwrap_or(state);
    [state, last]
        .into_iter()
        .find(|part| states::is_of_hardware(part, tree))
}

#[cfg(test)]
mod tests;
