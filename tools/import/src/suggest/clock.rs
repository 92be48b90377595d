//! Which column of a table is its time, and in which unit.

use crate::series::median;
use crate::survey::{SurveyTable, Values};

/// Units with their size, s, and the step in them that a clock since 1970 passes: the year 2001.
const UNITS: [(&str, f64, f64); 4] = [
    ("ns", 1e-9, 1e18),
    ("us", 1e-6, 1e15),
    ("ms", 1e-3, 1e12),
    ("s", 1.0, 1e9),
];
/// Rates that a log of a robot has, Hz: slower is a log of events, faster one of sound.
const RATE_MIN_HZ: f64 = 0.5;
const RATE_MAX_HZ: f64 = 2000.0;
/// Share of steps that do not go back, and of those that rise, in a clock: messages may come a
/// little out of order, and may come in packets.
const FORWARD_MIN: f64 = 0.95;
const RISING_MIN: f64 = 0.4;

/// The time of a table.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TimeColumn {
    /// Column, as a description names it.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// One unit, s.
    pub factor: f64,
    /// Times, s.
    pub time_s: Vec<f64>,
    /// True if the unit follows from the values: not so for a time from the start of a run.
    pub is_unit_sure: bool,
}

impl TimeColumn {
    /// Finds it; none if no column can be a time.
    pub fn find(table: &SurveyTable) -> Option<Self> {
        let scored = table
            .columns
            .iter()
            .map(|column| (score(table, &column.name), column));
        let mut scored: Vec<(u32, &Values)> = scored.filter(|(score, _)| *score > 0).collect();
        scored.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
        let (_, column) = scored
            .into_iter()
            .find(|(_, column)| rises(&column.values))?;
        let (unit, factor, is_unit_sure) = unit(column)?;
        let name = match (table.layout, column.name.as_str()) {
            (None, "header.stamp") => "stamp",
            (_, name) => name,
        };
        Some(Self {
            name: name.to_owned(),
            unit,
            factor,
            time_s: column.values.iter().map(|value| value * factor).collect(),
            is_unit_sure,
        })
    }

    /// Median step, s.
    pub fn period_s(&self) -> Option<f64> {
        median(steps(&self.time_s).filter(|step| *step > 0.0).collect())
    }
}

impl SurveyTable {
    /// Rows a second, from the median of its time's steps; none without a time.
    #[must_use]
    pub fn rate_hz(&self) -> Option<f64> {
        Some(1.0 / TimeColumn::find(self)?.period_s()?)
    }
}

/// How much a name looks like a time; 0: not at all.
fn score(table: &SurveyTable, name: &str) -> u32 {
    if table.layout.is_none() {
        return match name {
            "header.stamp" => 2,
            "log_time" => 1,
            _ => 0,
        };
    }
    let name = name.to_lowercase();
    let name = name.trim_start_matches("field.");
    match name {
        "header.stamp" => 6,
        "t" | "time" | "timestamp" | "stamp" | "time_s" | "t_s" | "sec" | "secs" | "seconds" => 5,
        "%time" => 4,
        "time_stamp" => 1,
        _ if name.starts_with("time") || name.starts_with("t_") => 3,
        _ if name.contains("time") || name.contains("stamp") => 2,
        _ => 0,
    }
}

fn steps(values: &[f64]) -> impl Iterator<Item = f64> {
    values.windows(2).map(|pair| pair[1] - pair[0])
}

fn rises(values: &[f64]) -> bool {
    let steps: Vec<f64> = steps(values).filter(|step| step.is_finite()).collect();
    let share = |count: usize| count as f64 / steps.len().max(1) as f64;
    let forward = steps.iter().filter(|step| **step >= 0.0).count();
    let rising = steps.iter().filter(|step| **step > 0.0).count();
    share(forward) >= FORWARD_MIN && share(rising) >= RISING_MIN
}

/// The unit of a time: since 1970 its size tells it; else a name that ends in it, or the first in
/// which the rate is that of a log.
fn unit(column: &Values) -> Option<(&'static str, f64, bool)> {
    let last = column
        .values
        .iter()
        .copied()
        .filter(|v| v.is_finite())
        .fold(0.0, f64::max);
    if let Some((unit, factor, _)) = UNITS.iter().find(|(_, _, since)| last >= *since) {
        return Some((unit, *factor, true));
    }
    let step = median(steps(&column.values).filter(|step| *step > 0.0).collect())?;
    let fits = |factor: f64| (RATE_MIN_HZ..=RATE_MAX_HZ).contains(&(1.0 / (step * factor)));
    let named = |unit: &str| {
        let name = column.name.to_lowercase();
        ["_", "[", "(", " "].iter().any(|before| {
            name.trim_end_matches([']', ')'])
                .ends_with(&format!("{before}{unit}"))
        })
    };
    let units = UNITS.iter().rev();
    let named = units
        .clone()
        .find(|(unit, factor, _)| named(unit) && fits(*factor));
    if let Some((unit, factor, _)) = named {
        return Some((unit, *factor, true));
    }
    let mut fitting = units.filter(|(_, factor, _)| fits(*factor));
    fitting
        .next()
        .map(|(unit, factor, _)| (*unit, *factor, false))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_follows_from_size_name_or_rate() {
        let of = |name: &str, start: f64, step: f64| {
            let values = (0..100).map(|i| start + f64::from(i) * step).collect();
            let column = Values {
                name: name.into(),
                values,
            };
            unit(&column).map(|(unit, _, is_sure)| (unit, is_sure))
        };
        assert_eq!(of("stamp", 1.7e18, 2e7), Some(("ns", true)));
        assert_eq!(of("stamp", 1.7e15, 2e4), Some(("us", true)));
        assert_eq!(of("stamp", 1.7e12, 20.0), Some(("ms", true)));
        assert_eq!(of("stamp", 1.7e9, 0.02), Some(("s", true)));
        assert_eq!(of("t", 0.0, 0.02), Some(("s", false)));
        assert_eq!(of("t", 0.0, 33.0), Some(("ms", false)));
        assert_eq!(of("t_ms", 0.0, 1.0), Some(("ms", true)));
        assert_eq!(of("time [us]", 0.0, 1000.0), Some(("us", true)));
    }
}
