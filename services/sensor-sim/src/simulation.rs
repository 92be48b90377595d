//! The rover, what it makes of actions, and the way that it finds, without a port.

use vigil_blocks::{Action, SensorFrame};
use vigil_robot::injection::Change;

use crate::navigation::{Navigator, NavigatorEvent, Order};
use crate::{EffectiveCommand, Obedience, World, WorldError, obedience};

/// A simulated rover that drives its segments or, with a navigator, its path.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// The rover on its soil.
    pub world: World,
    obedience: Obedience,
    navigator: Option<Navigator>,
}

impl Simulation {
    /// From its parts.
    #[must_use]
    pub const fn new(world: World, obedience: Obedience, navigator: Option<Navigator>) -> Self {
        Self {
            world,
            obedience,
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
                let order = action.filter(|a| obedience::is_valid(a, now_ns));
                let order = order.and_then(order_of);
                navigator.plan(dt_s, order, self.world.truth().pose)
            }
        };
        let command = self.obedience.apply(planned, action, now_ns);
        self.world.step(dt_s, command);
        let helped = self.navigator.as_mut().is_some_and(Navigator::helped);
        if helped {
            // Mending what is broken cannot fail: everything that can be broken can be mended.
            let _ = self.world.change(Change::ClearAll);
        }
        // Whoever has helped begins a new run, and so does a robot that finds itself elsewhere: the
        // filters forget what is no longer so, or never was.
        let found = self.navigator.as_mut().is_some_and(Navigator::found);
        if helped || found {
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

    /// What happened to the navigation in the last cycle, once.
    pub fn happening(&mut self) -> Option<NavigatorEvent> {
        self.navigator.as_mut().and_then(Navigator::happening)
    }
}

fn order_of(action: &Action) -> Option<Order> {
    Some(Order {
        kind: vigil_blocks::RecoveryKind::from_wire(action.kind)?,
        decision: (action.header.epoch, action.decision_seq),
        speed_scale: action.speed_scale,
    })
}
