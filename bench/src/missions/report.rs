//! Missions in words and numbers.

use serde_json::{Value, json};

use super::commander::Arm;
use super::drive::Mission;
use super::kind::Kind;
use super::score::{CALLS, MEASURES, Measure, POINTS, Score, UNSAFE};
use super::table::{ODDS, Table};
use super::{HELP_S, LIMIT_S, MissionFile};
use crate::archive::Archive;
use crate::interval::Interval;
use crate::variation::{Commanded, Comparison};

/// Least lower bound of Vigil less a rule, for kinds whose faults are modelled, and for others.
const MODELLED_MIN: f64 = -3.0;
const UNMODELLED_MIN: f64 = -10.0;
/// Most needless stops an hour.
const STOPS_1_H_MAX: f64 = 0.5;

/// All figures.
#[must_use]
pub fn document(file: &MissionFile, arms: &[Arm], missions: &[Mission]) -> Value {
    let table = Table {
        file,
        arms,
        missions,
    };
    let mut document = table.document();
    document["missions"] = json!(missions.len());
    document["limit_s"] = json!(LIMIT_S);
    document["help_s"] = json!(HELP_S);
    document["short"] = json!(shortfalls(file, arms, missions));
    document
}

/// What the missions of a variation of this name brought, weighed over the kinds. Harm is the share
/// that ended unsafely.
#[must_use]
pub fn compare(file: &MissionFile, arms: &[Arm], missions: &[Mission], name: &str) -> Comparison {
    let table = Table {
        file,
        arms,
        missions,
    };
    let mean = |arm, measure| table.over_kinds(1.0, |kind| table.mean(kind, arm, measure));
    let commanded = |(at, arm): (usize, &Arm)| Commanded {
        name: arm.name(),
        points: mean(at, POINTS),
        vigil_less: table.over_kinds(1.0, |kind| table.against(kind, at, POINTS)),
        calls: mean(at, CALLS).mean,
        harm: mean(at, UNSAFE).mean,
    };
    Comparison {
        name: name.to_owned(),
        commanders: arms.iter().enumerate().map(commanded).collect(),
    }
}

/// One line of CSV per mission and commander, with a head.
#[must_use]
pub fn lines(arms: &[Arm], missions: &[Mission]) -> String {
    let keys: Vec<&str> = MEASURES.iter().map(|measure| measure.key).collect();
    let mut text = format!("seed,kind,fault,onset_m,commander,{}\n", keys.join(","));
    for mission in missions {
        let plan = &mission.plan;
        let broken = plan.breakdown.as_ref();
        let (name, onset_m) = broken.map_or(("", -1.0), |b| (b.name(), b.onset_m));
        for (arm, score) in arms.iter().zip(&mission.scores) {
            let values = MEASURES.map(|measure| format!("{:.4}", (measure.of)(score)));
            text.push_str(&format!(
                "{},{},{name},{onset_m:.2},{},{}\n",
                plan.seed,
                plan.kind.name(),
                arm.name(),
                values.join(",")
            ));
        }
    }
    text
}

/// The report.
pub fn say(
    archive: &mut Archive,
    file: &MissionFile,
    arms: &[Arm],
    missions: &[Mission],
    rate_hz: f64,
) {
    let table = Table {
        file,
        arms,
        missions,
    };
    let per_kind = missions.len() / Kind::ALL.len();
    archive.say(&format!(
        "{per_kind} missions of each kind, of 20 m at {rate_hz} Hz; paths, soils, faults and noise \
         are drawn from seeds. Every commander drives each of them in the same world. A pilot who \
         knows where the rover is steers it back to its path. At most {LIMIT_S:.0} s; help comes \
         {HELP_S:.0} s after it was called, mends everything, and the mission goes on. Points and \
         shares: `bench/missions.toml`.\n"
    ));
    archive.say(
        "*careful*, *stop and call*, *ladder*: rules, each tuned on other missions (`--sweep`). \
         *Q-MDP*: Vigil with this policy of the same model. *told the fault*: knows what breaks, \
         when, and how it goes on. *told at the alarm*: knows all of it from \
         the detector's first alarm on; what is lost until then, no decision can save.\n",
    );
    archive.say("## Points\n");
    let names: Vec<&str> = arms.iter().map(Arm::name).collect();
    let head = |first: &str, names: &[&str]| {
        let line = format!("| {first} | {} |", names.join(" | "));
        format!("{line}\n|---|{}", "---|".repeat(names.len()))
    };
    archive.say(&head("mean ± 95 %", &names));
    let row = |name: &str, cells: Vec<String>| format!("| {name} | {} |", cells.join(" | "));
    for (name, cell) in rows(&table, POINTS, Side::Mean) {
        archive.say(&row(&name, cell));
    }
    archive.say("");
    archive.say(&head(
        "Vigil less ... (paired)",
        names.get(1..).unwrap_or(&[]),
    ));
    for (name, cell) in rows(&table, POINTS, Side::Difference) {
        archive.say(&row(&name, cell));
    }
    archive.say("\n## Other figures, over all kinds\n");
    archive.say(&head("mean ± 95 %", &names));
    for measure in MEASURES.into_iter().skip(1) {
        let cell = |arm| table.over_kinds(1.0, |kind| table.mean(kind, arm, measure));
        let cells = (0..arms.len()).map(|arm| cell(arm).text(measure.decimals, false));
        archive.say(&row(measure.name, cells.collect()));
    }
    archive.say("\n## Ended unsafely\n");
    archive.say(&head("share of missions", &names));
    for (name, cell) in rows(&table, UNSAFE, Side::Mean) {
        archive.say(&row(&name, cell));
    }
    archive.say("");
    let short = shortfalls(file, arms, missions);
    for line in &short {
        archive.say(&format!("- Short: {line}."));
    }
    if short.is_empty() {
        archive.say("All bars are reached.");
    }
}

#[derive(Clone, Copy)]
enum Side {
    Mean,
    Difference,
}

/// Names and cells: every kind, then all kinds at each of the odds.
fn rows(table: &Table<'_>, measure: Measure<Score>, side: Side) -> Vec<(String, Vec<String>)> {
    let first = match side {
        Side::Mean => 0,
        Side::Difference => 1,
    };
    let of_kind = |kind: Kind, arm: usize| match side {
        Side::Mean => table.mean(kind, arm, measure),
        Side::Difference => table.against(kind, arm, measure),
    };
    let text = |found: Interval| found.text(measure.decimals, first == 1);
    let arms = || first..table.arms.len();
    let kinds = Kind::ALL.into_iter().map(|kind| {
        let cells = arms().map(|arm| text(of_kind(kind, arm)));
        (kind.name().to_owned(), cells.collect())
    });
    let all = ODDS.into_iter().map(|(odds, name)| {
        let over = |arm| table.over_kinds(odds, |kind| of_kind(kind, arm));
        let cells = arms().map(|arm| text(over(arm)));
        (format!("all, faults {name}"), cells.collect())
    });
    kinds.chain(all).collect()
}

/// The bars that are missed.
#[must_use]
pub fn shortfalls(file: &MissionFile, arms: &[Arm], missions: &[Mission]) -> Vec<String> {
    let table = Table {
        file,
        arms,
        missions,
    };
    let mut short = Vec::new();
    short.extend(overall(&table));
    short.extend(by_kind(&table));
    short.extend(against_heuristic(&table));
    let unsafe_ends = missions.iter().filter_map(|mission| mission.scores.first());
    let unsafe_ends = unsafe_ends.filter(|score| score.is_unsafe()).count();
    if unsafe_ends > 0 {
        short.push(format!(
            "{unsafe_ends} of {} missions ended unsafely, bar 0",
            missions.len()
        ));
    }
    let rate = |key: &str| {
        let measure = MEASURES.into_iter().find(|measure| measure.key == key);
        let of = |measure| {
            table
                .over_kinds(1.0, |kind| table.mean(kind, 0, measure))
                .mean
        };
        measure.map_or(f64::NAN, of)
    };
    let stops_1_h = rate("needless_stops") / rate("time_s") * 3600.0;
    if stops_1_h > STOPS_1_H_MAX {
        short.push(format!(
            "{stops_1_h:.2} needless stops an hour, bar {STOPS_1_H_MAX}"
        ));
    }
    short
}

/// Against the best rule over all kinds, and at least half of its gap to who is told.
fn overall(table: &Table<'_>) -> Vec<String> {
    let mut short = Vec::new();
    let told = table.arms.iter().position(|arm| *arm == Arm::Told);
    for (odds, name) in ODDS {
        let Some((rule, told)) = table.best_rule(odds).zip(told) else {
            continue;
        };
        let against = |arm| table.over_kinds(odds, |kind| table.against(kind, arm, POINTS));
        let (gained, left) = (against(rule), against(told));
        let gap = gained.mean - left.mean;
        if gained.lower() <= 0.0 {
            let found = gained.text(1, true);
            let rule = table.arms[rule].name();
            short.push(format!("{found} against {rule} ({name}), bar above 0"));
        }
        if gained.mean < 0.5 * gap {
            short.push(format!(
                "{:+.1} of a gap of {gap:.1} to who is told ({name}), bar half",
                gained.mean
            ));
        }
    }
    short
}

/// Over all kinds, against the heuristic policy of the same model.
fn against_heuristic(table: &Table<'_>) -> Option<String> {
    let heuristic = table.arms.iter().position(|arm| *arm == Arm::Heuristic)?;
    let found = table.over_kinds(1.0, |kind| table.against(kind, heuristic, POINTS));
    let name = table.arms[heuristic].name();
    let text = || format!("{} against {name}, bar above 0", found.text(1, true));
    (found.lower() <= 0.0).then(text)
}

/// By kind, against every rule.
fn by_kind(table: &Table<'_>) -> Vec<String> {
    let mut short = Vec::new();
    for kind in Kind::ALL {
        let bar = match kind {
            // Most of what grows is modelled by nothing: ropes, sinking wheels.
            Kind::Unmodelled | Kind::Growing => UNMODELLED_MIN,
            _ => MODELLED_MIN,
        };
        for rule in table.rules() {
            let found = table.against(kind, rule, POINTS);
            if found.lower() < bar {
                let (found, rule) = (found.text(1, true), table.arms[rule].name());
                short.push(format!(
                    "{found} against {rule} ({}), bar {bar:+} for the lower bound",
                    kind.name()
                ));
            }
        }
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::{Plan, ShippedGraph};
    use crate::variation::Variation;

    #[test]
    fn bars_are_judged_by_the_paired_difference() {
        let shipped = ShippedGraph::read("rover.toml".as_ref(), Variation::default()).unwrap();
        let arms = shipped.arms();
        // Points of Vigil, the three rules, Q-MDP, without, told, told at the alarm.
        let driven = |points: [f64; 8], unanswered_m: f64| -> Vec<Mission> {
            let plans = Plan::of_all_kinds(3, 1).into_iter();
            let mission = |plan: Plan| {
                let noise = (plan.seed % 3) as f64;
                let score = |points: f64| Score {
                    points: points + noise,
                    unanswered_m,
                    time_s: 100.0,
                    ..Score::default()
                };
                Mission {
                    plan,
                    scores: points.map(score).to_vec(),
                }
            };
            plans.map(mission).collect()
        };
        let short = |points, unanswered_m| {
            shortfalls(&shipped.missions, &arms, &driven(points, unanswered_m))
        };
        assert!(short([8.0, 0.0, -5.0, -9.0, 7.0, -9.0, 10.0, 9.0], 0.5).is_empty());
        // 4 of a gap of 10, at three odds; and every mission ended unsafely.
        let found = short([4.0, 0.0, -5.0, -9.0, 3.0, -9.0, 10.0, 9.0], 1.5);
        assert_eq!(found.len(), 4, "{found:?}");
        assert_eq!(found[3], "21 of 21 missions ended unsafely, bar 0");
        // Behind the ladder: overall twice at each of the odds, and in every kind but the two with
        // a wider bar.
        let found = short([0.0, -9.0, -9.0, 5.0, 1.0, -9.0, 10.0, 9.0], 0.0);
        assert_eq!(found.len(), 6 + 5 + 1, "{found:?}");
        assert_eq!(found[11], "-1.0 ± 0.0 against Q-MDP, bar above 0");
        assert_eq!(
            found[0],
            "-5.0 ± 0.0 against ladder (as stated), bar above 0"
        );
    }
}
