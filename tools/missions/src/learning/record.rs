//! What was recorded of one mission.

use std::ops::ControlFlow;

use crate::simulation::{Agent, Episode, Mission, Rules, run_watched};
use vigil_pomdp::Pomdp;

/// One mission of T steps: action t is taken in state t and leads to state t + 1, where
/// observation t is made.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Record {
    /// T indices of actions.
    pub actions: Vec<u32>,
    /// T indices of observations.
    pub observations: Vec<u32>,
    /// T rewards, or none if they were not measured.
    pub rewards: Vec<f64>,
    /// T + 1 states where they are known, the first one before the first action; or none.
    pub labels: Vec<Option<u32>>,
}

/// Why a record does not fit a model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RecordError {
    /// Lists of different lengths.
    #[error("{what}: {found} entries, allowed are {allowed}")]
    Length {
        /// Which list.
        what: &'static str,
        /// Its length.
        found: usize,
        /// What would fit.
        allowed: String,
    },
    /// An index beyond the model.
    #[error("step {step}: {what} {found}, the model has {count}")]
    Index {
        /// Step, from 0.
        step: usize,
        /// What kind of index.
        what: &'static str,
        /// The index.
        found: u32,
        /// How many the model has.
        count: usize,
    },
    /// A reward that is no number.
    #[error("step {0}: the reward is not finite")]
    Reward(usize),
}

impl Record {
    /// Steps.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.actions.len()
    }

    /// The state at step `t` (0: before the first action), if it is known.
    pub(super) fn label(&self, t: usize) -> Option<u32> {
        self.labels.get(t).copied().flatten()
    }

    /// sum_t gamma^t r_t of what was measured; `None` if nothing was.
    #[must_use]
    pub fn discounted(&self, discount: f64) -> Option<f64> {
        let add = |(sum, weight): (f64, f64), r: &f64| (sum + weight * r, weight * discount);
        let sum = self.rewards.iter().fold((0.0, 1.0), add).0;
        (!self.rewards.is_empty()).then_some(sum)
    }

    /// Refuses what does not fit `model`.
    ///
    /// # Errors
    /// [`RecordError`].
    pub fn check(&self, model: &Pomdp) -> Result<(), RecordError> {
        let steps = self.steps();
        let lengths = [
            ("observations", self.observations.len(), [steps, steps]),
            ("rewards", self.rewards.len(), [steps, 0]),
            ("states", self.labels.len(), [steps + 1, 0]),
        ];
        for (what, found, allowed) in lengths {
            if !allowed.contains(&found) {
                let allowed = format!("{} ({steps} actions)", allowed[0]);
                return Err(RecordError::Length {
                    what,
                    found,
                    allowed,
                });
            }
        }
        let known = self.labels.iter().map(|label| label.unwrap_or(0)).collect();
        let indices: [(_, &Vec<u32>, _); 3] = [
            ("action", &self.actions, model.actions().len()),
            (
                "observation",
                &self.observations,
                model.observations().len(),
            ),
            ("state", &known, model.states().len()),
        ];
        for (what, list, count) in indices {
            if let Some(step) = list.iter().position(|&index| index as usize >= count) {
                let found = list[step];
                return Err(RecordError::Index {
                    step,
                    what,
                    found,
                    count,
                });
            }
        }
        match self.rewards.iter().position(|r| !r.is_finite()) {
            Some(step) => Err(RecordError::Reward(step)),
            None => Ok(()),
        }
    }

    /// A mission of the event simulator, with its rewards and, if `labelled`, its states.
    pub fn simulated(
        model: &Pomdp,
        agent: &mut dyn Agent,
        rules: &Rules,
        episode: Episode,
        labelled: bool,
    ) -> (Self, Mission) {
        let mut record = Self::default();
        let mission = run_watched(model, agent, rules, episode, &mut |seen| {
            record.actions.push(seen.action as u32);
            record.observations.push(seen.observation as u32);
            record.rewards.push(seen.reward);
            if labelled {
                if record.labels.is_empty() {
                    record.labels.push(Some(seen.before as u32));
                }
                record.labels.push(Some(seen.after as u32));
            }
            ControlFlow::Continue(())
        });
        (record, mission)
    }
}
