//! Who acts in a mission.

use std::borrow::BorrowMut;

use vigil_pomdp::Pomdp;
use vigil_pomdp::policy::{Control, Decider};
use vigil_pomdp::{Evidence, Tracker};

/// What an agent does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Act {
    /// Index of the action.
    pub action: usize,
    /// What it was chosen for.
    pub control: Control,
}

/// Acts on what it observes.
pub trait Agent {
    /// A mission begins.
    fn begin(&mut self);

    /// Chooses; `chance` is uniform in [0, 1), for agents that need it.
    fn decide(&mut self, chance: f64) -> Act;

    /// Is told what came of `action`; false if the observation is impossible in its eyes.
    fn notice(&mut self, action: usize, observation: usize) -> bool;
}

/// A policy, and the belief that it acts on.
pub struct PolicyAgent<'m, D = Decider> {
    model: &'m Pomdp,
    tracker: Tracker,
    decider: D,
}

impl<'m, D: BorrowMut<Decider>> PolicyAgent<'m, D> {
    /// Believes in `model`, decides by `decider`, its own or a borrowed one.
    #[must_use]
    pub fn new(model: &'m Pomdp, decider: D) -> Self {
        let tracker = Tracker::new(model);
        Self {
            model,
            tracker,
            decider,
        }
    }

    /// What it believes.
    #[must_use]
    pub fn belief(&self) -> &[f64] {
        self.tracker.belief()
    }
}

impl<D: BorrowMut<Decider>> Agent for PolicyAgent<'_, D> {
    fn begin(&mut self) {
        self.tracker.reset();
        self.decider.borrow_mut().reset();
    }

    fn decide(&mut self, _chance: f64) -> Act {
        let decider = self.decider.borrow_mut();
        let decision = decider.decide(self.tracker.belief());
        Act {
            action: decision.action,
            control: decision.control,
        }
    }

    fn notice(&mut self, action: usize, observation: usize) -> bool {
        self.tracker.update(self.model, action, observation) != Evidence::Impossible
    }
}

/// Any action, all equally probable.
#[derive(Debug, Clone, Copy)]
pub struct Random {
    actions: usize,
}

impl Random {
    /// Among so many actions.
    #[must_use]
    pub const fn new(actions: usize) -> Self {
        Self { actions }
    }
}

impl Agent for Random {
    fn begin(&mut self) {}

    fn decide(&mut self, chance: f64) -> Act {
        let action = (chance * self.actions as f64) as usize;
        Act {
            action: action.min(self.actions.saturating_sub(1)),
            control: Control::Policy,
        }
    }

    fn notice(&mut self, _action: usize, _observation: usize) -> bool {
        true
    }
}
