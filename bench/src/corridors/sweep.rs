//! What a ladder brings over missions: what the sweep tunes it by.

use std::error::Error;

use vigil_evaluation::parallel::in_parallel;

use super::CorridorGraph;
use super::commander::CorridorArm;
use super::drive::{CorridorMission, drive};
use super::ladder::EscalationSettings;
use super::plan::CorridorPlan;

/// Mean points of a ladder.
///
/// # Errors
/// A world or commander that cannot be made.
pub fn mean_points(
    graph: &CorridorGraph,
    plans: &[CorridorPlan],
    settings: EscalationSettings,
) -> Result<f64, Box<dyn Error>> {
    let arms = [CorridorArm::Ladder(settings)];
    let ride = |plan: &CorridorPlan| drive(graph, plan, &arms).map_err(|e| e.to_string());
    let missions: Result<Vec<CorridorMission>, String> =
        in_parallel(plans, ride).into_iter().collect();
    let missions = missions?;
    let scores = missions.iter().filter_map(|it| it.scores.first());
    let sum: f64 = scores.map(|score| score.points).sum();
    Ok(sum / missions.len() as f64)
}
