//! Tunes a rule: one setting after the other, each to the value with the most points.

use std::error::Error;

use serde_json::{Value, json};
use vigil_evaluation::parallel::in_parallel;

use super::ShippedGraph;
use super::commander::Arm;
use super::drive::{Mission, drive};
use super::plan::Plan;
use super::rules::Rule;
use super::score::POINTS;
use super::table::Table;

/// Rounds over all settings; fewer if one changes nothing.
const ROUNDS: u32 = 4;

/// A rule, tuned.
#[derive(Debug, Clone)]
pub struct Tuned {
    /// The best that was found.
    pub rule: Rule,
    /// Its points, weighed by the shares.
    pub points: f64,
    /// Every rule that was tried, with its points.
    pub tried: Vec<(Rule, f64)>,
}

impl Tuned {
    /// Every trial as numbers.
    #[must_use]
    pub fn document(&self) -> Value {
        let row = |(rule, points): &(Rule, f64)| json!({"rule": settings(rule), "points": points});
        let tried: Vec<Value> = self.tried.iter().map(row).collect();
        json!({"best": settings(&self.rule), "points": self.points, "tried": tried})
    }
}

fn settings(rule: &Rule) -> Value {
    match rule {
        Rule::Careful(settings) => json!(settings),
        Rule::StopAndCall(settings) => json!(settings),
        Rule::Ladder(settings) => json!(settings),
    }
}

/// Tunes a rule on missions, from where it stands. `said` takes a line of progress.
///
/// # Errors
/// A world or commander that cannot be made.
pub fn tune(
    shipped: &ShippedGraph,
    plans: &[Plan],
    start: Rule,
    said: impl Fn(&str),
) -> Result<Tuned, Box<dyn Error>> {
    let mut tuned = Tuned {
        rule: start,
        points: points(shipped, plans, start)?,
        tried: Vec::new(),
    };
    tuned.tried.push((start, tuned.points));
    for round in 1..=ROUNDS {
        let before = tuned.rule;
        for dimension in 0..start.dimensions() {
            for rule in tuned.rule.varied(dimension) {
                let points = match tuned.tried.iter().find(|(tried, _)| *tried == rule) {
                    Some((_, points)) => *points,
                    None => {
                        let points = points(shipped, plans, rule)?;
                        tuned.tried.push((rule, points));
                        points
                    }
                };
                if points > tuned.points {
                    (tuned.rule, tuned.points) = (rule, points);
                }
            }
            said(&format!(
                "{} round {round}: {:.1} by {}",
                start.name(),
                tuned.points,
                settings(&tuned.rule)
            ));
        }
        if tuned.rule == before {
            break;
        }
    }
    Ok(tuned)
}

/// Mean points of a rule, weighed by the shares of the kinds.
fn points(shipped: &ShippedGraph, plans: &[Plan], rule: Rule) -> Result<f64, Box<dyn Error>> {
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
