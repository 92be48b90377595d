//! What Vigil is worth: whole missions of the simulated rover, in which something breaks.
//!
//! A mission ([`Plan`]) is a path of some 20 m and a fault, drawn from a seed. Each commander
//! ([`Arm`]) drives it in the same world: same soil, same fault at the same time, same streams of
//! sensor noise. The rover executes the commander's action ([`vigil_sensor_sim::ActionGate`]).
//!
//! - The path is driven as planned, by the drive's own clock: nobody steers back to a path that was
//!   left. Slowed, the clock runs slower, so that the rover drives the same path.
//! - A mission ends when the plan is driven to its end, or after [`LIMIT_S`].
//! - Whoever has called for help without a break for [`HELP_S`] gets it: everything is mended, the
//!   filters begin anew, and the rover goes on from where it stands.
//! - The reward is that of the graph's decision model: the sum over epochs of the reward of the
//!   true state and the action. A remedy for another wheel than the broken one earns no more than
//!   going on would.

mod arm;
mod commander;
mod drive;
mod escalation;
mod plan;
mod report;
mod score;
mod table;

pub use arm::Arm;
pub use drive::{Mission, drive};
pub use escalation::{Escalation, Explanation, RuleInput, RuleOutput};
pub use plan::{Fault, Kind, Plan};
pub use report::{document, lines, lost_against, say};
pub use score::{MEASURES, Measure, ObeyedOrder, Pay, Score, Truth};

use std::error::Error;

use vigil_blocks::RecoveryKind;
use vigil_pomdp::Pomdp;
use vigil_pomdp::mdp::{self, Solution};
use vigil_robot::Injection;
use vigil_robot::injection::Change;
use vigil_setup::{Setup, load_graph};

/// Longest mission, s.
pub const LIMIT_S: f64 = 300.0;
/// Time until called help arrives, s.
pub const HELP_S: f64 = 30.0;

/// The graph as it ships, and what is needed to judge missions.
#[derive(Debug, Clone)]
pub struct ShippedGraph {
    /// The configuration.
    pub setup: Setup,
    /// The decision model's fully observable relaxation: what to do about a state that is known.
    pub solution: Solution,
}

impl ShippedGraph {
    /// Reads `config/rover.toml`; frames come `rate_hz` times a second.
    ///
    /// # Errors
    /// A configuration that is refused.
    pub fn read(rate_hz: f64) -> Result<Self, Box<dyn Error>> {
        let path = crate::root().join("config/rover.toml");
        let setup = load_graph(&path, |file| file.graph.rate_hz = rate_hz)?;
        let solution = mdp::solve(&setup.decision)?;
        Ok(Self { setup, solution })
    }

    /// The decision model.
    #[must_use]
    pub const fn model(&self) -> &Pomdp {
        &self.setup.decision
    }

    /// First action of a kind; `None` if the model has none.
    #[must_use]
    pub fn action(&self, kind: RecoveryKind) -> Option<usize> {
        let actions = 0..self.model().actions().len();
        actions
            .into_iter()
            .find(|action| self.kind(*action) == kind)
    }

    /// Kind of an action.
    #[must_use]
    pub fn kind(&self, action: usize) -> RecoveryKind {
        let name = self.model().actions().get(action);
        let settings = &self.setup.file.supervisor.actions;
        let recovery = name.and_then(|name| settings.get(name));
        recovery.map_or(RecoveryKind::None, |action| action.kind.into())
    }

    /// Share of the planned speed under an action; what moves drives at full speed by default.
    #[must_use]
    pub fn speed_scale(&self, action: usize) -> f64 {
        let stands = matches!(
            self.kind(action),
            RecoveryKind::None | RecoveryKind::Stop | RecoveryKind::CallForHelp
        );
        let name = self.model().actions().get(action);
        let settings = &self.setup.file.supervisor.actions;
        let given = name.and_then(|name| settings.get(name)?.speed_scale);
        given.unwrap_or(if stands { 0.0 } else { 1.0 })
    }

    /// True if a rover in `state` has nothing better to do than to stand.
    #[must_use]
    pub fn may_stand(&self, state: usize) -> bool {
        matches!(
            self.kind(self.solution.best(state)),
            RecoveryKind::Stop | RecoveryKind::CallForHelp
        )
    }

    /// The change of the world that a specification asks for.
    ///
    /// # Errors
    /// One that the rover does not know.
    pub fn change(&self, spec: &str) -> Result<Change, Box<dyn Error>> {
        Ok(Injection::parse_change(spec, &self.setup.robot)?)
    }
}
