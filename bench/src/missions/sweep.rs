//! What a rule brings over missions: what the sweep tunes it by.

use std::error::Error;

use vigil_evaluation::parallel::in_parallel;

use super::ShippedGraph;
use super::commander::Arm;
use super::drive::{Mission, drive};
use super::plan::Plan;
use super::rules::Rule;
use super::score::POINTS;
use super::table::Table;

/// Mean points of a rule, weighed by the shares of the kinds.
///
/// # Errors
/// A world or commander that cannot be made.
pub fn mean_points(
    shipped: &ShippedGraph,
    plans: &[Plan],
    rule: Rule,
) -> Result<f64, Box<dyn Error>> {
    let arms = [Arm::Rule(rule)];
    let ride = |plan: &Plan| drive(shipped, plan, &arms).map_err(|e| e.to_string());
    let missions: Result<Vec<Mission>, String> = in_parallel(plans, ride).into_iter().collect();
    let table = Table {
        file: &shipped.missions,
        arms: &arms,
        missions: &missions?,
    };
    Ok(table
        .over_kinds(1.0, |kind| table.mean(kind, 0, POINTS))
        .mean)
}
