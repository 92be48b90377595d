//! What Vigil is worth in corridors: whole missions of the simulated rover, in which the way is
//! blocked, the robot is lost, a wheel or an encoder breaks, or two of these.
//!
//! A mission ([`CorridorPlan`]) is drawn from a seed. Each commander ([`CorridorArm`]) drives it in
//! the same world, through navigation, detector, identifier and, for Vigil, supervisor, as they run
//! live, in the frames' own time.
//!
//! - A mission ends at what the robot holds for its goal, when it gives up, or after [`LIMIT_S`].
//! - Help comes [`HELP_S`] after it was called for, clears the way, mends the robot and tells it
//!   its place.
//! - What a mission is worth stands in `bench/corridors.toml`, apart from every decision model.

mod commander;
mod drive;
mod exception;
mod explorer;
mod ladder;
mod layout;
mod live;
mod live_report;
mod plan;
mod prices;
mod recording;
mod report;
mod score;
mod sweep;

pub use commander::CorridorArm;
pub use drive::{CorridorMission, drive, record};
pub use exception::{Exception, Group};
pub use ladder::EscalationSettings;
pub use live::{LiveMission, drive_live};
pub use live_report::LiveComparison;
pub use plan::CorridorPlan;
pub use prices::{CorridorFile, CorridorPrices};
pub use report::{compare, document, lines, say, shortfalls};
pub use score::CorridorScore;
pub use sweep::mean_points;

use std::error::Error;

use vigil_setup::graph_file::Navigation;
use vigil_setup::{Setup, load_graph};

use crate::missions::{MissionFile, Prices};
use crate::variation::Variation;

/// Longest mission, s.
pub const LIMIT_S: f64 = 300.0;
/// Time until called help has come and mended everything, s: as in `missions`.
pub const HELP_S: f64 = crate::missions::HELP_S;

/// The graph as it ships, and what is needed to judge missions.
#[derive(Debug, Clone)]
pub struct CorridorGraph {
    /// The configuration; its corridor is replaced by that of each mission.
    pub setup: Setup,
    /// The settings of navigation, and a corridor that is replaced.
    shipped: Navigation,
    /// What is changed of it and of its missions.
    variation: Variation,
    /// Prices and rules.
    pub file: CorridorFile,
    /// Prices of what is driven with a fault.
    pub faults: Prices,
}

impl CorridorGraph {
    /// Reads the prices and `corridor-people.toml`; `decision`, if given, stands for its decision
    /// model.
    ///
    /// # Errors
    /// A configuration that is refused.
    pub fn read(variation: Variation, decision: Option<&str>) -> Result<Self, Box<dyn Error>> {
        let path = crate::root().join("config/corridor-people.toml");
        let setup = load_graph(&path, |file| {
            variation.change_graph(file);
            if let Some(decision) = decision {
                file.files.decision = decision.into();
            }
        })?;
        Ok(Self {
            shipped: setup.file.navigation.clone().ok_or("no corridor")?,
            variation,
            setup,
            file: CorridorFile::read()?,
            faults: MissionFile::read()?.prices,
        })
    }

    /// The mission of a seed.
    #[must_use]
    pub fn plan(&self, seed: u64) -> CorridorPlan {
        CorridorPlan::new(&self.shipped, &self.variation, seed)
    }

    /// So many missions, from a seed on.
    #[must_use]
    pub fn plans(&self, count: u64, first_seed: u64) -> Vec<CorridorPlan> {
        let seeds = first_seed..first_seed + count;
        seeds.map(|seed| self.plan(seed)).collect()
    }

    /// The commanders, Vigil first.
    #[must_use]
    pub const fn arms(&self) -> [CorridorArm; 3] {
        [
            CorridorArm::Vigil,
            CorridorArm::Ladder(self.file.ladder),
            CorridorArm::Without,
        ]
    }
}
