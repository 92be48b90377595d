//! Means and paired differences of missions.

use serde_json::{Value, json};
use vigil_missions::simulation::{PairedDifference, Summary};

use super::arm::Arm;
use super::drive::Mission;
use super::plan::Kind;
use super::score::{MEASURES, Measure, Score};

/// Missions of a kind; all for `None`.
pub(super) fn select(missions: &[Mission], kind: Option<Kind>) -> Vec<&Mission> {
    let is = |mission: &&Mission| kind.is_none_or(|kind| mission.plan.kind == kind);
    missions.iter().filter(is).collect()
}

fn values(missions: &[&Mission], arm: Arm, of: fn(&Score) -> f64) -> Vec<f64> {
    let at = Arm::ALL.iter().position(|other| *other == arm).unwrap_or(0);
    missions.iter().map(|m| of(&m.scores[at])).collect()
}

/// Of one figure, what a commander brings.
pub(super) fn summary(missions: &[&Mission], arm: Arm, measure: Measure) -> Summary {
    Summary::new(&mut values(missions, arm, measure.of))
}

/// Of one figure, Vigil less another commander.
pub(super) fn against(missions: &[&Mission], other: Arm, measure: Measure) -> PairedDifference {
    let ours = values(missions, Arm::Vigil, measure.of);
    PairedDifference::new(&ours, &values(missions, other, measure.of))
}

/// All figures of these missions.
pub(super) fn figures(missions: &[&Mission]) -> Value {
    let mut arms = json!({});
    for arm in Arm::ALL {
        for measure in MEASURES {
            let found = summary(missions, arm, measure);
            let mut value = json!({
                "mean": found.mean, "half_width_95": found.half_width, "median": found.median,
            });
            if arm != Arm::Vigil {
                let paired = against(missions, arm, measure);
                value["vigil_minus_this"] = json!({
                    "mean": paired.difference, "half_width_95": paired.half_width, "p": paired.p,
                });
            }
            arms[arm.name()][measure.key] = value;
        }
    }
    json!({ "missions": missions.len(), "arms": arms })
}

/// Rows of a table: every figure, a column for each commander.
pub(super) fn means(missions: &[&Mission]) -> Vec<String> {
    let names: Vec<&str> = Arm::ALL.iter().map(|arm| arm.name()).collect();
    let mut rows = vec![
        format!("| mean ± 95 % | {} |", names.join(" | ")),
        format!("|---|{}", "---|".repeat(names.len())),
    ];
    for measure in MEASURES {
        let cell = |arm: &Arm| {
            let found = summary(missions, *arm, measure);
            let places = measure.decimals;
            format!("{:.places$} ± {:.places$}", found.mean, found.half_width)
        };
        let cells: Vec<String> = Arm::ALL.iter().map(cell).collect();
        rows.push(format!("| {} | {} |", measure.name, cells.join(" | ")));
    }
    rows
}

/// Rows of a table: every figure, Vigil less each other commander.
pub(super) fn differences(missions: &[&Mission]) -> Vec<String> {
    let others: Vec<Arm> = Arm::ALL.into_iter().filter(|a| *a != Arm::Vigil).collect();
    let names: Vec<&str> = others.iter().map(|arm| arm.name()).collect();
    let mut rows = vec![
        format!(
            "| Vigil less ... (± 95 %, paired) | {} |",
            names.join(" | ")
        ),
        format!("|---|{}", "---|".repeat(names.len())),
    ];
    for measure in MEASURES {
        let cell = |arm: &Arm| {
            let found = against(missions, *arm, measure);
            let places = measure.decimals;
            format!(
                "{:+.places$} ± {:.places$}",
                found.difference, found.half_width
            )
        };
        let cells: Vec<String> = others.iter().map(cell).collect();
        rows.push(format!("| {} | {} |", measure.name, cells.join(" | ")));
    }
    rows
}
