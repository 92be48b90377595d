//! Commanders compared under each variation, in words and numbers.

use serde_json::{Value, json};

use crate::archive::Archive;
use crate::interval::Interval;

/// What the missions of one variation brought.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// What is changed.
    pub name: String,
    /// Vigil first.
    pub commanders: Vec<Commanded>,
}

/// What one commander brought.
#[derive(Debug, Clone)]
pub struct Commanded {
    /// The commander.
    pub name: &'static str,
    /// Points.
    pub points: Interval,
    /// Points of Vigil less its own, in the same missions.
    pub vigil_less: Interval,
    /// Calls for help in a mission.
    pub calls: f64,
    /// Harm done in a mission; what counts as harm says the head of the table.
    pub harm: f64,
}

impl Comparison {
    fn others(&self) -> &[Commanded] {
        self.commanders.get(1..).unwrap_or_default()
    }

    fn cells(&self) -> Vec<String> {
        let of_all = |text: fn(&Commanded) -> String| self.commanders.iter().map(text);
        let points = of_all(|it| format!("{:.1}", it.points.mean));
        let leads = self.others().iter();
        let leads = leads.map(|it| it.vigil_less.text(1, true));
        let calls = of_all(|it| format!("{:.2}", it.calls));
        let harm = of_all(|it| format!("{:.3}", it.harm));
        let name = std::iter::once(self.name.clone());
        let cells = name.chain(points).chain(leads).chain(calls).chain(harm);
        cells.collect()
    }

    /// All figures.
    #[must_use]
    pub fn document(&self) -> Value {
        let mut document = json!({"name": self.name});
        for it in &self.commanders {
            document["commanders"][it.name] = json!({
                "points": it.points.document(),
                "vigil_minus_this": it.vigil_less.document(),
                "calls": it.calls,
                "harm": it.harm,
            });
        }
        document
    }
}

/// One row for each variation; `harm` says what counts as harm.
pub fn say_comparisons(archive: &mut Archive, comparisons: &[Comparison], harm: &str) {
    let Some(first) = comparisons.first() else {
        return;
    };
    let names = || first.commanders.iter().map(|it| it.name);
    let leads = first.others().iter();
    let head: Vec<String> = std::iter::once("changed".to_owned())
        .chain(names().map(|name| format!("{name}, points")))
        .chain(leads.map(|it| format!("Vigil less {}", it.name)))
        .chain(names().map(|name| format!("{name}, calls")))
        .chain(names().map(|name| format!("{name}, {harm}")))
        .collect();
    archive.say(&format!("| {} |", head.join(" | ")));
    archive.say(&format!("|{}", "---|".repeat(head.len())));
    for comparison in comparisons {
        archive.say(&format!("| {} |", comparison.cells().join(" | ")));
    }
}

/// The variations in which Vigil is not above every other commander by more than the interval.
#[must_use]
pub fn without_lead(comparisons: &[Comparison]) -> Vec<String> {
    let mut short = Vec::new();
    for comparison in comparisons {
        for it in comparison.others() {
            // One mission has no interval: it shows no lead.
            let leads = it.vigil_less.lower() > 0.0;
            if !leads {
                let (lead, other) = (it.vigil_less.text(1, true), it.name);
                let name = &comparison.name;
                short.push(format!("{name}: {lead} against {other}, bar above 0"));
            }
        }
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lead_counts_beyond_its_interval() {
        let comparison = |name: &str, lead: f64| {
            let commanded = |name, mean| Commanded {
                name,
                points: Interval {
                    mean,
                    half_width: 5.0,
                },
                vigil_less: Interval {
                    mean: lead,
                    half_width: 2.0,
                },
                calls: 0.5,
                harm: 0.25,
            };
            Comparison {
                name: name.to_owned(),
                commanders: vec![commanded("Vigil", 10.0 + lead), commanded("ladder", 10.0)],
            }
        };
        let all = [comparison("as shipped", 3.0), comparison("soft soil", 1.0)];
        let short = without_lead(&all);
        assert_eq!(short, ["soft soil: +1.0 ± 2.0 against ladder, bar above 0"]);
        let cells = all[0].cells();
        let expected = [
            "as shipped",
            "13.0",
            "10.0",
            "+3.0 ± 2.0",
            "0.50",
            "0.50",
            "0.250",
            "0.250",
        ];
        assert_eq!(cells, expected);
        let lead = &all[1].document()["commanders"]["ladder"]["vigil_minus_this"];
        assert_eq!(lead["mean"], 1.0);
    }
}
