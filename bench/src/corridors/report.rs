//! Missions in corridors in words and numbers.

use serde_json::{Value, json};
use vigil_missions::simulation::{PairedDifference, Summary};

use super::commander::CorridorArm;
use super::drive::CorridorMission;
use super::exception::Group;
use super::score::{CALLS, CorridorScore, MEASURES, POINTS, TOUCHES};
use super::{HELP_S, LIMIT_S};
use crate::archive::Archive;
use crate::interval::Interval;
use crate::missions::Measure;
use crate::variation::{Commanded, Comparison};

/// Largest probability of Vigil's lead, were there none.
const P_MAX: f64 = 1e-3;

/// What was driven, by whom.
struct Table<'a> {
    arms: &'a [CorridorArm],
    missions: &'a [CorridorMission],
}

impl Table<'_> {
    /// Values of a commander, in missions of a group or all.
    fn values(&self, group: Option<Group>, arm: usize, of: fn(&CorridorScore) -> f64) -> Vec<f64> {
        let is_of = |m: &&CorridorMission| group.is_none_or(|group| m.plan.group() == group);
        let missions = self.missions.iter().filter(is_of);
        missions.filter_map(|m| m.scores.get(arm)).map(of).collect()
    }

    fn mean(&self, group: Option<Group>, arm: usize, measure: Measure<CorridorScore>) -> Summary {
        Summary::new(&mut self.values(group, arm, measure.of))
    }

    /// Vigil less another commander.
    fn against(
        &self,
        group: Option<Group>,
        arm: usize,
        measure: Measure<CorridorScore>,
    ) -> PairedDifference {
        let ours = self.values(group, 0, measure.of);
        PairedDifference::new(&ours, &self.values(group, arm, measure.of))
    }

    fn figures(&self, group: Option<Group>) -> Value {
        let mut figures = json!({});
        for (at, arm) in self.arms.iter().enumerate() {
            for measure in MEASURES {
                let found = self.mean(group, at, measure);
                let mut value = json!({"mean": found.mean, "half_width_95": found.half_width});
                if at > 0 {
                    let found = self.against(group, at, measure);
                    value["vigil_minus_this"] = json!({
                        "mean": found.difference,
                        "half_width_95": found.half_width,
                        "p": found.p,
                    });
                }
                figures[arm.name()][measure.key] = value;
            }
        }
        figures
    }
}

/// Groups with their names, then all missions.
fn selections() -> Vec<(Option<Group>, &'static str)> {
    let groups = Group::ALL.map(|group| (Some(group), group.name()));
    groups.into_iter().chain([(None, "all")]).collect()
}

/// All figures.
#[must_use]
pub fn document(arms: &[CorridorArm], missions: &[CorridorMission]) -> Value {
    let table = Table { arms, missions };
    let mut document = json!({
        "missions": missions.len(), "limit_s": LIMIT_S, "help_s": HELP_S,
        "short": shortfalls(arms, missions),
    });
    for (group, name) in selections() {
        document["figures"][name] = table.figures(group);
    }
    document
}

/// What the missions of a variation of this name brought. Harm is how often the robot ran into
/// something.
#[must_use]
pub fn compare(arms: &[CorridorArm], missions: &[CorridorMission], name: &str) -> Comparison {
    let table = Table { arms, missions };
    let commanded = |(at, arm): (usize, &CorridorArm)| {
        let (points, lead) = (
            table.mean(None, at, POINTS),
            table.against(None, at, POINTS),
        );
        Commanded {
            name: arm.name(),
            points: Interval {
                mean: points.mean,
                half_width: points.half_width,
            },
            vigil_less: Interval {
                mean: lead.difference,
                half_width: lead.half_width,
            },
            calls: table.mean(None, at, CALLS).mean,
            harm: table.mean(None, at, TOUCHES).mean,
        }
    };
    Comparison {
        name: name.to_owned(),
        commanders: arms.iter().enumerate().map(commanded).collect(),
    }
}

/// One line of CSV per mission and commander, with a head.
#[must_use]
pub fn lines(arms: &[CorridorArm], missions: &[CorridorMission]) -> String {
    let keys: Vec<&str> = MEASURES.iter().map(|measure| measure.key).collect();
    let mut text = format!("seed,exceptions,commander,{}\n", keys.join(","));
    for mission in missions {
        let plan = &mission.plan;
        for (arm, score) in arms.iter().zip(&mission.scores) {
            let values = MEASURES.map(|measure| format!("{:.4}", (measure.of)(score)));
            let (seed, name) = (plan.seed, plan.name());
            let values = values.join(",");
            text.push_str(&format!("{seed},{name},{},{values}\n", arm.name()));
        }
    }
    text
}

/// The report.
pub fn say(archive: &mut Archive, arms: &[CorridorArm], missions: &[CorridorMission]) {
    let table = Table { arms, missions };
    archive.say(&format!(
        "{} missions in corridors of 8 to 12 m, half of them with another way to the goal; \
         exceptions, places, soils and noise are drawn from seeds. Every commander drives each of \
         them in the same world, through navigation, detector and identifier. At most {LIMIT_S:.0} \
         s; help comes {HELP_S:.0} s after it was called. Points: `bench/corridors.toml`. \
         *ladder*: `--sweep` tunes it on other missions.\n",
        missions.len(),
    ));
    archive.say(
        "| points, mean ± 95 % | missions | Vigil | ladder | without | Vigil less ladder | p |",
    );
    archive.say("|---|---|---|---|---|---|---|");
    for (group, name) in selections() {
        let cell = |arm| {
            let found = table.mean(group, arm, POINTS);
            format!("{:.1} ± {:.1}", found.mean, found.half_width)
        };
        let found = table.against(group, 1, POINTS);
        archive.say(&format!(
            "| {name} | {} | {} | {} | {} | {:+.1} ± {:.1} | {:.1e} |",
            table.values(group, 0, POINTS.of).len(),
            cell(0),
            cell(1),
            cell(2),
            found.difference,
            found.half_width,
            found.p,
        ));
    }
    archive.say("\n| mean of all | Vigil | ladder | without |");
    archive.say("|---|---|---|---|");
    for measure in MEASURES.into_iter().skip(1) {
        let cell = |arm| {
            format!(
                "{:.*}",
                measure.decimals,
                table.mean(None, arm, measure).mean
            )
        };
        archive.say(&format!(
            "| {} | {} | {} | {} |",
            measure.name,
            cell(0),
            cell(1),
            cell(2)
        ));
    }
    archive.say("");
    let short = shortfalls(arms, missions);
    for line in &short {
        archive.say(&format!("- Short: {line}."));
    }
    if short.is_empty() {
        archive.say("Vigil is above the ladder, p < .001.");
    }
}

/// The bars that are missed.
#[must_use]
pub fn shortfalls(arms: &[CorridorArm], missions: &[CorridorMission]) -> Vec<String> {
    let table = Table { arms, missions };
    let is_ladder = |arm: &CorridorArm| matches!(arm, CorridorArm::Ladder(_));
    let ladder = arms.iter().position(is_ladder);
    let found = ladder.map(|ladder| table.against(None, ladder, POINTS));
    let short = found.and_then(|found| without_lead(&found));
    let vigil = table.values(None, 0, TOUCHES.of);
    short.into_iter().chain(hits(&vigil)).collect()
}

/// The bar on points: above the ladder, not by chance.
pub(super) fn without_lead(found: &PairedDifference) -> Option<String> {
    let (difference, half_width, p) = (found.difference, found.half_width, found.p);
    let leads = difference > 0.0 && p < P_MAX;
    (!leads).then(|| {
        format!(
            "{difference:+.1} ± {half_width:.1} against the ladder, p {p:.1e}, \
             bar above 0 and p < .001"
        )
    })
}

/// The bar on safety: no mission of Vigil's in which it runs into something.
pub(super) fn hits(touches: &[f64]) -> Option<String> {
    let hit = touches.iter().filter(|count| **count > 0.0).count();
    let missions = touches.len();
    (hit > 0).then(|| format!("Vigil ran into something in {hit} of {missions} missions, bar 0"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corridors::{CorridorGraph, CorridorPlan};
    use crate::variation::Variation;

    #[test]
    fn the_bar_is_judged_by_the_paired_difference() {
        let graph = CorridorGraph::read(Variation::default(), None).unwrap();
        let arms = graph.arms();
        let driven = |lead: f64| -> Vec<CorridorMission> {
            let mission = |plan: CorridorPlan| {
                let noise = (plan.seed % 3) as f64;
                let score = |points: f64| CorridorScore {
                    points,
                    ..CorridorScore::default()
                };
                CorridorMission {
                    scores: vec![score(lead + noise), score(1.0), score(0.0)],
                    plan,
                }
            };
            graph.plans(30, 0).into_iter().map(mission).collect()
        };
        assert_eq!(hits(&[0.0, 0.0]), None);
        let found = hits(&[0.0, 2.0, 1.0]).unwrap();
        assert_eq!(found, "Vigil ran into something in 2 of 3 missions, bar 0");
        // The differences lead - 1 + {0, 1, 2} have a standard error of .15.
        assert!(shortfalls(&arms, &driven(1.0)).is_empty());
        assert_eq!(shortfalls(&arms, &driven(0.2)).len(), 1);
        assert_eq!(shortfalls(&arms, &driven(-3.0)).len(), 1);
        let csv = lines(&arms, &driven(1.0));
        assert_eq!(csv.lines().count(), 1 + 30 * 3);
    }
}
