//! The deterministic baseline: the longer something fires, the stronger the remedy.

use super::{Act, Agent};
use vigil_pomdp::Pomdp;
use vigil_pomdp::policy::Control;

/// Follows a ladder of actions: after so many firings in a row the first rung, after as many more
/// the next, the last again and again. Between rungs, and after a quiet observation, which begins
/// the count anew at the lowest rung, the usual action.
#[derive(Debug, Clone, PartialEq)]
pub struct Escalation {
    usual: usize,
    ladder: Vec<usize>,
    is_quiet: Vec<bool>,
    patience: usize,
    firings: usize,
    rung: usize,
}

/// Why an escalation cannot be set up.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EscalationError {
    /// An action is not in the model.
    #[error("escalation: the model has no action '{0}'")]
    Action(String),
    /// An observation is not in the model.
    #[error("escalation: the model has no observation '{0}'")]
    Observation(String),
    /// No rung, or no patience.
    #[error("escalation: allowed are one rung or more, and one firing or more per rung")]
    Empty,
}

impl Escalation {
    /// By names: the `usual` action, the `ladder`, the observations that are `quiet`; `patience`
    /// is the number of firings per rung.
    ///
    /// # Errors
    /// [`EscalationError`].
    pub fn new(
        model: &Pomdp,
        usual: &str,
        ladder: &[&str],
        quiet: &[&str],
        patience: usize,
    ) -> Result<Self, EscalationError> {
        if ladder.is_empty() || patience == 0 {
            return Err(EscalationError::Empty);
        }
        let action = |name: &str| {
            let index = model.actions().iter().position(|a| a == name);
            index.ok_or_else(|| EscalationError::Action(name.to_owned()))
        };
        let mut is_quiet = vec![false; model.observations().len()];
        for name in quiet {
            let index = model.observations().iter().position(|z| z == name);
            let index = index.ok_or_else(|| EscalationError::Observation((*name).to_owned()))?;
            is_quiet[index] = true;
        }
        Ok(Self {
            usual: action(usual)?,
            ladder: ladder
                .iter()
                .copied()
                .map(action)
                .collect::<Result<_, _>>()?,
            is_quiet,
            patience,
            firings: 0,
            rung: 0,
        })
    }
}

impl Agent for Escalation {
    fn begin(&mut self) {
        (self.firings, self.rung) = (0, 0);
    }

    fn decide(&mut self, _chance: f64) -> Act {
        let mut action = self.usual;
        if self.firings >= self.patience {
            self.firings = 0;
            action = self.ladder[self.rung];
            self.rung = (self.rung + 1).min(self.ladder.len() - 1);
        }
        Act {
            action,
            control: Control::Policy,
        }
    }

    fn notice(&mut self, _action: usize, observation: usize) -> bool {
        if self.is_quiet.get(observation).copied().unwrap_or(false) {
            self.begin();
        } else {
            self.firings += 1;
        }
        true
    }
}
