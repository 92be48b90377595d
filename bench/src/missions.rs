//! What Vigil is worth: whole missions of the simulated rover, in which something breaks.
//!
//! A mission ([`Plan`]) is a path of 20 m and a breakdown, drawn from a seed. Each commander
//! ([`Arm`]) drives it in the same world: same soil, same fault at the same place, same streams of
//! sensor noise. The rover executes the commander's action ([`vigil_sensor_sim::ActionGate`]).
//!
//! - A pilot who knows where the rover is steers it back to its path ([`pilot`]); actions change
//!   what the pilot wants.
//! - A mission ends at the end of the path, or after [`LIMIT_S`].
//! - Whoever has called for help without a break for [`HELP_S`] gets it: everything is mended for
//!   good, the filters begin anew, and the rover goes on from where it stands.
//! - What a mission is worth stands in `bench/missions.toml`, apart from every decision model.

mod breakdown;
mod commander;
mod drive;
mod explanation;
mod explorer;
mod kind;
mod order;
mod pilot;
mod plan;
mod prices;
mod recording;
mod report;
mod rules;
mod score;
mod sweep;
mod table;
mod told;

pub use breakdown::{Breakdown, Cause, PresentFault, drawn_wheel, encoder, stuck};
pub use commander::Arm;
pub use drive::{Mission, drive, record};
pub use explanation::Explanations;
pub use kind::Kind;
pub use order::{action_block, order};
pub use plan::{Plan, drawn_soil};
pub use prices::{MissionFile, Prices};
pub use report::{compare, document, lines, say, shortfalls};
pub use rules::{Rule, RuleInput, RuleOutput, Rules};
pub use score::{MEASURES, Measure, POINTS, Score, measure, price_1_m};
pub use sweep::mean_points;

use std::error::Error;
use std::path::Path;

use vigil_robot::Injection;
use vigil_robot::injection::Change;
use vigil_setup::{Setup, load_graph};

use crate::variation::Variation;

/// Longest mission, s.
pub const LIMIT_S: f64 = 300.0;
/// Time until called help arrives, s.
pub const HELP_S: f64 = 30.0;

/// The graph as it ships, and what is needed to judge missions.
#[derive(Debug, Clone)]
pub struct ShippedGraph {
    /// The configuration.
    pub setup: Setup,
    /// The same, with decisions by Q-MDP instead of a policy that was solved.
    pub heuristic: Setup,
    /// Prices, shares and rules.
    pub missions: MissionFile,
    /// What is changed of it and of its missions.
    pub variation: Variation,
}

impl ShippedGraph {
    /// Reads a graph file, of `config/` if the path is relative, and `bench/missions.toml`.
    ///
    /// # Errors
    /// A configuration that is refused.
    pub fn read(graph: &Path, variation: Variation) -> Result<Self, Box<dyn Error>> {
        let path = crate::root().join("config").join(graph);
        let setup = load_graph(&path, |file| variation.change_graph(file))?;
        let heuristic = load_graph(&path, |file| {
            variation.change_graph(file);
            file.supervisor.policy = "qmdp".to_owned();
            file.supervisor.policy_file = None;
        })?;
        Ok(Self {
            setup,
            heuristic,
            missions: MissionFile::read()?,
            variation,
        })
    }

    /// So many missions of every kind, from a seed on.
    #[must_use]
    pub fn plans(&self, per_kind: u64, first_seed: u64) -> Vec<Plan> {
        let mut plans = Plan::of_all_kinds(per_kind, first_seed);
        plans.iter_mut().for_each(|plan| plan.vary(&self.variation));
        plans
    }

    /// The commanders, Vigil first.
    #[must_use]
    pub const fn arms(&self) -> [Arm; 8] {
        let Rules {
            careful,
            stop_and_call,
            ladder,
        } = self.missions.rules;
        [
            Arm::Vigil,
            Arm::Rule(Rule::Careful(careful)),
            Arm::Rule(Rule::StopAndCall(stop_and_call)),
            Arm::Rule(Rule::Ladder(ladder)),
            Arm::Heuristic,
            Arm::Without,
            Arm::Told,
            Arm::ToldAtAlarm,
        ]
    }

    /// The change of the world that a specification asks for.
    ///
    /// # Errors
    /// One that the rover does not know.
    pub fn change(&self, spec: &str) -> Result<Change, Box<dyn Error>> {
        Ok(Injection::parse_change(spec, &self.setup.robot)?)
    }
}
