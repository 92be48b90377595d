//! Departures of constant size: from which size on are they announced?

use std::collections::BTreeSet;

use serde::Deserialize;

use super::bar::Bar;
use super::report::Outcome;
use super::scenario::Scenario;

/// Sizes over the tolerance that are tried.
const OVER_TOLERANCE: [f64; 8] = [0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0];
/// So much of the tolerance and less is healthy.
const HEALTHY: f64 = 0.5;
/// So much of it and more is a fault. Between, only the curve is reported.
const FAULTY: f64 = 2.0;
/// Bars of healthy sizes.
const HEALTHY_BARS: [&str; 1] = ["detected <= 0"];
/// Bars of faulty sizes.
const FAULTY_BARS: [&str; 2] = ["detected >= 1", "standing_share_10s >= 0.99"];

/// How large a departure is. A scenario of its own is made of each size, which takes the place of
/// `SIZE` in `faults`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Departure {
    /// The largest size that is still healthy, in the unit of the change.
    pub tolerance: f64,
    /// Unit of the tolerance.
    pub unit: String,
    /// What the change's parameter is without a departure: 1 of a factor; default 0.
    #[serde(default)]
    pub base: f64,
    /// Size over tolerance of this scenario.
    #[serde(skip)]
    pub over: f64,
}

impl Departure {
    /// A scenario for each size.
    pub(super) fn spread(&self, scenario: &Scenario) -> Result<Vec<Scenario>, String> {
        let one = |over: f64| {
            let size = format!("{:.6}", self.base + over * self.tolerance);
            let of_size: &[&str] = match over {
                o if o <= HEALTHY => &HEALTHY_BARS,
                o if o >= FAULTY => &FAULTY_BARS,
                _ => &[],
            };
            let of_size = of_size.iter().map(|bar| bar.parse::<Bar>());
            let mut bars = scenario.bars.clone();
            bars.extend(of_size.collect::<Result<Vec<Bar>, String>>()?);
            let faults = scenario.faults.iter();
            Ok(Scenario {
                name: format!("{}/{over}", scenario.name),
                faults: faults.map(|spec| spec.replace("SIZE", &size)).collect(),
                departure: Some(Self {
                    over,
                    ..self.clone()
                }),
                bars,
                ..scenario.clone()
            })
        };
        OVER_TOLERANCE.into_iter().map(one).collect()
    }
}

/// A table of the departures: share of runs with an alarm, and share of time with it, against size
/// over tolerance; nothing without a departure.
pub(super) fn table(outcomes: &[Outcome<'_>]) -> Vec<String> {
    let departures = outcomes.iter().filter_map(|outcome| {
        let departure = outcome.scenario.departure.as_ref()?;
        let name = outcome.scenario.name.rsplit_once('/')?.0;
        Some((name, departure, outcome))
    });
    let departures: Vec<(&str, &Departure, &Outcome<'_>)> = departures.collect();
    let mut rows = Vec::new();
    for (name, departure, outcome) in &departures {
        let (sensors, runs) = (outcome.sensors, outcome.runs.len());
        let (tolerance, unit) = (departure.tolerance, &departure.unit);
        let tolerance = format!("{tolerance} {unit}").trim_end().to_owned();
        let row = (*name, sensors, tolerance, runs);
        if !rows.contains(&row) {
            rows.push(row);
        }
    }
    let Some(columns) = columns(departures.iter().map(|(_, departure, _)| departure.over)) else {
        return Vec::new();
    };
    let words: Vec<String> = columns.iter().map(f64::to_string).collect();
    let mut lines =
        vec![
        String::new(),
        "Departures of constant size: share of runs with an alarm after the onset, and share of \
         the time from 10 s on with it, against size over tolerance."
            .to_owned(),
        format!("| departure | sensors | tolerance | runs | {} |", words.join(" | ")),
        format!("|---|---|---|---{}|", "|---".repeat(columns.len())),
    ];
    for (name, sensors, tolerance, runs) in rows {
        let cell = |over: &f64| {
            let mut mine = departures.iter().filter(|(of, departure, outcome)| {
                let is_same = *of == name && outcome.sensors == sensors;
                is_same && departure.over.total_cmp(over).is_eq()
            });
            mine.next()
                .map_or(String::new(), |(_, _, outcome)| shares(outcome))
        };
        let cells: Vec<String> = columns.iter().map(cell).collect();
        lines.push(format!(
            "| {name} | {sensors} | {tolerance} | {runs} | {} |",
            cells.join(" | ")
        ));
    }
    lines
}

/// Each once, in order; `None` without one.
fn columns(all: impl Iterator<Item = f64>) -> Option<Vec<f64>> {
    // Sizes are not negative: their bits are in their order.
    let bits: BTreeSet<u64> = all.map(f64::to_bits).collect();
    (!bits.is_empty()).then(|| bits.into_iter().map(f64::from_bits).collect())
}

fn shares(outcome: &Outcome<'_>) -> String {
    let share = |name: &str| {
        let mut all = outcome.figures.iter();
        let figure = all.find(|figure| figure.name == name);
        let value = figure.and_then(|figure| figure.value);
        value.map_or("-".to_owned(), |value| format!("{value:.2}"))
    };
    format!("{}, {}", share("detected"), share("standing_share_10s"))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use vigil_evaluation::scoring::field::{JudgedTime, Onset, Run};

    use super::*;
    use crate::field::scenario::File;

    /// A run whose departure was announced or not, and stood for so much of 40 s.
    fn run(delay_s: Option<f64>, alarm_s: f64) -> Run {
        let onset = Onset {
            t_s: 10.0,
            until_s: 60.0,
            delay_s,
            leaf: [None; 3],
            side: [None; 3],
            size: None,
        };
        Run {
            onsets: vec![onset],
            from_10_s: JudgedTime {
                driven_s: 40.0,
                alarm_s,
                ..JudgedTime::default()
            },
            ..Run::default()
        }
    }

    #[test]
    fn the_table_has_a_row_for_each_departure_and_a_column_for_each_size() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("field.toml");
        let file = File::read(&path).unwrap();
        let of = |name: &str, runs: Vec<Run>| {
            let scenario = file.scenario.iter().find(|s| s.name == name).unwrap();
            Outcome::new(scenario, "pose", runs)
        };
        let outcomes = [
            of(
                "departure/steer/3",
                vec![run(Some(0.5), 40.0), run(Some(1.0), 36.0)],
            ),
            of(
                "departure/steer/0.5",
                vec![run(None, 0.0), run(Some(1.0), 2.0)],
            ),
            of("departure/tether/0.5", vec![run(None, 0.0)]),
            of("healthy/random", vec![run(None, 0.0)]),
        ];
        let lines = table(&outcomes);
        let wanted = [
            "| departure | sensors | tolerance | runs | 0.5 | 3 |",
            "|---|---|---|---|---|---|",
            "| departure/steer | pose | 0.014 rad | 2 | 0.50, 0.03 | 1.00, 0.95 |",
            "| departure/tether | pose | 24 N | 1 | 0.00, 0.00 |  |",
        ];
        assert_eq!(lines[2..], wanted);
        assert!(table(&outcomes[3..]).is_empty());
    }
}
