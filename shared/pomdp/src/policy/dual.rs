//! Dual control: act by a policy while the belief is certain enough, else gather information.
//!
//! DM-X and ADM-X of the paper: if the entropy is at most K, the action of X; else the action
//! after which the expected entropy of the state (DM) or of the action (ADM) is least. The paper
//! gives neither K nor the unit of the entropy, which here is normalised to 0..1, and it gates
//! both on the entropy of the state; others gate ADM on that of the action, which is the default.
//!
//! Two guards are ours, and off in [`Dual::as_published`]. An action that makes the state certain
//! by force (a restart, giving up) teaches most by the formula, at any price: hence information
//! comes from a declared set of actions. And where no action of the set lowers the entropy, X acts.

use super::entropy::normalised_entropy;
use super::{Choice, Control, LookAhead, Measure, Policy, Votes, choose_among};
use crate::bounds::mdp::Solution;
use crate::model::Pomdp;

/// An entropy that falls by less has not fallen.
const FALL_MIN: f64 = 1e-9;

/// Whose entropy dual control lowers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Information {
    /// The state's (DM).
    State,
    /// The action's (ADM): the votes of the states for their best actions.
    Action,
}

/// Whose entropy is compared with the threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gate {
    /// The state's, divided by ln |S|.
    State,
    /// The action's, divided by ln |A|.
    Action,
}

/// Settings of dual control.
#[derive(Debug, Clone, PartialEq)]
pub struct Dual {
    /// Whose entropy is to fall.
    pub information: Information,
    /// Whose entropy decides whether it has to.
    pub gate: Gate,
    /// K: information is gathered above this entropy, 0 to 1; 1 never.
    pub threshold: f64,
    /// Indices of the actions that may be taken for information; `None` for all.
    pub allowed: Option<Vec<usize>>,
    /// After so many steps in a row without falling entropy X acts, until it has fallen; 0 never.
    pub stall_steps: u32,
}

impl Dual {
    /// Gated on the entropy that it lowers; no guards.
    #[must_use]
    pub const fn new(information: Information, threshold: f64) -> Self {
        let gate = match information {
            Information::State => Gate::State,
            Information::Action => Gate::Action,
        };
        Self {
            information,
            gate,
            threshold,
            allowed: None,
            stall_steps: 0,
        }
    }

    /// As published: gated on the state's entropy, all actions, no guard.
    #[must_use]
    pub const fn as_published(information: Information, threshold: f64) -> Self {
        let mut dual = Self::new(information, threshold);
        dual.gate = Gate::State;
        dual
    }
}

/// Why dual control cannot be set up.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DualError {
    /// The threshold is no entropy.
    #[error("threshold {0}: allowed is 0 to 1")]
    Threshold(f64),
    /// The set of information actions is empty.
    #[error("no information action: allowed are one or more of the model's actions")]
    NoAction,
    /// An information action is not in the model.
    #[error("information action {found}: the model has {actions} actions")]
    Action {
        /// Index that was given.
        found: usize,
        /// Actions of the model.
        actions: usize,
    },
}

/// DM-X or ADM-X. In a step for information the values are the expected entropies, negative.
pub struct DualControl {
    policy: Box<dyn Policy>,
    settings: Dual,
    look_ahead: LookAhead,
    is_allowed: Vec<bool>,
    votes: Votes,
    run: Run,
}

/// A row of steps for information.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    /// Least entropy since it began; `None` outside a run.
    least: Option<f64>,
    /// Steps since it was reached.
    stalled: u32,
}

impl DualControl {
    /// Around `policy`, for a model and its fully observable relaxation.
    ///
    /// # Errors
    /// [`DualError`] for a threshold beyond 0 to 1, and for information actions that are none.
    pub fn new(
        policy: Box<dyn Policy>,
        model: &Pomdp,
        solution: &Solution,
        settings: Dual,
    ) -> Result<Self, DualError> {
        if !(0.0..=1.0).contains(&settings.threshold) {
            return Err(DualError::Threshold(settings.threshold));
        }
        let actions = model.actions().len();
        let mut is_allowed = vec![settings.allowed.is_none(); actions];
        for &found in settings.allowed.iter().flatten() {
            let slot = is_allowed.get_mut(found);
            *slot.ok_or(DualError::Action { found, actions })? = true;
        }
        if !is_allowed.contains(&true) {
            return Err(DualError::NoAction);
        }
        Ok(Self {
            policy,
            settings,
            look_ahead: LookAhead::new(model, solution),
            is_allowed,
            votes: Votes::new(solution),
            run: Run::default(),
        })
    }

    /// The entropy that the threshold is for.
    fn gate_entropy(&mut self, belief: &[f64]) -> f64 {
        match self.settings.gate {
            Gate::State => normalised_entropy(belief),
            Gate::Action => {
                self.votes.count(belief);
                self.votes.entropy()
            }
        }
    }

    /// True if gathering information has led nowhere for too long. `entropy` is above the
    /// threshold.
    fn has_stalled(&mut self, entropy: f64) -> bool {
        let run = &mut self.run;
        match run.least {
            Some(least) if entropy >= least - FALL_MIN => {
                run.stalled = run.stalled.saturating_add(1);
            }
            _ => {
                *run = Run {
                    least: Some(entropy),
                    stalled: 0,
                }
            }
        }
        self.settings.stall_steps > 0 && run.stalled >= self.settings.stall_steps
    }
}

impl Policy for DualControl {
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        let entropy = self.gate_entropy(belief);
        if entropy <= self.settings.threshold {
            self.run = Run::default();
            return self.policy.evaluate(belief, values);
        }
        if self.has_stalled(entropy) {
            let choice = self.policy.evaluate(belief, values);
            return Choice {
                control: Control::Stalled,
                ..choice
            };
        }
        match self.settings.information {
            Information::State => self.look_ahead.state_entropies(belief, values),
            Information::Action => self.look_ahead.action_entropies(belief, values),
        }
        values.iter_mut().for_each(|value| *value = -*value);
        let is_allowed = |action| self.is_allowed.get(action).copied().unwrap_or(false);
        Choice {
            control: Control::Dual,
            ..choose_among(values, self.votes.count(belief), is_allowed)
        }
    }

    fn measure(&self) -> Measure {
        self.policy.measure()
    }

    fn reset(&mut self) {
        self.run = Run::default();
        self.policy.reset();
    }

    fn keep(&self, put: &mut dyn FnMut(f64)) {
        // No entropy is infinite.
        put(self.run.least.unwrap_or(f64::INFINITY));
        put(f64::from(self.run.stalled));
        self.policy.keep(put);
    }

    fn resume(&mut self, take: &mut dyn FnMut() -> f64) {
        self.run.least = Some(take()).filter(|least| least.is_finite());
        self.run.stalled = take() as u32;
        self.policy.resume(take);
    }
}
