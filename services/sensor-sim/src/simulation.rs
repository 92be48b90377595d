//! The rover, its action gate and its navigation, without a port.

use vigil_blocks::{Action, RecoveryKind, SensorFrame};
use vigil_robot::injection::Change;

use crate::action_gate::{self, ActionGate, EffectiveCommand};
use crate::check::WorldError;
use crate::navigation::{
    ActionRequest, DecisionId, NavigationCondition, Navigator, NavigatorEvent,
};
use crate::world::World;

/// A simulated rover that drives its segments or, with a navigator, its path.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// The rover on its soil.
    pub world: World,
    gate: ActionGate,
    navigator: Option<Navigator>,
}

impl Simulation {
    /// From its parts.
    #[must_use]
    pub const fn new(world: World, gate: ActionGate, navigator: Option<Navigator>) -> Self {
        Self {
            world,
            gate,
            navigator,
        }
    }

    /// One cycle of `dt_s` under the newest action, at `now_ns`.
    // Never merged into its caller, so that its instructions can be counted.
    #[inline(never)]
    pub fn step(&mut self, dt_s: f64, action: Option<&Action>, now_ns: u64) -> EffectiveCommand {
        let planned = match &mut self.navigator {
            None => self.world.planned(),
            Some(navigator) => {
                let valid = action.filter(|action| action_gate::is_valid(action, now_ns));
                navigator.plan(dt_s, valid.and_then(request), self.world.true_state().pose)
            }
        };
        let command = self.gate.apply(planned, action, now_ns);
        self.world.step(dt_s, command);
        let help = self.navigator.as_mut().and_then(Navigator::take_help);
        if let Some(help) = help {
            // Ending what is on cannot fail: everything that can be injected can be ended.
            let _ = self.world.change(Change::ClearAll);
            if let Some(place) = help.place {
                self.world.set_at(place);
            }
        }
        // After help or a relocalisation a new run begins: the filters forget a state that is no
        // longer true.
        let was_relocalised = self
            .navigator
            .as_mut()
            .is_some_and(Navigator::take_relocalisation);
        if help.is_some() || was_relocalised {
            self.world.begin_run();
        }
        command
    }

    /// Reads the sensors into `frame`; its header is left to the caller.
    // Never merged into its caller, so that its instructions can be counted.
    #[inline(never)]
    pub fn measure(&mut self, frame: &mut SensorFrame) {
        self.world.measure(frame);
        if let Some(navigator) = &mut self.navigator {
            navigator.report(frame);
        }
    }

    /// Makes a change to the rover.
    ///
    /// # Errors
    /// [`WorldError`] naming what does not exist or is out of range.
    pub fn change(&mut self, change: Change) -> Result<(), WorldError> {
        self.world.change(change)
    }

    /// What is truly wrong with the navigation, of the way up to `range_m` ahead; `None` without
    /// one.
    #[must_use]
    pub fn navigation_condition(&self, range_m: f64) -> Option<NavigationCondition> {
        let pose = self.world.true_state().pose;
        self.navigator
            .as_ref()
            .map(|it| it.condition(pose, range_m))
    }

    /// True if the navigation has something within its bumper's reach.
    #[must_use]
    pub fn touches(&self) -> bool {
        self.navigator.as_ref().is_some_and(Navigator::is_touching)
    }

    /// What happened to the navigation in the last cycle, once.
    pub fn take_event(&mut self) -> Option<NavigatorEvent> {
        self.navigator.as_mut().and_then(Navigator::take_event)
    }
}

/// What an action asks of the navigation; `None` for a kind that this version does not know.
fn request(action: &Action) -> Option<ActionRequest> {
    Some(ActionRequest {
        kind: RecoveryKind::from_repr(action.kind)?,
        decision: DecisionId {
            epoch: action.header.epoch,
            seq: action.decision_seq,
        },
        speed_scale: action.speed_scale,
    })
}
