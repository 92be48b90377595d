//! Whether a log shows what a model must know.

use vigil_robot::Description;
use vigil_robot::channel_model::AXES;
use vigil_robot::channel_model::{History, Model, Range};

use super::LogError;
use super::noise::MOVING_S;
use super::record::{FOLDS, Record};
use super::told::is_settled;
use crate::correlation::correlation;

/// Motion needed, s.
const MOVING_MIN_S: f64 = 10.0;
/// Part of an axis's limit over which its commands must vary.
const WIDTH_MIN: f64 = 0.05;
/// Correlation of two axes from which they count as one.
const TOGETHER: f64 = 0.98;
/// Pieces of an axis's range, each of which counts as driven from so many observations on, or from
/// such a part of all.
const PIECES: usize = 20;
const DRIVEN_MIN: usize = 3;
const DRIVEN_PART: f64 = 0.002;
/// Part of an axis's range that must be left out to count as a gap.
const GAP: f64 = 0.15;

/// Ranges of the command in motion, and what was left out within them.
pub(super) fn ranges(records: &[Record], robot: &Description) -> Result<Vec<Range>, LogError> {
    let found_s: f64 = records.iter().map(Record::moving_s).sum();
    if found_s < MOVING_MIN_S {
        return Err(LogError::Still {
            found_s,
            needed_s: MOVING_MIN_S,
        });
    }
    let newest = || {
        records
            .iter()
            .flat_map(|r| &r.histories)
            .filter_map(|h| h.ago(0))
    };
    let moving = || newest().filter(|now| now.moving);
    let mut ranges = Vec::with_capacity(robot.command.len());
    for (i, axis) in robot.command.iter().enumerate() {
        let commands = || moving().filter_map(|now| now.command.get(i).copied());
        let (min, max) = (
            commands().fold(f64::INFINITY, f64::min),
            commands().fold(f64::NEG_INFINITY, f64::max),
        );
        let needed = WIDTH_MIN * axis.limit;
        if max - min < needed {
            return Err(LogError::Unexcited {
                axis: axis.name.clone(),
                unit: axis.unit.clone(),
                min,
                max,
                needed,
            });
        }
        ranges.push(Range {
            name: axis.name.clone(),
            unit: axis.unit.clone(),
            min,
            max,
            size: min.abs().max(max.abs()).max(1e-9),
            gaps: Vec::new(),
        });
    }
    for i in 0..ranges.len() {
        for j in 0..i {
            let pairs: Vec<(f64, f64)> = moving()
                .map(|now| (now.command[i], now.command[j]))
                .collect();
            let correlation = correlation(&pairs);
            if correlation.abs() > TOGETHER {
                return Err(LogError::Together {
                    one: ranges[j].name.clone(),
                    other: ranges[i].name.clone(),
                    correlation,
                });
            }
        }
    }
    let settled = settled(records, &ranges);
    for (i, range) in ranges.iter_mut().enumerate() {
        let mut values: Vec<f64> = settled.iter().map(|command| command[i]).collect();
        range.gaps = gaps(&mut values, range);
    }
    Ok(ranges)
}

/// For each part of the log a model with the ranges that were driven in the others.
pub(super) fn of_parts(records: &[Record], model: &Model) -> Vec<Model> {
    let part = |fold: usize| {
        let mut part = model.clone();
        let others = || {
            let all = records
                .iter()
                .flat_map(|r| r.histories.iter().zip(&r.folds));
            let others = all.filter(move |(_, other)| **other != fold);
            others.filter_map(|(history, _)| history.ago(0).filter(|now| now.moving))
        };
        for (i, range) in part.command.iter_mut().enumerate() {
            let values = others().map(|now| now.command[i]);
            let (min, max) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), x| {
                (min.min(x), max.max(x))
            });
            if min < max {
                (range.min, range.max) = (min, max);
            }
        }
        part
    };
    (0..FOLDS).map(part).collect()
}

/// Commands that were kept up in motion.
pub(super) fn settled(records: &[Record], ranges: &[Range]) -> Vec<[f64; AXES]> {
    let histories = records.iter().flat_map(|record| &record.histories);
    let command = |history: &History| {
        let now = history.ago(0)?;
        let counts = now.moving && now.moving_s >= MOVING_S;
        (counts && is_settled(history, ranges)).then_some(now.command)
    };
    histories.filter_map(command).collect()
}

/// Wide stretches of the range in which hardly anything was driven.
fn gaps(values: &mut Vec<f64>, range: &Range) -> Vec<[f64; 2]> {
    let width = range.max - range.min;
    let piece = |value: f64| {
        let at = (value - range.min) / width * PIECES as f64;
        (at.max(0.0) as usize).min(PIECES - 1)
    };
    let mut counts = [0_usize; PIECES];
    for &value in values.iter() {
        counts[piece(value)] += 1;
    }
    let needed = DRIVEN_MIN.max((DRIVEN_PART * values.len() as f64) as usize);
    values.retain(|&value| counts[piece(value)] >= needed);
    values.extend([range.min, range.max]);
    values.sort_by(f64::total_cmp);
    let pairs = values.windows(2).map(|pair| [pair[0], pair[1]]);
    pairs.filter(|[from, to]| to - from > GAP * width).collect()
}
